"""Errors of estimated link positions from the uncertainty of the data."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.wiring_blocks import Sum
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.estimation.link_deviation import LinkErrors, StateUncertainty
from pfsc_drake.control.estimation.momentum import MomentumObserver, motor_momentum
from pfsc_drake.control.estimation.robot_state import LinkState
from pfsc_drake.robot.robot_model import RobotModel, gravity_function, largest_speeds

# ticks after which an observer at rest has settled
_SETTLING = 3


@dataclass(frozen=True)
class MotorEncoders:
    """Encoder model of the motors: errors of positions and velocities.

    Attributes:
        step: Smallest step of a position, shape (N,) [rad or m]; 0 if there is none.
        difference_quotient: Whether velocities are difference quotients of positions.
        filter_time: Time constant of a filter of the difference quotients [s].
    """

    step: np.ndarray
    difference_quotient: bool = False
    filter_time: float = 0.0

    def rate(self, off: ca.MX, before: ca.MX, last: ca.MX, period: float) -> ca.MX:
        """Return the error of a velocity, shape (N,).

        Args:
            off: Error of the position, shape (N,).
            before: Error of the position one tick earlier.
            last: Error of the velocity one tick earlier.
            period: Sampling time [s].
        """
        if not self.difference_quotient:
            return ca.MX(off.numel(), 1)
        follow = 1.0 - float(np.exp(-period / self.filter_time)) if self.filter_time else 1.0
        return last + follow * ((off - before) / period - last)


def errors_of_measured_torques(
    robot: RobotModel,
    uncertainty: StateUncertainty,
    encoders: MotorEncoders,
    q_J: np.ndarray,
    bandwidth: float,
    period: float,
) -> LinkErrors:
    """Return the errors of link positions that are estimated from torque sensors.

    Args:
        robot: Nominal model of the robot, N joints.
        uncertainty: Uncertainty of the data.
        encoders: Encoders of its motors.
        q_J: Posture at rest, shape (N,).
        bandwidth: Bandwidth of the links' motion, see :class:`LinkState` [rad/s].
        period: Sampling time [s].
    """
    nothing = np.zeros(robot.dimension)
    sigma = uncertainty.torque_noise * _finite(robot.gather("effort_limit"))
    finder = Network.of(LinkState(robot, bandwidth, period))
    noise = _noise(robot, finder, encoders, np.where(robot.elastic_joints, sigma, 0.0), q_J, period)
    share = float(np.hypot(uncertainty.stiffness, uncertainty.torque_scale))
    return LinkErrors(noise, share, 0.0, nothing, nothing, nothing)


def errors_of_observed_torques(
    robot: RobotModel,
    uncertainty: StateUncertainty,
    encoders: MotorEncoders,
    q_J: np.ndarray,
    bandwidth: float,
    period: float,
    friction: tuple[np.ndarray, np.ndarray] | None,
) -> LinkErrors:
    """Return the errors of link positions that are estimated from the motors alone.

    Args:
        robot: Nominal model of the robot, N joints.
        uncertainty: Uncertainty of the data.
        encoders: Encoders of its motors.
        q_J: Posture at rest, shape (N,).
        bandwidth: Bandwidth of the links' motion and of the torques [rad/s].
        period: Sampling time [s].
        friction: Nominal coefficients f_c and f_v, each (N,); None if there are none.
    """
    if friction is None:
        effort = _finite(robot.gather("effort_limit"))
        coulomb = stuck = uncertainty.coulomb * effort
        viscous = uncertainty.viscous * effort / largest_speeds(robot)
    else:
        (stuck, f_v), share = friction, uncertainty.friction
        coulomb, viscous = share * stuck, share * f_v
    finder = observing_network(robot, bandwidth, period)
    noise = _noise(robot, finder, encoders, np.zeros(robot.dimension), q_J, period)
    # delay of an observed ramp: the interval's middle, and a filter of first order
    follow = 1.0 - np.exp(-bandwidth * period)
    lag = float(period * (1.0 / follow - 0.5))
    return LinkErrors(noise, uncertainty.stiffness, lag, coulomb, np.asarray(stuck), viscous)


def observing_network(robot: RobotModel, bandwidth: float, period: float) -> Network:
    """Return the observer of the links' side with inputs ``joint_state`` and ``drive_torque``.

    Args:
        robot: Nominal model of the robot, without friction.
        bandwidth: Bandwidth of the links' motion and of the torques [rad/s].
        period: Sampling time [s].

    Returns:
        A network; its third input ``known_torque`` is the initial torque of the springs, its output
        ``joint_state``.
    """
    nothing = np.zeros(robot.dimension)
    model = motor_momentum(robot, (nothing, nothing))
    wiring = Wiring()
    wiring.networks = {
        "observer": Network.of(MomentumObserver(model, bandwidth, period)),
        "total": Network.of(Sum(2, robot.dimension)),
        "links": Network.of(LinkState(robot, bandwidth, period)),
    }
    wiring.connections = {
        ("observer", "joint_state"): "joint_state",
        ("observer", "drive_torque"): "drive_torque",
        ("observer", "known_torque"): "known_torque",
        ("total", "term_0"): "known_torque",
        ("total", "term_1"): ("observer", "estimate"),
        ("links", "joint_state"): "joint_state",
        ("links", "joint_torque"): ("total", "sum"),
    }
    wiring.outputs = {"joint_state": ("links", "joint_state")}
    return wiring.network()


@once_per_content()
def _noise(
    robot: RobotModel,
    finder: Network,
    encoders: MotorEncoders,
    torque_noise: np.ndarray,
    q_J: np.ndarray,
    period: float,
) -> np.ndarray:
    """Return the noise of estimated positions and velocities of links, shape (2, N).

    Near a posture at rest, the observer is linear in the measurements:
    ``x_{k+1} = A x_k + B w_k``, ``y_k = C x_k + D w_k``. White noise w of covariance Q leads to the
    covariance ``P = A P A^T + B Q B^T`` of x and ``C P C^T + D Q D^T`` of y. The quantization of
    encoders is noise that is uniformly distributed within a step.

    Args:
        robot: Nominal model of the robot, N joints.
        finder: Observer of the links, with inputs ``joint_state`` and torques.
        encoders: Encoders of its motors.
        torque_noise: Standard deviation of the noise of torques, shape (N,).
        q_J: The posture, shape (N,).
        period: Sampling time [s].
    """
    n = robot.dimension
    deviation = np.concatenate([encoders.step / np.sqrt(12.0), torque_noise])
    if not deviation.any():
        return np.zeros((2, n))
    weight = gravity_function(robot)(q_J).full().ravel()
    bend = np.where(robot.elastic_joints, weight / robot.K_s, 0.0)
    rest = np.concatenate([q_J, np.zeros(n), q_J + bend, np.zeros(n)])
    torques = [name for name in finder.inputs if name != "joint_state"]
    program = Program.of(finder)
    step, nominal = program.step(), {"joint_state": rest} | dict.fromkeys(torques, weight)
    begin = {name: value for name, value in nominal.items() if name in program.initial_inputs}
    state = program.initial(
        x=np.zeros(program.size), preset=np.zeros(len(program.states)), t=0, **begin
    )["x_start"]
    for k in range(_SETTLING):
        state = step(x=state, t=k, **nominal)["x_next"]

    x, w = ca.MX.sym("x", program.size + 2 * n), ca.MX.sym("w", 2 * n)
    inner, before, last = ca.vertsplit(x, [0, program.size, program.size + n, x.numel()])
    off, noise = ca.vertsplit(w, n)
    rate = encoders.rate(off, before, last, period)
    measured = rest + ca.vertcat(ca.DM(2 * n, 1), off, rate)
    # noise of torque sensors; commanded torques are known exactly
    torque_inputs = {name: weight + (noise if name == "joint_torque" else 0.0) for name in torques}
    later = step(x=inner, t=0, joint_state=measured, **torque_inputs)
    found = ca.vertsplit(later["joint_state"], n)
    after, y = ca.vertcat(later["x_next"], off, rate), ca.vertcat(*found[:2])
    slopes = [ca.jacobian(of, by) for of in (after, y) for by in (x, w)]
    at = ca.vertcat(state, ca.DM(2 * n, 1)), ca.DM(2 * n, 1)
    A, B, C, D = (m.full() for m in ca.Function("slopes", [x, w], slopes).call(at))
    Q = np.diag(deviation**2)
    covariance = C @ solve_discrete_lyapunov(A, B @ Q @ B.T) @ C.T + D @ Q @ D.T
    return np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(2, n)


def _finite(effort: np.ndarray) -> np.ndarray:
    """Return largest torques, 0 for unlimited ones."""
    return np.where(np.isfinite(effort), effort, 0.0)
