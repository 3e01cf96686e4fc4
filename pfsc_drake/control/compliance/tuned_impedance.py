"""Stiffness and damping that change during physical interaction, without adding energy."""

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

# request of the default value of a parameter
AS_GIVEN = -1.0
KINDS = tuple(Kind)
# stiffness and damping of each kind
REQUESTS = 2 * len(KINDS)


def requests_of(kind: Kind) -> tuple[int, int]:
    """Return the indices of stiffness and damping of a kind in the requests."""
    first = 2 * KINDS.index(kind)
    return first, first + 1


@dataclass
class TuningParameters(Parameters):
    """Dynamics of parameters after a request.

    Attributes:
        ramp: Time constant of the approach to the requested value [s].
        reserve: Energy available to stiffening springs before any dissipation [J].
        capacity: Capacity of the energy tank that dampers fill [J].
        returning_stiffness: Stiffness of the return of coordinates that become rigid, of lengths
            [N/m].
        returning_turn_stiffness: Stiffness of the return, of angles [Nm/rad].
        caught_within: Distance from the reference within which a coordinate becomes rigid [m, rad].
        caught_below: Speed relative to the reference below which it becomes rigid [m/s, rad/s].
    """

    ramp: NotNegative = 0.1
    reserve: NotNegative = 0.05
    capacity: Positive = 0.5
    returning_stiffness: Positive = 2e4
    returning_turn_stiffness: Positive = 200.0
    caught_within: Positive = 1e-4
    caught_below: Positive = 5e-3


