"""What drives do after a fault: stop, and hold the robot where it has come to rest."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

# s, of the shortest stop
_SHORTEST = 0.05
# of smoothstep: its largest slope over its mean
_PEAK = 1.5
# share of the torque limit that braking is granted however much gravity takes
_LEAST_SHARE = 0.1
# largest part of a velocity that sampled damping may take off in one period
_LARGEST_STEP = 0.3
# 1/s, by which an integrated motor position is drawn to what the link side says
_CORRECTION = 10.0
# weight of the newest difference quotient of a position
_NEWEST = 0.6
# of the damping where the velocity is differentiated, which takes its time
_DIFFERENTIATED = 0.5
# of the gains where only the link side of an elastic joint is seen
_FAR_SIDE = 0.5
# damping ratio by which a motor that is not seen is thought to follow its link
_FOLLOWING = 0.3

_Q_J, _V_J, _Q_M, _V_M = range(4)


@dataclass(frozen=True)
class SafeState:
    """How a robot is stopped and held, see :class:`SafeStop`.

    Attributes:
        damping: Damping of every drive at least [Nm s/rad], shape (N,).
        bandwidth: ``omega`` of the position hold [rad/s].
        effort_share: Part of the drives' limits that braking is planned with, up to 1.
    """

    damping: np.ndarray
    bandwidth: float = 60.0
    effort_share: float = 0.7

    def check(self, num_joints: int) -> None:
        """Refuse what is out of range.

        Args:
            num_joints: N.

        Raises:
            InputError: If something is.
        """
        damping = np.asarray(self.damping)
        if damping.shape != (num_joints,) or not np.all((damping >= 0.0) & np.isfinite(damping)):
            raise InputError(
                f"safe state damping: {self.damping}; must be {num_joints} finite numbers, "
                "none negative"
            )
        if not 0.0 < self.bandwidth < np.inf:
            raise InputError(f"safe state bandwidth: {self.bandwidth}; must be positive and finite")
        if not 0.0 < self.effort_share <= 1.0:
            raise InputError(
                f"safe state effort share: {self.effort_share}; must be above 0, at most 1"
            )


class SafeStop:
    """Stops a robot along a trajectory of its joints, and holds it at the trajectory's end.

    From the state at the fault all joints slow down in proportion, ``q_J,r' = v_0 s'(t)`` with
    ``s'`` from 1 to 0 in the time T that the drives need for the momentum ``p = (D_E + D_M) v_0``
    beside the weight. The drives get::

        tau_d = tau_J + D_M a_r + d v_r + K_p (q_M,r - q_M) + K_v (v_M,r - v_M)
        tau_J = D_E a_r + n_E,   q_M,r = q_J,r + tau_J / K_s + (its error at the fault) s'

    with everything believed, ``K_p = D omega^2``, ``K_v = 2 D omega`` of the joint's whole
    inertia D, within what sampling bears and up to ``sqrt(K_s (D - D_M))``, where the
    springs' swinging dies out fastest. At rest that is (constant) gravity compensation and a
    PD law on the motors, which is stable for rigid and elastic joints alike; the torque is
    continuous where the motion ends.

    Each joint is held by what is still measured of it. Where the motor's position is lost, its
    velocity is integrated and drawn to what the link's position says; where its velocity is, the
    position is differentiated; of a rigid joint either side does. Of an elastic joint
    of which only the link is seen the motor is simulated, on its spring and with some damping,
    and half the gains act on that. A joint of which nothing is seen gets
    ``tau_J`` alone: its weight is borne, but only a brake holds it. A value that is not finite
    is used again when it is back; one that was found implausible is not.

    The memory is a flat array of ``size`` that belongs to the caller.

    Args:
        robot: The robot as it is believed, N joints.
        limits: Magnitude limits of the drives, shape (N,) [Nm or N].
        settings: How to stop and hold.
        period: Sampling time [s].

    Attributes:
        size: Length of the memory.

    Raises:
        InputError: If the settings are out of range.
    """

    def __init__(
        self, robot: RobotModel, limits: np.ndarray, settings: SafeState, period: float
    ) -> None:
        settings.check(robot.dimension)
        n = self._n = robot.dimension
        self._limits, self._settings, self._period = np.asarray(limits), settings, period
        self._D_M, self._viscous = robot.D_M, robot.viscous_damping
        self._elastic = np.isfinite(robot.K_s)
        self._compliance = np.where(self._elastic, 1.0 / robot.K_s, 0.0)
        self._stiffness = np.where(self._elastic, robot.K_s, 0.0)
        self._mass_matrix = BoundFunction(_mass_matrix_function(robot))
        self._torque = BoundFunction(_torque_function(robot))
        widths = [1, 1, n, n, n, n, n, n, n, 4 * n, 4 * n]
        ends = np.cumsum(widths).tolist()
        parts = [slice(end - width, end) for width, end in zip(widths, ends, strict=True)]
        self._elapsed, self._duration, self._q_0, self._v_0, *parts = parts
        self._offset, self._offset_rate, self._inertia, self._position, self._rate, *parts = parts
        self._suspect, self._last = parts
        self.size: int = ends[-1]

    def start(self, last: np.ndarray, state: np.ndarray, suspect: np.ndarray) -> np.ndarray:
        """Return the memory at the instant of a fault.

        Args:
            last: State one period before, ``[q_J, v_J, q_M, v_M]``, shape (4N,), as far as known.
            state: Measured now, shape (4N,).
            suspect: Which of it is implausible, nonzero if so, shape (4N,).
        """
        memory = np.zeros(self.size)
        q_J, v_J, q_M, v_M = self._state_at_fault(last, state, suspect != 0.0)
        D = self._total_inertia(q_J)
        momentum = D @ v_J
        tau_J = self._inverse_dynamics(q_J, np.zeros(self._n), np.zeros(self._n))
        memory[self._duration] = self._stopping_time(momentum, tau_J)
        memory[self._q_0], memory[self._v_0] = q_J, v_J
        memory[self._inertia] = np.diag(D)
        memory[self._position], memory[self._rate] = q_M, v_M
        memory[self._suspect], memory[self._last] = suspect, state
        reference, rate, _ = self._reference(memory)
        memory[self._offset], memory[self._offset_rate] = q_M - reference, v_M - rate
        return memory

    def drive(self, memory: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the drive torques within their limits, shape (N,) [Nm or N].

        Args:
            memory: See :meth:`start`.
            state: Measured now, shape (4N,).
        """
        q_r, v_r, forward = self._reference(memory)
        q_M, v_M, share, braking = self._motors(memory, state)
        K_p, K_v = self._gains(memory[self._inertia])
        torque = forward + share * K_p * (q_r - q_M) + braking * K_v * (v_r - v_M)
        return np.asarray(np.clip(torque, -self._limits, self._limits))

    def advance(self, memory: np.ndarray, state: np.ndarray, suspect: np.ndarray) -> np.ndarray:
        """Return the memory one period later.

        Args:
            memory: See :meth:`start`.
            state: Measured now, shape (4N,).
            suspect: What of it is implausible, nonzero if so, shape (4N,).
        """
        after = memory.copy()
        good = self._good(memory, state).reshape(4, -1)
        q = state.reshape(4, -1)
        q_M, v_M, *_ = self._motors(memory, state)
        # of the link's position, with the spring's deflection as it is planned
        reference, *_ = self._reference(memory)
        deflection = reference - self._link_reference(memory)[0]
        away = np.where(good[_Q_J], q[_Q_J] + deflection - q_M, 0.0)
        drawn = np.where(good[_Q_M], 0.0, self._period * _CORRECTION * away)
        after[self._position] = q_M + self._period * v_M + drawn
        far = self._is_far(good)
        torque = self.drive(memory, state)
        simulated = v_M + self._period * self._motor_acceleration(torque, q, q_M, v_M)
        after[self._position] = np.where(far, q_M + self._period * simulated, after[self._position])
        quotient = (q - memory[self._last].reshape(4, -1))[[_Q_M, _Q_J]] / self._period
        # rigid joints have their motors' positions on either side
        newest = np.where(good[_Q_M] | self._elastic, quotient[0], quotient[1])
        rate = memory[self._rate] + _NEWEST * (newest - memory[self._rate])
        after[self._rate] = np.where(far, simulated, np.where(np.isfinite(rate), rate, 0.0))
        after[self._elapsed] += self._period
        after[self._suspect] = np.maximum(memory[self._suspect], suspect)
        after[self._last] = state
        return after

    def suspects(self, memory: np.ndarray) -> np.ndarray:
        """Return which components of the state are not used any more, nonzero if so, (4N,)."""
        return memory[self._suspect]

    def _state_at_fault(
        self, last: np.ndarray, state: np.ndarray, suspect: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return ``q_J, v_J, q_M, v_M``, each (N,), from what is measured or was a moment ago."""
        now, before = state.reshape(4, -1), np.where(np.isfinite(last), last, 0.0).reshape(4, -1)
        suspect = suspect.reshape(4, -1)
        good = np.isfinite(now) & ~suspect
        step = self._period * before[[_V_J, _V_M]]
        expected = before.copy()
        expected[[_Q_J, _Q_M]] += step
        found = np.where(good, now, expected)
        weight = self._inverse_dynamics(found[_Q_J], np.zeros(self._n), np.zeros(self._n))
        deflection = weight * self._compliance
        # what was implausible may have been so for a while: then the other side knows better
        for own, other, shift in ((_Q_J, _Q_M, -deflection), (_Q_M, _Q_J, deflection)):
            rely = suspect[own] & ~suspect[other]
            found[own] = np.where(rely, found[other] + shift, found[own])
        for own, position, other in ((_V_J, _Q_J, _V_M), (_V_M, _Q_M, _V_J)):
            rely = suspect[own] & ~suspect[other]
            quotient = (now[position] - before[position]) / self._period
            known = np.where(good[position], quotient, 0.0)
            found[own] = np.where(suspect[own], np.where(rely, found[other], known), found[own])
        return found[_Q_J], found[_V_J], found[_Q_M], found[_V_M]

    def _stopping_time(self, momentum: np.ndarray, weight: np.ndarray) -> float:
        """Return T [s], in which the drives can take the momentum off beside the weight."""
        granted = self._settings.effort_share * self._limits
        # the weight helps to brake what moves up
        available = np.maximum(granted + np.sign(momentum) * weight, _LEAST_SHARE * self._limits)
        return max(_SHORTEST, float(np.max(_PEAK * np.abs(momentum) / available)))

    def _total_inertia(self, q_J: np.ndarray) -> np.ndarray:
        """Return ``D_E + D_M``, shape (N, N)."""
        self._mass_matrix.arguments["q"][:] = q_J
        self._mass_matrix.evaluate()
        return self._mass_matrix.results["D"].reshape(self._n, -1) + np.diag(self._D_M)

    def _inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        arguments = self._torque.arguments
        arguments["q"][:], arguments["v"][:], arguments["a"][:] = q, v, a
        self._torque.evaluate()
        return self._torque.results["tau"].copy()

    def _link_reference(self, memory: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ``q_J,r``, its rate and acceleration, each (N,)."""
        T, v_0 = memory[self._duration][0], memory[self._v_0]
        x = min(memory[self._elapsed][0] / T, 1.0)
        way, rate, slope = _stop(x)
        return memory[self._q_0] + v_0 * (T * way), v_0 * rate, v_0 * (slope / T)

    def _reference(self, memory: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the motors' position and rate, and the torque for them, each (N,)."""
        q, v, a = self._link_reference(memory)
        tau_J = self._inverse_dynamics(q, v, a)
        x = min(memory[self._elapsed][0] / memory[self._duration][0], 1.0)
        fading = _stop(x)[1]
        return (
            q + tau_J * self._compliance + fading * memory[self._offset],
            v + fading * memory[self._offset_rate],
            tau_J + self._D_M * a + self._viscous * v,
        )

    def _gains(self, inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ``K_p`` [Nm/rad] and ``K_v`` [Nm s/rad], each (N,)."""
        omega = self._settings.bandwidth
        damping = np.maximum(2.0 * omega * inertia, self._settings.damping)
        # what a torque that is held over a period moves at once
        nearest = np.where(self._elastic, self._D_M, inertia)
        K_v = np.minimum(damping, _LARGEST_STEP * nearest / self._period)
        # a motor that is all but clamped lets the link swing on its spring
        swinging = np.sqrt(self._stiffness * np.maximum(inertia - self._D_M, 0.0))
        K_v = np.where(self._elastic, np.minimum(K_v, swinging), K_v)
        K_p = inertia * np.minimum(omega, K_v / (2.0 * inertia)) ** 2
        return K_p, K_v

    def _is_far(self, good: np.ndarray) -> np.ndarray:
        """Return for which elastic joints only the link side is seen, shape (N,)."""
        has_q_J, _, has_q_M, has_v_M = good
        return np.asarray(self._elastic & has_q_J & ~has_q_M & ~has_v_M)

    def _motor_acceleration(
        self, torque: np.ndarray, q: np.ndarray, q_M: np.ndarray, v_M: np.ndarray
    ) -> np.ndarray:
        """Return the acceleration of motors that are not seen, shape (N,)."""
        D_M = np.where(self._D_M > 0.0, self._D_M, np.inf)
        damping = 2.0 * _FOLLOWING * np.sqrt(self._stiffness * self._D_M)
        spring = self._stiffness * (q_M - q[_Q_J])
        following = damping * (v_M - np.where(np.isfinite(q[_V_J]), q[_V_J], 0.0))
        return np.asarray((torque - self._viscous * v_M - spring - following) / D_M)

    def _good(self, memory: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return what of a state is used, shape (4N,)."""
        return np.asarray(np.isfinite(state) & (memory[self._suspect] == 0.0))

    def _motors(
        self, memory: np.ndarray, state: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the motors' positions and velocities, and shares of the gains, each (N,)."""
        good = self._good(memory, state).reshape(4, -1)
        q_J, v_J, q_M, v_M = state.reshape(4, -1)
        has_q_J, has_v_J, has_q_M, has_v_M = good
        rigid = ~self._elastic
        position = np.where(has_q_M, q_M, np.where(rigid & has_q_J, q_J, memory[self._position]))
        near = has_q_M | (rigid & has_q_J)
        velocity = np.where(rigid & has_v_J, v_J, np.where(near, memory[self._rate], v_J))
        velocity = np.where(has_v_M, v_M, velocity)
        moving = has_v_M | (rigid & has_v_J) | near
        known = near | has_v_M | (rigid & has_v_J)
        far = self._is_far(good)
        velocity = np.where(far, memory[self._rate], np.where(moving, velocity, 0.0))
        share = np.where(known, 1.0, np.where(far, _FAR_SIDE, 0.0))
        differentiated = near & ~has_v_M & ~(rigid & has_v_J)
        braking = np.where(differentiated, _DIFFERENTIATED, np.where(moving, 1.0, 0.0))
        braking = np.where(far, _FAR_SIDE, braking)
        return position, velocity, share, braking


def _stop(x: float) -> tuple[float, float, float]:
    """Return way, rate and slope of a stop at a part of its time: rate 1 - 3 x^2 + 2 x^3."""
    return x - x**3 + 0.5 * x**4, 1.0 - 3.0 * x**2 + 2.0 * x**3, 6.0 * (x**2 - x)


def _torque_function(robot: RobotModel) -> ca.Function:
    """Return ``(q, v, a) -> tau_J``, each (N,)."""
    n = robot.dimension
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    motion = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(n)]
    tau = ca.vertcat(*[jet.coefficients[0] for jet in robot.inverse_dynamics(motion)])
    return ca.Function("stopping_torque", [q, v, a], [ca.densify(tau)], ["q", "v", "a"], ["tau"])


def _mass_matrix_function(robot: RobotModel) -> ca.Function:
    """Return ``q -> D_E``, shape (N, N)."""
    q = ca.SX.sym("q", robot.dimension)
    return ca.Function("mass_matrix", [q], [ca.densify(robot.mass_matrix(q))], ["q"], ["D"])
