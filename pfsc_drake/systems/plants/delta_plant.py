"""The analytic DELTA robot as a plant."""

import casadi as ca
import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    ContinuousState,
    EventStatus,
    LeafSystem,
)

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_robot import DeltaRobot

# m; a slide this far beyond its travel is at its end up to rounding
_ROUNDING = 1e-9


class DeltaPlant(LeafSystem):
    """The DELTA robot's dynamics (2.72) in continuous time, without friction and end stops.

    ::

        D(q) q'' + C(q, q') q' + g(q) = tau + J_D^T f_ext

    Integrate it by RK3 with error control or with a fixed step of 1 ms. Nothing holds a slide at
    the end of its travel, and singular configurations are close: a step that ends outside the
    travel fails, so that ``Simulator.AdvanceTo`` raises RuntimeError and names the slide. (The
    constrained plant of ``add_delta_plant`` has stops.)

    Ports:
        actuation (input): Drive forces ``tau`` [N], shape (3,).
        resistance (input): ``-tau_f`` of friction, adds to ``tau`` [N], shape (3,); zero if not
            connected.
        external_force (input): ``f_ext`` at the end-effector [N], axes of the inertial frame
            (z_0 down), shape (3,); zero if not connected.
        state (output): ``[q, v]``, slide positions [m] and velocities [m/s], shape (6,).
        tool_position (output): ``y_t`` [m], axes of the inertial frame, shape (3,).
        acceleration (output): ``q''`` [m/s^2], shape (3,).

    State:
        Continuous: ``[q, v]``, shape (6,); by default at rest in the middle of the travel.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: DeltaRobot) -> None:
        super().__init__()
        n = robot.dimension
        middle = np.mean(robot.gather("position_limits"), axis=1)
        default = BasicVector(np.concatenate([middle, np.zeros(n)]))
        self.DeclareContinuousState(default, n, n, 0)
        self._actuation = self.DeclareVectorInputPort("actuation", n)
        self._resistance = self.DeclareVectorInputPort("resistance", n)
        self._external_force = self.DeclareVectorInputPort("external_force", 3)
        self.DeclareVectorOutputPort(
            "state", 2 * n, self._calc_state, prerequisites_of_calc={self.xc_ticket()}
        )
        self.DeclareVectorOutputPort(
            "tool_position", 3, self._calc_tool_position, prerequisites_of_calc={self.q_ticket()}
        )
        inputs = (self._actuation, self._resistance, self._external_force)
        self.DeclareVectorOutputPort(
            "acceleration",
            n,
            self._calc_acceleration,
            prerequisites_of_calc={self.xc_ticket(), *(port.ticket() for port in inputs)},
        )
        self.DeclarePerStepPublishEvent(self._check_travel)
        self._robot = robot
        self._lower, self._upper = robot.gather("position_limits").T
        dynamics = BoundFunction(_dynamics_function(robot))
        self._x, self._tau, self._f_ext = dynamics.arguments.values()
        position = BoundFunction(_position_function(robot), x=self._x)
        self._rate, self._y_t = dynamics.results["rate"], position.results["y_t"]
        self._evaluate_dynamics, self._evaluate_position = dynamics.evaluate, position.evaluate

    def set_state(self, context: Context, q: np.ndarray, v: np.ndarray | None = None) -> None:
        """Set the state.

        Args:
            context: Context of this system.
            q: Slide positions [m], shape (3,).
            v: Slide velocities [m/s], shape (3,); at rest if omitted.
        """
        rate = np.zeros(self._robot.dimension) if v is None else v
        context.SetContinuousState(np.concatenate([q, rate]))

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Evaluate ``[v, q'']``."""
        derivatives.SetFromVector(self._calc_rate(context))

    def _calc_rate(self, context: Context) -> np.ndarray:
        self._x[:] = context.get_continuous_state_vector().CopyToVector()
        self._tau[:] = self._actuation.Eval(context)
        if self._resistance.HasValue(context):
            self._tau += self._resistance.Eval(context)
        connected = self._external_force.HasValue(context)
        self._f_ext[:] = self._external_force.Eval(context) if connected else 0.0
        self._evaluate_dynamics()
        return self._rate

    def _calc_acceleration(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._calc_rate(context)[self._robot.dimension :])

    def _check_travel(self, context: Context) -> EventStatus:
        q = context.get_continuous_state_vector().CopyToVector()[: self._robot.dimension]
        # written so that NaN is outside
        inside = (q >= self._lower - _ROUNDING) & (q <= self._upper + _ROUNDING)
        if not inside.all():
            i = int(np.argmin(inside))
            # EventStatus.Failed from Python crashes the process
            raise RuntimeError(
                f"slide {i + 1} left its travel at t = {context.get_time():.6g} s: "
                f"q = {q[i]:.6g} m; allowed are {self._lower[i]:.6g} m to {self._upper[i]:.6g} m"
            )
        return EventStatus.DidNothing()

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_continuous_state_vector().CopyToVector())

    def _calc_tool_position(self, context: Context, output: BasicVector) -> None:
        self._x[:] = context.get_continuous_state_vector().CopyToVector()
        self._evaluate_position()
        output.SetFromVector(self._y_t)


def _dynamics_function(robot: DeltaRobot) -> ca.Function:
    """Return ``(x, tau, f_ext) -> [v, q'']``."""
    x, tau, f_ext = ca.SX.sym("x", 6), ca.SX.sym("tau", 3), ca.SX.sym("f_ext", 3)
    q, v = ca.vertsplit(x, 3)
    rate = ca.vertcat(v, robot.acceleration(q, v, tau, f_ext))
    arguments, names = [x, tau, f_ext], ["x", "tau", "f_ext"]
    return ca.Function("delta_dynamics", arguments, ca.cse([ca.densify(rate)]), names, ["rate"])


def _position_function(robot: DeltaRobot) -> ca.Function:
    """Return ``x -> y_t``."""
    x = ca.SX.sym("x", 6)
    y_t, _ = robot.tool_pose([Jet([q_i]) for q_i in ca.vertsplit(x[:3])])
    results = ca.cse([ca.densify(y_t.coefficients[0])])
    return ca.Function("delta_position", [x], results, ["x"], ["y_t"])