class ImpedanceTuner(Block):
    """Changes mass, damping and stiffness to requested values.

    The motion itself never jumps (:class:`ImpedanceLaw`), but a spring whose stiffness grows by dk
    at the deflection e generates the energy ``dk e^2 / 2`` and supplies it to the operator: 62 mJ
    for 5 kN/m at 5 mm, repeatedly if the spring alternates. So every increase is paid from an
    energy tank

        ``x+ = min(x_max, x + T sum d_i s_i) - sum max(dk_i, 0) e_i^2 / 2``

    with ``x >= 0``. ``s_i = min(e_i'^2, last e_i'^2)``, and zero where ``e_i'`` changed its sign,
    is a lower bound of the dissipation in a tick in which ``e_i'`` is monotone. An increase beyond
    the content of the tank is not applied; on the manifold, e = 0, any increase is free. Then for
    every motion of the operator

        ``integral of tau e' dt >= (m e'^2 + k e^2) / 2 - (the same at the start) - x_0``.

    Damping may change at any time, and stiffness may decrease. Both approach the requested value
    with a time constant. If the requested stiffness is infinite, a critically damped spring returns
    the coordinate to its reference, where it becomes rigid within ``caught_within``. A rigid
    coordinate, with e = 0, becomes compliant immediately.

    Parameters that vary over the manifold are used unchanged, without the energy tank, unless a
    value is requested: the user is responsible for them.

    The impedance depends on state and inputs without delay, so that the energy is computed at the
    deflection at which a spring stiffens. The filter's reference does not depend on it, and there
    is no algebraic loop. A motion with NaN or infinite values changes nothing.

    Ports:
        request (input): Stiffness and damping, tangential, transversal and rotational, shape (6,);
            negative entries select the default.
        manifold_state (input): Derivatives of yhat by rows, for parameters that depend on it.
        reference (input): Derivatives of y_p by rows, from :class:`ImpedanceFilter`.
        desired_reference (input): Derivatives of y_d by rows.
        impedance (output): Rows mass, damping, stiffness, shape (3 m,), from this tick on.
        tank (output): Energy available to stiffening springs [J], shape (1,).

    State:
        Impedance by rows, rates ``e'`` of the last tick, and tank.

    Args:
        parameters: Dynamics of the parameters.
        law: Law of the filter, with the default impedance.
        coordinates: The m coordinates of the virtual output.
        masses: Masses of coordinates that are rigid by default, for the time that they are
            compliant, (m,).
    """

    def __init__(
        self,
        parameters: TuningParameters,
        law: ImpedanceLaw,
        coordinates: Sequence[Coordinate],
        masses: np.ndarray,
    ) -> None:
        self._parameters, self._law, self._masses = parameters, law, ca.DM(masses)
        self._return_stiffness = ca.DM(_return_stiffness(parameters, coordinates))
        columns = zip(*(requests_of(coordinate.kind) for coordinate in coordinates), strict=True)
        self._stiffnesses, self._dampings = (list(column) for column in columns)
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
        """Return the initial states; omitted ones are zero."""
        return {"impedance": self._default_impedance(u), "tank": ca.DM(self._parameters.reserve)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        m = self._law.num_outputs
        error = u.reference[: 2 * m] - u.desired_reference[: 2 * m]
        known, (e, rate) = all_finite(error), ca.vertsplit(error, m)
        impedance, left = self._next_impedance(x, self._default_impedance(u), u.request, e, rate)
        return {
            "impedance": where(known, impedance, x.impedance),
            "tank": x.tank,
            "rate": where(known, rate, x.rate),
            "left": where(known, left, x.tank),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"impedance": y.impedance, "rate": y.rate, "tank": y.left}

    def _default_impedance(self, u: Values) -> Any:
        """Return the impedance without requests, shape (3 m,)."""
        return self._law.impedance(u.manifold_state[: self._law.num_outputs])

    def _next_impedance(
        self, x: Values, default: Any, request: Any, e: Any, rate: Any
    ) -> tuple[Any, Any]:
        """Return the next impedance, shape (3 m,), and the remaining energy of the tank.

        Args:
            x: States.
            default: The impedance without requests, shape (3 m,).
            request: Requested stiffnesses and dampings, as at the port ``impedance_request``.
            e: ``y_p - y_d``, shape (m,).
            rate: ``e'``, shape (m,).
        """
        parameters, T = self._parameters, self._law.period
        _, last_damping, last_stiffness = ca.vertsplit(x.impedance, e.numel())
        default_mass, default_damping, default_stiffness = ca.vertsplit(default, e.numel())
        request_stiffness, request_damping = request[self._stiffnesses], request[self._dampings]
        requested_stiffness = where(request_stiffness < 0.0, default_stiffness, request_stiffness)
        requested_damping = where(request_damping < 0.0, default_damping, request_damping)
        mass = where(default_stiffness < ca.inf, default_mass, self._masses)

        was_soft, shall_be_soft = last_stiffness < ca.inf, requested_stiffness < ca.inf
        share = -math.expm1(-T / parameters.ramp) if parameters.ramp > 0.0 else 1.0
        goes_on = rate * x.rate > 0.0
        spent = where(goes_on, last_damping * ca.fmin(rate**2, x.rate**2), 0.0)
        filled = x.tank + T * ca.sum1(where(was_soft, spent, 0.0))
        tank = ca.fmin(filled, parameters.capacity)

        aim = where(shall_be_soft, requested_stiffness, self._return_stiffness)
        change = where(was_soft, share * (aim - last_stiffness), 0.0)
        cost = ca.sum1(ca.fmax(change, 0.0) * e**2) / 2.0
        paid = where(cost > tank, tank / cost, 1.0)
        granted = last_stiffness + where(change > 0.0, paid * change, change)
        # a rigid coordinate is not deflected
        stiffness = where(was_soft, granted, requested_stiffness)
        near = ca.fabs(e) < parameters.caught_within
        near = ca.logic_and(near, ca.fabs(rate) < parameters.caught_below)
        stiffness = where(ca.logic_and(ca.logic_not(shall_be_soft), near), ca.inf, stiffness)

        returns = ca.logic_and(ca.logic_not(shall_be_soft), stiffness < ca.inf)
        critical = 2.0 * ca.sqrt(where(returns, stiffness, 0.0) * mass)
        approached = last_damping + share * (requested_damping - last_damping)
        damping = where(was_soft, approached, requested_damping)
        damping = where(returns, ca.fmax(damping, critical), damping)
        if not self._law.is_constant:
            stiffness = where(request_stiffness < 0.0, default_stiffness, stiffness)
            damping = where(request_damping < 0.0, default_damping, damping)
        return ca.vertcat(mass, damping, stiffness), ca.fmax(tank - paid * cost, 0.0)


def _return_stiffness(
    parameters: TuningParameters, coordinates: Sequence[Coordinate]
) -> np.ndarray:
    """Return the stiffness of the return of each coordinate, shape (m,)."""
    lengths, turns = parameters.returning_stiffness, parameters.returning_turn_stiffness
    return np.array([turns if c.kind is Kind.ROTATIONAL else lengths for c in coordinates])


def load_inertia(
    robot: RobotModel, load: ToolLoad, q: np.ndarray, added: float = 0.0
) -> np.ndarray:
    """Return the inertia of a load in joint coordinates, ``M_L(q)``, shape (N, N).

    Args:
        robot: The robot.
        load: Load behind the sensor.
        q: Joint coordinates, shape (N,).
        added: Additional mass at the tool point [kg].
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


def load_inertia_ratio(inertia: np.ndarray, A: np.ndarray, masses: np.ndarray) -> tuple[float, int]:
    """Return the largest ratio ``M_L / m`` of any direction, and its main coordinate.

    Args:
        inertia: ``M_L`` in joint coordinates, shape (N, N), see :func:`load_inertia`.
        A: Matrix of the coordinates, ``y' = A q'``, shape (m, N).
        masses: Masses of the impedance [kg or kg m^2], shape (m,), infinite for rigid coordinates.

    Returns:
        Ratio and index; zero if all coordinates are rigid.
    """
    yielding = np.flatnonzero(np.isfinite(masses))
    if not yielding.size:
        return 0.0, 0
    to_joints = np.linalg.pinv(A)[:, yielding] / np.sqrt(masses[yielding])
    values, vectors = np.linalg.eigh(to_joints.T @ inertia @ to_joints)
    return float(values[-1]), int(yielding[np.argmax(np.abs(vectors[:, -1]))])


def tolerable_inertia_ratio(delay: float, bandwidth: float = np.inf) -> float:
    """Return the inertia ratio ``M_L / m`` at which the force loop becomes unstable.

    Args:
        delay: ``T_d`` of the loop, positive [s].
        bandwidth: ``omega`` of velocity servos [rad/s].
    """
    if np.isinf(bandwidth):
        return 1.0
    turned = brentq(lambda w: w * delay + np.arctan(w / bandwidth) - np.pi, 0.0, np.pi / delay)
    return float(np.hypot(1.0, turned / bandwidth))


def tolerable_inertia_error(mass: float, damping: float, stiffness: float, rate: float) -> float:
    """Return the largest excess of the nominal inertia for which the compliance is stable.

    ``dM < m + d / L - m k / (k + d L)``; at this limit the tool oscillates at
    ``sqrt((k + d L) / m)``.

    Args:
        mass: ``m`` [kg or kg m^2], positive.
        damping: ``d`` [N s/m or Nm s/rad]; with ``k`` above zero it is positive.
        stiffness: ``k`` [N/m or Nm/rad]; infinite for a rigid coordinate.
        rate: L of the observer [1/s], positive.

    Returns:
        [kg or kg m^2]; infinite for a rigid coordinate.
    """
    if np.isinf(stiffness):
        return np.inf
    lost = mass * stiffness / (stiffness + damping * rate) if stiffness else 0.0
    return mass + damping / rate - lost


def tolerable_mass_error(inertia: np.ndarray, A: np.ndarray, tolerable: np.ndarray) -> float:
    """Return the largest relative error of all masses for which a compliance is stable.

    Args:
        inertia: Inertia of the links in joint coordinates, ``D_E``, shape (N, N).
        A: Matrix of the coordinates, ``y' = A q'``, shape (m, N).
        tolerable: :func:`tolerable_inertia_error` of each coordinate, shape (m,).

    Returns:
        Relative; infinite if all coordinates are rigid.
    """
    yielding = np.isfinite(tolerable)
    if not yielding.any():
        return np.inf
    to_joints = np.linalg.pinv(A)[:, yielding] / np.sqrt(tolerable[yielding])
    return float(1.0 / np.linalg.eigvalsh(to_joints.T @ inertia @ to_joints)[-1])
