"""What drives do after a fault: stop, and hold the robot where it has come to rest."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.law.stopping_step import (
    Joints,
    StopMemory,
    stopping_step,
    torque_function,
)
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# s, of the shortest stop
_SHORTEST = 0.05
# of smoothstep: its largest slope over its mean
_PEAK = 1.5
# share of the torque limit that braking is granted however much gravity takes
_LEAST_SHARE = 0.1

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
        self._D_M = robot.D_M
        joints = Joints.of(robot, self._limits, settings.damping)
        self._compliance = np.array(joints.compliance).ravel()
        self._mass_matrix = BoundFunction(_mass_matrix_function(robot))
        self._torque = BoundFunction(torque_function(robot))
        self._at = StopMemory(n)
        self.size = self._at.size
        step = BoundFunction(stopping_step(robot, joints, settings.bandwidth, period))
        self._evaluate, arguments, results = step.evaluate, step.arguments, step.results
        self._memory, self._state = arguments["memory"], arguments["state"]
        self._suspect, self._drive = arguments["suspect"], results["drive"]
        self._next = results["next"]

    def start(self, last: np.ndarray, state: np.ndarray, suspect: np.ndarray) -> np.ndarray:
        """Return the memory at the instant of a fault.

        Args:
            last: State one period before, ``[q_J, v_J, q_M, v_M]``, shape (4N,), as far as known.
            state: Measured now, shape (4N,).
            suspect: Which of it is implausible, nonzero if so, shape (4N,).
        """
        memory, at = np.zeros(self.size), self._at
        q_J, v_J, q_M, v_M = self._state_at_fault(last, state, suspect != 0.0)
        D = self._total_inertia(q_J)
        momentum = D @ v_J
        weight = self._weight(q_J)
        memory[at.duration] = self._stopping_time(momentum, weight)
        memory[at.q_0], memory[at.v_0], memory[at.inertia] = q_J, v_J, np.diag(D)
        memory[at.position], memory[at.rate] = q_M, v_M
        memory[at.suspect], memory[at.last] = suspect, state
        borne = self._torque_for(q_J, v_J)
        memory[at.offset] = q_M - (q_J + borne * self._compliance)
        memory[at.offset_rate] = v_M - v_J
        return memory

    def drive(self, memory: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the drive torques within their limits, shape (N,) [Nm or N].

        Args:
            memory: See :meth:`start`.
            state: Measured now, shape (4N,).
        """
        self._memory[:] = memory
        self._state[:] = state
        self._evaluate()
        return self._drive.copy()

    def advance(self, memory: np.ndarray, state: np.ndarray, suspect: np.ndarray) -> np.ndarray:
        """Return the memory one period later.

        Args:
            memory: See :meth:`start`.
            state: Measured now, shape (4N,).
            suspect: What of it is implausible, nonzero if so, shape (4N,).
        """
        self._suspect[:] = suspect
        self.drive(memory, state)
        return self._next.copy()

    def suspects(self, memory: np.ndarray) -> np.ndarray:
        """Return which components of the state are not used any more, nonzero if so, (4N,)."""
        return memory[self._at.suspect]

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
        # what was implausible may have been so for a while: then the other side knows better
        nearest = np.where(suspect[_Q_J] & ~suspect[_Q_M], found[_Q_M], found[_Q_J])
        deflection = self._weight(nearest) * self._compliance
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

    def _weight(self, q: np.ndarray) -> np.ndarray:
        return self._torque_for(q, np.zeros(self._n))

    def _torque_for(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return ``tau_J`` of a steady motion, shape (N,)."""
        arguments = self._torque.arguments
        arguments["q"][:], arguments["v"][:], arguments["a"][:] = q, v, 0.0
        self._torque.evaluate()
        return self._torque.results["tau"].copy()


def _mass_matrix_function(robot: RobotModel) -> ca.Function:
    """Return ``q -> D_E``, shape (N, N)."""
    q = ca.SX.sym("q", robot.dimension)
    return ca.Function("mass_matrix", [q], [ca.densify(robot.mass_matrix(q))], ["q"], ["D"])
