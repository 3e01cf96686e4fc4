"""Joint velocity servos: gains, control law, sampled servo, and the bus to the drives."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, is_finite, where
from pfsc_drake.checks import checked_vector
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, gravity_function, mass_function


@dataclass(frozen=True, eq=False)
class ServoGains:
    """Gains of N joint velocity controllers; arrays of shape (N,), see :class:`VelocityServoLaw`.

    Attributes:
        proportional: ``K_p`` [Nm s/rad].
        integral: ``K_i`` [Nm/rad].
        reference: ``K_w`` [Nm s/rad], weight of the reference in the proportional part.
        period: Sampling time T of the servo [s].

    Raises:
        InputError: If the shapes differ, or a gain or the period is out of range.
    """

    proportional: np.ndarray
    integral: np.ndarray
    reference: np.ndarray
    period: float

    def __post_init__(self) -> None:
        size = np.size(self.proportional)
        for name in ("proportional", "integral", "reference"):
            positive = name != "integral"
            object.__setattr__(
                self,
                name,
                checked_vector("servo", name, getattr(self, name), size, positive=positive),
            )
        if not 0.0 < self.period < np.inf:
            raise InputError(f"servo: period = {self.period!r} s; must be positive and finite")

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.proportional.size


def servo_gains(
    inertia: np.ndarray,
    bandwidth: float | np.ndarray,
    period: float,
    integral_rate: float | np.ndarray | None = None,
) -> ServoGains:
    """Return gains with the response ``v = v_ref / (s / omega + 1)`` of an inertia at the ticks.

    With ``J v_{k+1} = J v_k + T u_k`` the closed loop has its poles at
    ``a = exp(-omega T)`` and ``b = exp(-omega_I T)``, and the reference does not excite
    the second one, so that a step is followed without overshoot::

        K_p = J (2 - a - b) / T,  K_i = J (1 - a)(1 - b) / T^2,  K_w = J (1 - a) / T

    A load disturbance decays with the slower rate ``omega_I``. If the actual inertia is c
    times ``inertia``, the bandwidth is about ``omega / c``.

    Args:
        inertia: ``J`` [kg m^2], shape (N,), see :func:`joint_inertia`.
        bandwidth: ``omega`` [rad/s], of all joints or shape (N,).
        period: Sampling time T [s].
        integral_rate: ``omega_I`` [rad/s], likewise; by default a quarter of ``omega``, 0
            for no integral part.

    Raises:
        InputError: If an argument is out of range, or ``omega T`` is above 1, where the stability
            margin is small.
    """
    J = checked_vector("servo", "inertia", inertia, np.size(inertia), positive=True)
    if not 0.0 < period < np.inf:
        raise InputError(f"servo: period = {period!r} s; must be positive and finite")
    omega = checked_vector(
        "servo", "bandwidth", np.broadcast_to(bandwidth, J.shape), J.size, positive=True
    )
    rate = omega / 4.0 if integral_rate is None else np.broadcast_to(integral_rate, J.shape)
    omega_I = checked_vector("servo", "integral_rate", rate, J.size, positive=False)
    if np.max(omega) * period > 1.0:
        raise InputError(
            f"servo: bandwidth = {np.max(omega):g} rad/s; must be at most 1/period = "
            f"{1.0 / period:g} rad/s"
        )
    a, b = np.exp(-omega * period), np.exp(-omega_I * period)
    return ServoGains(
        J * (2.0 - a - b) / period,
        J * (1.0 - a) * (1.0 - b) / period**2,
        J * (1.0 - a) / period,
        period,
    )


def joint_inertia(robot: RobotModel, q_J: np.ndarray) -> np.ndarray:
    """Return the inertia at each drive with all other joints at rest: ``diag(D_E) + D_M``.

    Args:
        robot: The robot.
        q_J: Joint coordinates, shape (N,).

    Returns:
        Shape (N,) [kg m^2 or kg].
    """
    D_E = np.array(mass_function(robot)(q_J))
    return np.diag(D_E) + robot.D_M


class VelocityServoLaw:
    """PI velocity control of the joints with feed-forward, which closes (3.48).

    With the known load ``g`` - gravity at the present joint coordinates, and viscous damping -
    and the integral part ``x`` [Nm], at every tick::

        u     = g(q_J) + K_w v_ref - K_p v_M + x
        tau_d = sat(u)
        x    += K_i T (v_ref + K_w^-1 (tau_d - u) - v_M)

    The integral part follows the reference velocity that the torque limits can realize
    (Hanus' conditioning), so that it does not wind up while ``tau_d`` is limited.

    Args:
        gains: Gains, N joints.
        limits: Largest magnitudes of the drive torques [Nm], shape (N,).

    Raises:
        InputError: If the limits do not fit the gains or are not positive.
    """

    def __init__(self, gains: ServoGains, limits: np.ndarray) -> None:
        self.gains = gains
        # infinite: a drive without a limit
        limits = np.asarray(limits, dtype=float)
        if limits.shape != (gains.dimension,) or not np.all(limits > 0.0):
            raise InputError(
                f"servo: limits = {limits.tolist()}; must be {gains.dimension} positive torques"
            )
        self.limits = limits

    def torque(self, v: Any, v_ref: Any, load: Any, x: Any) -> tuple[Any, Any]:
        """Return the drive torque and the next integral part, each (N,) [Nm].

        Args:
            v: Velocity of the motors [rad/s], numbers or expressions, shape (N,).
            v_ref: Reference velocity [rad/s], shape (N,).
            load: ``g``, the known load [Nm], shape (N,).
            x: Integral part [Nm], shape (N,).
        """
        gains, limits = self.gains, ca.DM(self.limits)
        K_p, K_w = ca.DM(gains.proportional), ca.DM(gains.reference)
        u = load + K_w * v_ref - K_p * v + x
        tau_d = ca.fmin(ca.fmax(u, -limits), limits)
        realizable = v_ref + (tau_d - u) / K_w
        return tau_d, x + ca.DM(gains.integral * gains.period) * (realizable - v)


class SampledServo(Block):
    """Sampled :class:`VelocityServoLaw` with its state.

    The law uses the links' gravity torque and controls the motors' velocity. After a fault the
    state is constant.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        velocity_reference (input): ``q'_ref``, shape (N,).
        silence (input, optional): Time since the last reference arrived [s], shape (1,).
        stopping (input): Nonzero from a fault on, shape (1,); freezes the state.
        drive_torque (output): ``tau_d`` within its limits, shape (N,).
        input_fault (output): INPUT_NOT_FINITE or NONE, shape (1,).
        bus_fault (output): BUS_LOST if the bus has been silent for too long, or NONE, shape (1,).

    State:
        ``integral`` part ``x`` of the law, shape (N,), 0 at the start.

    Args:
        robot: Nominal model of the robot, N joints; its gravity torque and the viscous damping of
            its drives are fed forward.
        law: The law; its gains' period is the sampling time.
        longest_silence: Longest allowed time without a reference [s]; may be infinite.

    Raises:
        InputError: If the law is for another number of joints.
    """

    def __init__(self, robot: RobotModel, law: VelocityServoLaw, longest_silence: float) -> None:
        n = robot.dimension
        if law.gains.dimension != n:
            raise InputError(
                f"servo: gains for {law.gains.dimension} joints; the robot has {n} joints"
            )
        self._law, self._longest_silence = law, longest_silence
        self._gravity, self._viscous = gravity_function(robot), ca.DM(robot.viscous_damping)
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "velocity_reference": Port(n, "rad/s or m/s"),
            "silence": Port(1, "s", optional=True),
            "stopping": Port(1),
        }
        self.outputs = {
            "drive_torque": Port(n, "Nm or N"),
            "input_fault": Port(1),
            "bus_fault": Port(1),
        }
        self.inner, self.states = {"integral": n}, {"integral": n}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        q_J, _, _, v_M = ca.vertsplit(u.joint_state, x.integral.shape[0])
        load = self._gravity(q_J) + self._viscous * u.velocity_reference
        torque, integral = self._law.torque(v_M, u.velocity_reference, load, x.integral)
        finite = all_finite(u.joint_state, u.velocity_reference)
        lost = ca.DM(0) if u.silence is None else u.silence > self._longest_silence
        return {
            "drive_torque": torque,
            "input_fault": where(finite, Fault.NONE, Fault.INPUT_NOT_FINITE),
            "bus_fault": where(lost, Fault.BUS_LOST, Fault.NONE),
            "integral": integral,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"integral": where(u.stopping, x.integral, y.integral)}


MAX_PERIODS = 10_000  # in a delay, whose samples are all shifted at every tick
# tolerance of the number of periods in a delay
_ROUNDING = 1e-6


class BusDelay(Block):
    """Samples a vector and delays each sample by a whole number of periods.

    ``delivered(t) = sent((j - k) T)`` for ``j T <= t < (j + 1) T``, ``k = delay / T``: exact at the
    ticks and between them. Before ``t = k T`` the output is the initial input, not zero, so that
    there is no step.

    Frames that are sent while the bus is interrupted do not arrive: the output keeps its last
    value, and the silence grows.

    Ports:
        sent (input): Any vector, shape (size,).
        delivered (output): Delayed vector, shape (size,); no direct feedthrough.
        silence (output): Time since the last arrival, beyond the period [s], shape (1,).

    State:
        The last k + 1 ``samples``, newest first, shape ((k + 1) size,), a lost one replaced by its
        predecessor; the age of each in periods beyond its delay (``ages``); the last ``tick``,
        infinite before the first, whose input replaces all previous ones.

    Args:
        size: Size of the vector.
        delay: Delay [s], a whole number k of periods, 1 to MAX_PERIODS.
        period: Sampling time T of the bus [s].
        lost: Begin and end of an interruption of the bus [s]; none if it ends before it begins.

    Raises:
        InputError: If the delay is not a positive multiple of the period.
    """

    expands = False  # long vectors are shifted

    def __init__(
        self, size: int, delay: float, period: float, lost: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self.num_samples = _whole_periods(delay, period)
        self._size, self._period, self._lost = size, period, lost
        count = self.num_samples + 1
        self.inputs = {"sent": Port(size)}
        self.outputs = {"delivered": Port(size), "silence": Port(1, "s")}
        self.states = {"samples": size * count, "ages": count, "tick": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"samples": self._everywhere(u), "tick": np.inf}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n, moves = self._size, t > x.tick + 0.5  # the input of this tick is not yet among them
        oldest, before = x.samples[-n:], x.samples[-2 * n : -n]
        age = where(moves, x.ages[-2], x.ages[-1])
        return {"delivered": where(moves, before, oldest), "silence": self._period * age}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        time, (begin, end) = t * self._period, self._lost
        lost, has_started = all_of(time >= begin, time < end), is_finite(x.tick)
        newest = where(lost, x.samples[: self._size], u.sent)
        samples = ca.vertcat(newest, x.samples[: -self._size])
        ages = ca.vertcat(where(lost, x.ages[0] + 1.0, 0.0), x.ages[:-1])
        return {
            "samples": where(has_started, samples, self._everywhere(u)),
            "ages": where(has_started, ages, x.ages),
            "tick": t,
        }

    def _everywhere(self, u: Values) -> Any:
        return ca.repmat(u.sent, self.num_samples + 1, 1)


def _whole_periods(delay: float, period: float) -> int:
    if not 0.0 < period < np.inf:
        raise InputError(f"bus: period = {period!r} s; must be positive and finite")
    ratio = delay / period
    if not 0.5 < ratio < MAX_PERIODS + 0.5 or abs(ratio - round(ratio)) > _ROUNDING:
        raise InputError(
            f"bus: delay = {delay!r} s; must be a positive multiple of the period {period!r} s, "
            f"up to {MAX_PERIODS * period:g} s"
        )
    return round(ratio)
