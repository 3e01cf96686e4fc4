"""The closed loop of a law and its robot near rest, linear and sampled.

Near rest, and with almost constant weight, joints with ``q_M - q_J`` elastic obey::

    D_E q_J'' = K_s (q_M - q_J) + K_d (v_M - v_J) - G q_J
    D_M q_M'' = tau_d - K_s (q_M - q_J) - K_d (v_M - v_J) - f_v v_M

with the weight's slope ``G = d g_L / d q``; motor and link of a rigid joint are equal. Between
two samples ``tau_d`` is held, which integrates exactly. The law commands
``tau_d = gain q^(r) + drift + offset``, extrapolated as in :class:`FollowingLaw`; its slopes are
differences of its own function :class:`Linearization`, so that no law is written down twice, and
``q^(r)`` is the solution of :class:`DecouplingInverse` for outputs and posture. The actual robot
may differ from the nominal model of the law.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.linalg import expm

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.decoupling import DecouplingInverse, Spare, scale_of
from pfsc_drake.control.law.linearization import Linearization, tangential_count
from pfsc_drake.control.law.posture import Posture, posture_expressions
from pfsc_drake.control.law.stabilization import LoopGains, Stabilization
from pfsc_drake.robot.robot_model import RobotModel, gravity_torque

_DIFFERENCE = 1e-6
# reciprocal condition number below that of any start
_SINGULAR = 1e-12


@dataclass(frozen=True)
class RestPosture:
    """Rest posture of a robot on a manifold.

    Attributes:
        q_J: Joint coordinates, shape (N,).
        point: Manifold point there, laid out by the manifold's layout.
    """

    q_J: np.ndarray
    point: np.ndarray


class LoopAtRest:
    """Loop of a law and a robot at rest, with any gains and any factor on masses and stiffnesses.

    For laws that command torques, without external torques as inputs.

    Args:
        robot: Nominal model of the robot.
        linearization: The law, of relative degree 2 or more.
        rest: Rest posture.
        period: Sampling time ``T_s`` [s].
        posture: Posture control of redundant joints, if there are any.
        ticks: Delay of the commanded torques in samples, known to the law: it acts on the predicted
            state of the nominal model.
    """

    def __init__(
        self,
        robot: RobotModel,
        linearization: Linearization,
        rest: RestPosture,
        period: float,
        posture: Posture | None = None,
        ticks: int = 0,
    ) -> None:
        self._ticks = ticks
        n = robot.dimension
        self._robot, self._n, self._period = robot, n, period
        self._elastic = robot.elastic_joints
        self._D_E, g, self._G = (np.array(x) for x in _dynamics_at_rest(robot)(rest.q_J))
        self._lead = linearization.lead
        q_M = rest.q_J + g.ravel() / robot.K_s
        zero = np.zeros(n)
        state = np.concatenate([rest.q_J, zero, q_M, zero])
        A, gain = self._differentiate(linearization, state, rest.point)
        if posture is None:
            self._per_output = gain @ np.linalg.pinv(A)
        else:
            self._solve(A, gain, posture, rest.q_J)

    def _differentiate(
        self, law: Linearization, state: np.ndarray, point: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the slopes of virtual output and drive input by the measured joint state.

        Returns:
            Decoupling matrix and gain at rest.
        """
        n, m, r = self._n, law.num_outputs, law.relative_degree
        standing = np.zeros((r + 1) * tangential_count(law.manifold))
        further = [standing] if law.manifold.follows_time else []
        no_torque = np.zeros(n * (r - 1))

        def results(x: np.ndarray) -> list[np.ndarray]:
            return [np.array(y) for y in law.function(x, no_torque, point, *further)]

        _, A, _, gain, *_ = results(state)
        Y, varying, offset = np.zeros((4 * n, r, m)), np.zeros((4 * n, n)), np.zeros((4 * n, n))
        motion = np.zeros((4 * n, r, n))
        for i in range(4 * n):
            shift = np.zeros(4 * n)
            shift[i] = _DIFFERENCE
            plus, minus = results(state + shift), results(state - shift)
            Y[i] = ((plus[0] - minus[0]) / (2.0 * _DIFFERENCE)).T
            varying[i] = ((plus[4] - minus[4]) / (2.0 * _DIFFERENCE)).ravel()
            offset[i] = ((plus[5] - minus[5]) / (2.0 * _DIFFERENCE)).ravel()
            motion[i] = ((plus[6] - minus[6]) / (2.0 * _DIFFERENCE)).T
        # the point belongs to the posture, and its motion is in the decoupling matrix
        acts_on_motors = r == 2 and np.any(Y[3 * n :, 1])
        Y[:, 0] = 0.0
        first = 2 * n if acts_on_motors else 0
        Y[first : first + n, 0] = A.T
        self._Y, self._drift, self._offset, self._motion = Y, varying.T, offset.T, motion
        return A, gain

    def _solve(self, A: np.ndarray, gain: np.ndarray, posture: Posture, q: np.ndarray) -> None:
        """Compute the slopes of the drives by outputs, desired values and a posture coordinate."""
        n, m, inverse = self._n, len(A), DecouplingInverse(_SINGULAR)
        symbol, rest = ca.SX.sym("q", n), [ca.SX(n, 1)] * (self._motion.shape[1])
        expressions = posture_expressions(
            posture, self._robot, [symbol, *rest[1:]], [symbol, *rest]
        )
        values = ca.Function("rest", [symbol], [expressions.weight, expressions.slope])(q)
        weight, slope = (ca.SX(x) for x in values)
        scale = scale_of(weight) if weight.numel() else posture.scale
        self._slope = np.array(values[1]).ravel() if slope.numel() else None
        rhs, desired, rate = ca.SX.sym("rhs", m), ca.SX.sym("desired", n), ca.SX.sym("rate")
        spare = Spare(desired, scale, slope if slope.numel() else None, rate)
        answer = ca.SX(gain) @ inverse.solve(ca.SX(A), rhs, spare).x
        # it is linear in all of them
        slopes = [ca.evalf(ca.jacobian(answer, x)) for x in (rhs, desired, rate)]
        self._per_output, self._per_desired, per_rate = (np.array(slope) for slope in slopes)
        self._per_rate = per_rate.ravel()

    def _posture_answer(self, gains: Stabilization) -> np.ndarray:
        """Return the slopes of the drives that the posture adds, shape (N, 4N)."""
        desired = -np.einsum("km,ikm->mi", gains.proportional, self._motion)
        answer = self._per_desired @ desired
        # the rate of the coordinate follows from the same gains
        return (
            answer
            if self._slope is None
            else answer + np.outer(self._per_rate, self._slope @ desired)
        )

    def closed_loop(
        self, gains: LoopGains, mass: float = 1.0, stiffness: float = 1.0
    ) -> np.ndarray:
        """Return the map of one sampling interval, from just after a sample to just after the next.

        Args:
            gains: Gains of all coordinates, and of the posture if there is one.
            mass: Actual masses and inertias of the links, relative to the nominal ones.
            stiffness: Actual joint stiffnesses, relative to the nominal ones.

        Returns:
            Shape (k, k); the last N variables are the newest drive inputs.
        """
        interval, answer, _ = self._parts(gains, mass, stiffness)
        return np.asarray(answer @ interval)

    def disturbance_response(self, gains: LoopGains) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the response to external torques that are no inputs of the law.

        Args:
            gains: Gains of all coordinates, and of the posture if there is one.

        Returns:
            ``A``, ``B``, ``C`` of ``x_{k+1} = A x_k + B tau_ext``, ``q_J = C x_k``, the torques
            [Nm or N] constant over an interval, and ``q_J`` the links' deviation from rest [rad or
            m].
        """
        interval, answer, pushed = self._parts(gains, 1.0, 1.0)
        links = np.zeros((self._n, len(interval)))
        links[:, : self._n] = np.eye(self._n)  # _plant counts the links first
        return answer @ interval, answer @ pushed, links

    def _parts(
        self, gains: LoopGains, mass: float, stiffness: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return maps of an interval, of the law's sample after it, and of torques in between."""
        n, period, ticks = self._n, self._period, self._ticks
        Phi, Gamma, Gamma_ext, C = self._interval(mass, stiffness)
        size = len(Phi)
        error = self._Y[:, 0].T @ C
        v = -np.einsum("km,ikm->mi", gains.outputs.proportional, self._Y) @ C
        varying = self._per_output @ v + self._drift @ C
        if gains.posture is not None:
            varying = varying + self._posture_answer(gains.posture) @ C
        drive = varying + self._offset @ C
        summed = -self._per_output * gains.outputs.integral
        # variables: motion, last varying input, summed error, drive inputs, oldest first
        m = len(error)
        inputs = size + n + m
        count = inputs + (ticks + 1) * n
        interval, pushed = np.eye(count), np.zeros((count, n))
        interval[:size, :size], pushed[:size] = Phi, Gamma_ext
        interval[:size, inputs : inputs + n] = Gamma
        motion, last, sums, sent = np.split(np.eye(count), [size, size + n, inputs])
        # commands in transit act on the nominal model
        state = motion
        if ticks:
            Phi, Gamma, _, _ = self._interval(1.0, 1.0)
        in_transit = sent[n:]
        for command in np.split(in_transit, ticks) if ticks else []:
            state = Phi @ state + Gamma @ command
        varying_now = varying @ state + summed @ sums
        newest = drive @ state + summed @ sums + self._lead * (varying_now - last)
        answer = [motion, varying_now, sums + period * error @ state, in_transit, newest]
        return interval, np.vstack(answer), pushed

    def _interval(
        self, mass: float, stiffness: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the robot's map of an interval: ``Phi``, ``Gamma``, ``Gamma_ext``, ``C``."""
        n = self._n
        F, B, B_ext, C = self._plant(mass, stiffness)
        size = len(F)
        inputs = np.hstack([B, B_ext])
        block = np.block([[F, inputs], [np.zeros((2 * n, size + 2 * n))]])
        exponential = expm(block * self._period)
        Phi, Gamma, Gamma_ext = np.split(exponential[:size], [size, size + n], axis=1)
        return Phi, Gamma, Gamma_ext, C

    def _plant(
        self, mass: float, stiffness: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the continuous dynamics of the actual robot.

        Returns:
            ``F``, ``B``, ``B_ext``, ``C`` of ``x' = F x + B tau_d + B_ext tau_ext`` and
            ``[q_J, v_J, q_M, v_M] = C x``; the first N of x are the links' coordinates.
        """
        n, elastic, robot = self._n, self._elastic, self._robot
        soft = np.flatnonzero(elastic)
        # coordinates z: all links, and the motors of elastic joints
        motors = np.eye(n, n + len(soft))
        motors[soft] = 0.0
        motors[soft, n + np.arange(len(soft))] = 1.0
        links = np.eye(n, n + len(soft))
        bend = (motors - links)[soft]
        M = mass * links.T @ self._D_E @ links + motors.T @ (robot.D_M[:, None] * motors)
        K = bend.T @ (stiffness * robot.K_s[soft][:, None] * bend)
        K = K + mass * links.T @ self._G @ links
        D = bend.T @ (robot.K_d[soft][:, None] * bend)
        D = D + motors.T @ (robot.viscous_damping[:, None] * motors)
        size = len(M)
        zero, one = np.zeros((size, size)), np.eye(size)
        F = np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
        B, B_ext = (
            np.vstack([np.zeros((size, n)), np.linalg.solve(M, driven.T)])
            for driven in (motors, links)
        )
        nothing = np.zeros((n, size))
        C = np.vstack(
            [
                np.hstack(parts)
                for parts in (
                    [links, nothing],
                    [nothing, links],
                    [motors, nothing],
                    [nothing, motors],
                )
            ]
        )
        return F, B, B_ext, C


@once_per_content()
def _dynamics_at_rest(robot: RobotModel) -> ca.Function:
    """Return ``q -> (D_E, g, dg/dq)`` of the links, shapes (N, N), (N,) and (N, N)."""
    q = ca.SX.sym("q", robot.dimension)
    weight = gravity_torque(robot, q)
    return ca.Function("rest", [q], [robot.mass_matrix(q), weight, ca.jacobian(weight, q)])
