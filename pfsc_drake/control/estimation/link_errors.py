"""What is wrong with where links are found, from how well is known by what they are found."""

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

# ticks after which an observer at rest knows what acted before
_BEGUN = 3


@dataclass(frozen=True)
class MotorEncoders:
    """What encoders of motors do to positions and velocities.

    Attributes:
        step: Smallest step of a position, shape (N,) [rad or m]; 0 if there is none.
        difference_quotient: Whether velocities are difference quotients of positions.
        filter_time: Time constant of a filter behind them [s].
    """

    step: np.ndarray
    difference_quotient: bool = False
    filter_time: float = 0.0

    def rate(self, off: ca.MX, before: ca.MX, last: ca.MX, period: float) -> ca.MX:
        """Return by how much a velocity is off, shape (N,).

        Args:
            off: By how much the position is off, shape (N,).
            before: The same a tick before.
            last: By how much the velocity was off then.
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
    """Return the errors of links that are found by torque sensors.

    Args:
        robot: The robot as it is believed, N joints.
        uncertainty: How well is known by what.
        encoders: Encoders of its motors.
        q_J: Where it is near when it rests, shape (N,).
        bandwidth: Of the links' motion, see :class:`LinkState` [rad/s].
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
    """Return the errors of links that are found by the motors alone.

    Args:
        robot: The robot as it is believed, N joints.
        uncertainty: How well is known by what.
        encoders: Encoders of its motors.
        q_J: Where it is near when it rests, shape (N,).
        bandwidth: Of the links' motion and of the torques [rad/s].
        period: Sampling time [s].
        friction: Coefficients f_c and f_v that are believed, each (N,), if there are any.
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
    # a ramp is observed that much later: the interval's middle, and a filter of first order
    follow = 1.0 - np.exp(-bandwidth * period)
    lag = float(period * (1.0 / follow - 0.5))
    return LinkErrors(noise, uncertainty.stiffness, lag, coulomb, np.asarray(stuck), viscous)


def observing_network(robot: RobotModel, bandwidth: float, period: float) -> Network:
    """Return what finds the links' side by the motors, of ``joint_state``, ``drive_torque``.

    Args:
        robot: The robot as it is believed, without friction.
        bandwidth: Of the links' motion and of the torques [rad/s].
        period: Sampling time [s].

    Returns:
        Its third input ``known_torque`` is what springs bear at the start; output ``joint_state``.
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
    """Return what white noise leaves of positions and velocities of links, shape (2, N).

    Near a posture at rest, what finds the links is linear in what is measured:
    ``x_{k+1} = A x_k + B w_k``, ``y_k = C x_k + D w_k``, so that of noise w of covariance Q
    ``P = A P A^T + B Q B^T`` is left in x, and ``C P C^T + D Q D^T`` in y. Steps of encoders
    are noise that is even within a step.

    Args:
        robot: The robot as it is believed, N joints.
        finder: What finds the links, of ``joint_state`` and torques.
        encoders: Encoders of its motors.
        torque_noise: Standard deviation of noise of torques, shape (N,).
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
    for k in range(_BEGUN):
        state = step(x=state, t=k, **nominal)["x_next"]

    x, w = ca.MX.sym("x", program.size + 2 * n), ca.MX.sym("w", 2 * n)
    inner, before, last = ca.vertsplit(x, [0, program.size, program.size + n, x.numel()])
    off, noise = ca.vertsplit(w, n)
    rate = encoders.rate(off, before, last, period)
    measured = rest + ca.vertcat(ca.DM(2 * n, 1), off, rate)
    # noise of a sensor's torque; what the drives were told is known exactly
    told = {name: weight + (noise if name == "joint_torque" else 0.0) for name in torques}
    later = step(x=inner, t=0, joint_state=measured, **told)
    found = ca.vertsplit(later["joint_state"], n)
    after, y = ca.vertcat(later["x_next"], off, rate), ca.vertcat(*found[:2])
    slopes = [ca.jacobian(of, by) for of in (after, y) for by in (x, w)]
    at = ca.vertcat(state, ca.DM(2 * n, 1)), ca.DM(2 * n, 1)
    A, B, C, D = (m.full() for m in ca.Function("slopes", [x, w], slopes).call(at))
    Q = np.diag(deviation**2)
    covariance = C @ solve_discrete_lyapunov(A, B @ Q @ B.T) @ C.T + D @ Q @ D.T
    return np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(2, n)


def _finite(effort: np.ndarray) -> np.ndarray:
    """Return largest torques, 0 where none is known."""
    return np.where(np.isfinite(effort), effort, 0.0)
