"""Changing stiffness and damping while a hand is on the tool, without adding energy."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.compliance.impedance import DAMPING, MASS, STIFFNESS
from pfsc_drake.control.manifolds.manifold import Coordinate, Kind
from pfsc_drake.errors import InputError

# a wish that leaves a parameter as it would be without
AS_GIVEN = -1.0
KINDS = tuple(Kind)
# stiffness and damping of each kind
WISHES = 2 * len(KINDS)


def wishes_of(kind: Kind) -> tuple[int, int]:
    """Return where stiffness and damping of a kind stand among the wishes."""
    first = 2 * KINDS.index(kind)
    return first, first + 1


@dataclass
class TuningParameters:
    """How parameters follow a wish.

    Attributes:
        ramp: Time constant with which they approach it [s].
        reserve: Energy that growing springs may take before anything has been dissipated [J].
        capacity: Largest energy that is kept of what dampers dissipate [J].
        returning_stiffness: Stiffness by which what becomes rigid is led back, of lengths [N/m].
        returning_turn_stiffness: The same of angles [Nm/rad].
        caught_within: Distance from the reference within which it becomes rigid [m, rad].
        caught_below: Speed relative to the reference below which it does [m/s, rad/s].
    """

    ramp: float = 0.1
    reserve: float = 0.05
    capacity: float = 0.5
    returning_stiffness: float = 2e4
    returning_turn_stiffness: float = 200.0
    caught_within: float = 1e-4
    caught_below: float = 5e-3

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if not 0.0 <= value < math.inf or (value == 0.0 and key not in ("ramp", "reserve")):
                raise InputError(f"{key} = {value}: must be positive and finite")


class ImpedanceTuning:
    """Leads mass, damping and stiffness from what they are to what somebody wishes.

    The motion itself never jumps (:class:`ImpedanceLaw`), but a spring that becomes stiffer by
    dk while it is deflected by e takes ``dk e^2 / 2`` from nowhere, and gives it to
    whoever holds the tool: 62 mJ for 5 kN/m at 5 mm, again and again if it is softened at
    depth and stiffened there. So every rise is paid from a tank

        ``x+ = min(x_max, x + T sum d_i min(e_i'^2, last e_i'^2)) - sum max(dk_i, 0) e_i^2 / 2``

    with ``x >= 0``, which holds what the dampers have certainly dissipated over an interval in
    which the rate did not change its sign of growth. What the tank cannot pay, does not rise; on
    the manifold, e = 0, everything rises freely. Then for every motion of the hand

        ``integral of tau e' dt >= (m e'^2 + k e^2) / 2 - (the same at the start) - x_0``.

    Damping may change at any time, and stiffness may fall. Both approach a wish with a time
    constant. Where the stiffness is to be infinite again, a critically damped spring leads back,
    and the coordinate becomes rigid when it is caught within ``caught_within``; from rigid, with
    e = 0, it becomes soft at once.

    Parameters that vary over the manifold by themselves are, unless somebody wishes otherwise, what
    they are, unpaid: whoever wrote them down answers for them.

    Args:
        parameters: See :class:`TuningParameters`.
        coordinates: The m coordinates of the virtual output.
        masses: Of coordinates that are rigid as given, for the time that they are not, (m,).
        period: Sampling time T [s].
        varying: Whether the given parameters vary over the manifold.
    """

    def __init__(
        self,
        parameters: TuningParameters,
        coordinates: Sequence[Coordinate],
        masses: np.ndarray,
        period: float,
        *,
        varying: bool = False,
    ) -> None:
        self.num_outputs, self._reserve = len(coordinates), parameters.reserve
        function = _tuning_function(parameters, coordinates, masses, period, varying=varying)
        bound = BoundFunction(function)
        self._arguments, self._evaluate = list(bound.arguments.values()), bound.evaluate
        self._next = bound.results["next"]

    def start(self, given: np.ndarray) -> np.ndarray:
        """Return a memory that starts with the impedance as given, shape (4 m + 1,).

        Args:
            given: Rows mass, damping, stiffness, shape (3, m).
        """
        idle = np.zeros(self.num_outputs)
        return np.concatenate([given.ravel(), idle, [self._reserve]])

    def advance(
        self, memory: np.ndarray, given: np.ndarray, wish: np.ndarray, error: np.ndarray
    ) -> np.ndarray:
        """Return the memory after one period; its first rows are the impedance from now on.

        Args:
            memory: Impedance by rows, rates of the last tick, tank; shape (4 m + 1,).
            given: Impedance without wishes: rows mass, damping, stiffness, shape (3, m).
            wish: Stiffness and damping of each of KINDS, shape (6,); what is negative is as given.
            error: Rows ``e = y_p - y_d`` and ``e'``, shape (2, m).
        """
        if not math.isfinite(error.sum()):
            return memory
        for argument, value in zip(self._arguments, (memory, given, wish, error), strict=True):
            argument[:] = value.ravel()
        self._evaluate()
        return self._next.copy()


def _tuning_function(
    parameters: TuningParameters,
    coordinates: Sequence[Coordinate],
    masses: np.ndarray,
    period: float,
    *,
    varying: bool,
) -> ca.Function:
    """Return ``(memory, given, wish, error) -> next``, see :meth:`ImpedanceTuning.advance`."""
    m = len(coordinates)
    memory, given_rows = ca.SX.sym("memory", 4 * m + 1), ca.SX.sym("given", 3 * m)
    wish, error = ca.SX.sym("wish", WISHES), ca.SX.sym("error", 2 * m)
    last = dict(zip((MASS, DAMPING, STIFFNESS), ca.vertsplit(memory[: 3 * m], m), strict=True))
    given = dict(zip((MASS, DAMPING, STIFFNESS), ca.vertsplit(given_rows, m), strict=True))
    last_rate, tank, (e, rate) = memory[3 * m : 4 * m], memory[-1], ca.vertsplit(error, m)
    places = zip(*(wishes_of(coordinate.kind) for coordinate in coordinates), strict=True)
    asked_stiffness, asked_damping = (wish[list(place)] for place in places)
    wished_stiffness = ca.if_else(asked_stiffness < 0.0, given[STIFFNESS], asked_stiffness)
    wished_damping = ca.if_else(asked_damping < 0.0, given[DAMPING], asked_damping)
    mass = ca.if_else(given[STIFFNESS] < ca.inf, given[MASS], masses)

    was_soft, shall_be_soft = last[STIFFNESS] < ca.inf, wished_stiffness < ca.inf
    share = -math.expm1(-period / parameters.ramp) if parameters.ramp > 0.0 else 1.0
    spent = last[DAMPING] * ca.fmin(rate**2, last_rate**2)
    filled = tank + period * ca.sum1(ca.if_else(was_soft, spent, 0.0))
    tank = ca.fmin(filled, parameters.capacity)

    aim = ca.if_else(shall_be_soft, wished_stiffness, _returning(parameters, coordinates))
    change = ca.if_else(was_soft, share * (aim - last[STIFFNESS]), 0.0)
    cost = ca.sum1(ca.fmax(change, 0.0) * e**2) / 2.0
    paid = ca.if_else(cost > tank, tank / cost, 1.0)
    granted = last[STIFFNESS] + ca.if_else(change > 0.0, paid * change, change)
    # what was rigid is not deflected
    stiffness = ca.if_else(was_soft, granted, wished_stiffness)
    caught = ca.logic_and(
        ca.fabs(e) < parameters.caught_within, ca.fabs(rate) < parameters.caught_below
    )
    caught = ca.logic_and(ca.logic_not(shall_be_soft), caught)
    stiffness = ca.if_else(caught, ca.inf, stiffness)

    led_back = ca.logic_and(ca.logic_not(shall_be_soft), stiffness < ca.inf)
    critical = 2.0 * ca.sqrt(ca.if_else(led_back, stiffness, 0.0) * mass)
    approached = last[DAMPING] + share * (wished_damping - last[DAMPING])
    damping = ca.if_else(was_soft, approached, wished_damping)
    damping = ca.if_else(led_back, ca.fmax(damping, critical), damping)
    if varying:
        stiffness = ca.if_else(asked_stiffness < 0.0, given[STIFFNESS], stiffness)
        damping = ca.if_else(asked_damping < 0.0, given[DAMPING], damping)
    left = ca.fmax(tank - paid * cost, 0.0)
    return ca.Function(
        "impedance_tuning",
        [memory, given_rows, wish, error],
        [ca.cse(ca.densify(ca.vertcat(mass, damping, stiffness, rate, left)))],
        ["memory", "given", "wish", "error"],
        ["next"],
    )


def _returning(parameters: TuningParameters, coordinates: Sequence[Coordinate]) -> np.ndarray:
    """Return the stiffness by which each coordinate is led back, shape (m,)."""
    lengths, turns = parameters.returning_stiffness, parameters.returning_turn_stiffness
    return np.array([turns if c.kind is Kind.ROTATIONAL else lengths for c in coordinates])
