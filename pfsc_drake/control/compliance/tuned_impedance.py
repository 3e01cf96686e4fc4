"""Stiffness and damping that change while a hand is on the tool, without adding energy."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.compliance.impedance import ImpedanceLaw
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive

# a request that leaves a parameter as it would be without
AS_GIVEN = -1.0
KINDS = tuple(Kind)
# stiffness and damping of each kind
REQUESTS = 2 * len(KINDS)


def requests_of(kind: Kind) -> tuple[int, int]:
    """Return where stiffness and damping of a kind stand among the requests."""
    first = 2 * KINDS.index(kind)
    return first, first + 1


@dataclass
class TuningParameters(Parameters):
    """How parameters follow a request.

    Attributes:
        ramp: Time constant with which they approach it [s].
        reserve: Energy that growing springs may take before anything has been dissipated [J].
        capacity: Largest energy that is kept of what dampers dissipate [J].
        returning_stiffness: Stiffness by which what becomes rigid is led back, of lengths [N/m].
        returning_turn_stiffness: The same of angles [Nm/rad].
        caught_within: Distance from the reference within which it becomes rigid [m, rad].
        caught_below: Speed relative to the reference below which it does [m/s, rad/s].
    """

    ramp: NotNegative = 0.1
    reserve: NotNegative = 0.05
    capacity: Positive = 0.5
    returning_stiffness: Positive = 2e4
    returning_turn_stiffness: Positive = 200.0
    caught_within: Positive = 1e-4
    caught_below: Positive = 5e-3


class ImpedanceTuner(Block):
    """Leads mass, damping and stiffness from what they are to what somebody requests.

    The motion itself never jumps (:class:`ImpedanceLaw`), but a spring that becomes stiffer by
    dk while it is deflected by e takes ``dk e^2 / 2`` from nowhere, and gives it to
    whoever holds the tool: 62 mJ for 5 kN/m at 5 mm, again and again if it is softened at
    depth and stiffened there. So every rise is paid from a tank

        ``x+ = min(x_max, x + T sum d_i s_i) - sum max(dk_i, 0) e_i^2 / 2``

    with ``x >= 0``. ``s_i = min(e_i'^2, last e_i'^2)``, and zero where ``e_i'`` changed its sign,
    is what the dampers have certainly dissipated in a tick in which ``e_i'`` only rose, or only
    fell. What the tank cannot pay, does not rise; on
    the manifold, e = 0, everything rises freely. Then for every motion of the hand

        ``integral of tau e' dt >= (m e'^2 + k e^2) / 2 - (the same at the start) - x_0``.

    Damping may change at any time, and stiffness may fall. Both approach a request with a time
    constant. Where the stiffness is to be infinite again, a critically damped spring leads back,
    and the coordinate becomes rigid when it is caught within ``caught_within``; from rigid, with
    e = 0, it becomes soft at once.

    Parameters that vary over the manifold by themselves are, unless somebody asks otherwise, what
    they are, unpaid: whoever wrote them down answers for them.

    The impedance follows at once from state and inputs, so that the deflection at which a spring
    becomes stiffer is the one that is paid for. The filter's reference does not depend on it, and
    there is no algebraic loop. A motion that is not finite changes nothing.

    Ports:
        request (input): Stiffness and damping, tangential, transversal and rotational, shape (6,);
            what is negative stays as given.
        manifold_state (input): Derivatives of yhat by rows, where parameters depend on it.
        reference (input): Derivatives of y_p by rows, from :class:`ImpedanceFilter`.
        desired_reference (input): Derivatives of y_d by rows.
        impedance (output): Rows mass, damping, stiffness, shape (3 m,), from this tick on.
        tank (output): Energy that stiffening springs may take [J], shape (1,).

    State:
        Impedance by rows, rates ``e'`` of the last tick, and tank.

    Args:
        parameters: How mass and damping follow the hand.
        law: Law of the filter, whose impedance is the one without requests.
        coordinates: The m coordinates of the virtual output.
        masses: Masses of coordinates that are rigid as given, for the time that they are not, (m,).
    """

    def __init__(
        self,
        parameters: TuningParameters,
        law: ImpedanceLaw,
        coordinates: Sequence[Coordinate],
        masses: np.ndarray,
    ) -> None:
        self._parameters, self._law, self._masses = parameters, law, ca.DM(masses)
        self._returning = ca.DM(_returning(parameters, coordinates))
        places = zip(*(requests_of(coordinate.kind) for coordinate in coordinates), strict=True)
        self._stiffnesses, self._dampings = (list(place) for place in places)
        m, r = law.num_outputs, law.relative_degree
        motion = "m, rad, per s, .."
        self.inputs = {
            "request": Port(REQUESTS, "N/m, N s/m, Nm/rad, Nm s/rad"),
            "manifold_state": Port(r * m, motion),
            "reference": Port((r + 1) * m, motion),
            "desired_reference": Port((law.desired_order + 1) * m, motion),
        }
        self.outputs = {"impedance": Port(3 * m, "kg, N s/m, N/m"), "tank": Port(1, "J")}
        self.states = {"impedance": 3 * m, "rate": m, "tank": 1}
        self.inner = {"rate": m, "left": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"impedance": self._given(u), "tank": ca.DM(self._parameters.reserve)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        m = self._law.num_outputs
        error = u.reference[: 2 * m] - u.desired_reference[: 2 * m]
        known, (e, rate) = all_finite(error), ca.vertsplit(error, m)
        impedance, left = self._granted(x, self._given(u), u.request, e, rate)
        return {
            "impedance": where(known, impedance, x.impedance),
            "tank": x.tank,
            "rate": where(known, rate, x.rate),
            "left": where(known, left, x.tank),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"impedance": y.impedance, "rate": y.rate, "tank": y.left}

    def _given(self, u: Values) -> Any:
        """Return the impedance without requests, shape (3 m,)."""
        return self._law.impedance(u.manifold_state[: self._law.num_outputs])

    def _granted(self, x: Values, given: Any, request: Any, e: Any, rate: Any) -> tuple[Any, Any]:
        """Return the impedance from now on, shape (3 m,), and what is left in the tank.

        Args:
            x: States.
            given: The impedance without requests, shape (3 m,).
            request: Requested stiffnesses and dampings, as at the port ``impedance_request``.
            e: ``y_p - y_d``, shape (m,).
            rate: ``e'``, shape (m,).
        """
        parameters, T = self._parameters, self._law.period
        _, last_damping, last_stiffness = ca.vertsplit(x.impedance, e.numel())
        given_mass, given_damping, given_stiffness = ca.vertsplit(given, e.numel())
        asked_stiffness, asked_damping = request[self._stiffnesses], request[self._dampings]
        requested_stiffness = where(asked_stiffness < 0.0, given_stiffness, asked_stiffness)
        requested_damping = where(asked_damping < 0.0, given_damping, asked_damping)
        mass = where(given_stiffness < ca.inf, given_mass, self._masses)

        was_soft, shall_be_soft = last_stiffness < ca.inf, requested_stiffness < ca.inf
        share = -math.expm1(-T / parameters.ramp) if parameters.ramp > 0.0 else 1.0
        goes_on = rate * x.rate > 0.0
        spent = where(goes_on, last_damping * ca.fmin(rate**2, x.rate**2), 0.0)
        filled = x.tank + T * ca.sum1(where(was_soft, spent, 0.0))
        tank = ca.fmin(filled, parameters.capacity)

        aim = where(shall_be_soft, requested_stiffness, self._returning)
        change = where(was_soft, share * (aim - last_stiffness), 0.0)
        cost = ca.sum1(ca.fmax(change, 0.0) * e**2) / 2.0
        paid = where(cost > tank, tank / cost, 1.0)
        granted = last_stiffness + where(change > 0.0, paid * change, change)
        # what was rigid is not deflected
        stiffness = where(was_soft, granted, requested_stiffness)
        near = ca.fabs(e) < parameters.caught_within
        near = ca.logic_and(near, ca.fabs(rate) < parameters.caught_below)
        stiffness = where(ca.logic_and(ca.logic_not(shall_be_soft), near), ca.inf, stiffness)

        led_back = ca.logic_and(ca.logic_not(shall_be_soft), stiffness < ca.inf)
        critical = 2.0 * ca.sqrt(where(led_back, stiffness, 0.0) * mass)
        approached = last_damping + share * (requested_damping - last_damping)
        damping = where(was_soft, approached, requested_damping)
        damping = where(led_back, ca.fmax(damping, critical), damping)
        if not self._law.is_constant:
            stiffness = where(asked_stiffness < 0.0, given_stiffness, stiffness)
            damping = where(asked_damping < 0.0, given_damping, damping)
        return ca.vertcat(mass, damping, stiffness), ca.fmax(tank - paid * cost, 0.0)


def _returning(parameters: TuningParameters, coordinates: Sequence[Coordinate]) -> np.ndarray:
    """Return the stiffness by which each coordinate is led back, shape (m,)."""
    lengths, turns = parameters.returning_stiffness, parameters.returning_turn_stiffness
    return np.array([turns if c.kind is Kind.ROTATIONAL else lengths for c in coordinates])


def load_inertia(
    robot: RobotModel, load: ToolLoad, q: np.ndarray, added: float = 0.0
) -> np.ndarray:
    """Return the inertia of a load in joint coordinates, ``M_L(q)``, shape (N, N).

    Args:
        robot: The robot.
        load: What hangs below the sensor.
        q: Joint coordinates, shape (N,).
        added: A mass at the tool point beside it [kg].
    """
    n = robot.dimension
    v = ca.SX.sym("v", n)
    y_t, R_e = robot.tool_pose([Jet([ca.SX(float(q[i])), v[i]]) for i in range(n)])
    R_WS = R_e @ ca.SX(load.R_ST.T)
    y_C = y_t + R_WS @ ca.SX(load.p_SC - load.p_ST)
    w = ca.inv_skew(R_WS.coefficients[0].T @ R_WS.coefficients[1])
    energy = load.mass * ca.sumsqr(y_C.coefficients[1]) + ca.bilin(ca.SX(load.I_C), w, w)
    energy += added * ca.sumsqr(y_t.coefficients[1])
    return np.asarray(ca.evalf(ca.hessian(energy / 2.0, v)[0]).full())


def carried_share(inertia: np.ndarray, A: np.ndarray, masses: np.ndarray) -> tuple[float, int]:
    """Return the largest ``M_L / m`` in any direction, and the coordinate with the most part in it.

    Args:
        inertia: ``M_L`` in joint coordinates, shape (N, N), see :func:`load_inertia`.
        A: Matrix of the coordinates, ``y' = A q'``, shape (m, N).
        masses: Masses of the impedance [kg or kg m^2], shape (m,), infinite for what does not
            yield.

    Returns:
        Zero where nothing yields.
    """
    yielding = np.flatnonzero(np.isfinite(masses))
    if not yielding.size:
        return 0.0, 0
    to_joints = np.linalg.pinv(A)[:, yielding] / np.sqrt(masses[yielding])
    values, vectors = np.linalg.eigh(to_joints.T @ inertia @ to_joints)
    return float(values[-1]), int(yielding[np.argmax(np.abs(vectors[:, -1]))])


def bearable_share(delay: float, bandwidth: float = np.inf) -> float:
    """Return the ``M_L / m`` at which the circle becomes unstable.

    Args:
        delay: ``T_d`` in it, positive [s].
        bandwidth: ``omega`` of velocity servos [rad/s].
    """
    if np.isinf(bandwidth):
        return 1.0
    turned = brentq(lambda w: w * delay + np.arctan(w / bandwidth) - np.pi, 0.0, np.pi / delay)
    return float(np.hypot(1.0, turned / bandwidth))


def bearable_inertia_error(mass: float, damping: float, stiffness: float, rate: float) -> float:
    """Return how much too large an inertia may be believed before the compliance is unstable.

    ``dM < m + d / L - m k / (k + d L)``; the tool swings at ``sqrt((k + d L) / m)`` there.

    Args:
        mass: ``m`` [kg or kg m^2], positive.
        damping: ``d`` [N s/m or Nm s/rad]; with ``k`` above zero it is positive.
        stiffness: ``k`` [N/m or Nm/rad]; infinite for a coordinate that does not yield.
        rate: L of the observer [1/s], positive.

    Returns:
        [kg or kg m^2]; infinite where nothing yields.
    """
    if np.isinf(stiffness):
        return np.inf
    lost = mass * stiffness / (stiffness + damping * rate) if stiffness else 0.0
    return mass + damping / rate - lost


def bearable_mass_error(inertia: np.ndarray, A: np.ndarray, bearable: np.ndarray) -> float:
    """Return the relative error of all masses that a compliance bears.

    Args:
        inertia: Inertia of the links in joint coordinates, ``D_E``, shape (N, N).
        A: Matrix of the coordinates, ``y' = A q'``, shape (m, N).
        bearable: :func:`bearable_inertia_error` of each coordinate, shape (m,).

    Returns:
        Relative; infinite where nothing yields.
    """
    yielding = np.isfinite(bearable)
    if not yielding.any():
        return np.inf
    to_joints = np.linalg.pinv(A)[:, yielding] / np.sqrt(bearable[yielding])
    return float(1.0 / np.linalg.eigvalsh(to_joints.T @ inertia @ to_joints)[-1])
