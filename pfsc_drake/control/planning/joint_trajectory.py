"""Joint trajectory of a robot whose tool follows its reference exactly."""

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.law.decoupling import DecouplingInverse, Spare
from pfsc_drake.control.law.law_functions import spare_motion
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.manifolds.manifold import Manifold, ProjectedManifold
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, MovingFrameManifold
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function

# step of the joints [rad or m] below which the iteration has converged; largest number of steps
_TOLERANCE, _STEPS = 1e-9, 12
# joints rest where all derivatives are below this
_AT_REST = 1e-9
# projects onto a manifold: (tool point, memory of the last projection) -> manifold point
Projection = Callable[[np.ndarray, np.ndarray], np.ndarray]


class TrajectoryError(InputError):
    """Error: the joints cannot follow a reference.

    Attributes:
        trajectory: Joint coordinates up to the failure, shape (samples, N).
        rcond: Reciprocal condition number of a singular decoupling matrix there, or None where the
            iteration does not converge.
    """

    def __init__(self, message: str, rcond: float | None = None) -> None:
        super().__init__(message)
        self.trajectory, self.rcond = np.zeros((0, 0)), rcond


@dataclass(frozen=True)
class TrajectoryStart:
    """Initial state of a joint trajectory.

    Attributes:
        q_J: Joint coordinates near the begin of the reference, shape (N,).
        memory: Memory of the manifold's projection at the tool.
    """

    q_J: np.ndarray
    memory: np.ndarray


class TrajectoryFinder:
    """Solver for the joint trajectory on which the virtual output equals its reference.

    At every instant, order by order: with ``yhat^(k) = A q^(k) + b_k``, where ``b_k`` depends on
    lower orders only, ``q^(k)`` is corrected by the inverse of A until ``yhat^(k)`` is the
    reference's, for k = 0 .. r. Redundant joints move as under the control law: their r-th
    derivative is as close to the posture task's as the outputs allow, and the lower derivatives,
    which are integrated, are corrected as little as possible. The law's restraint of the posture
    task at high joint speeds is neglected; :meth:`restraint_ratio` returns where it would act.

    Args:
        robot: Nominal robot model, N joints.
        manifold: The manifold that the tool follows and is projected onto.
        projection: Projection onto the manifold.
        inverse: Inverse of the decoupling matrix.
        posture: Posture task of a redundant robot.
        in_moving_frame: Whether the manifold moves with a frame.
    """

    def __init__(
        self,
        robot: RobotModel,
        manifold: ProjectedManifold,
        projection: Projection,
        inverse: DecouplingInverse,
        posture: Posture | None = None,
        *,
        in_moving_frame: bool = False,
    ) -> None:
        self._n, self._order = robot.dimension, manifold.layout.order
        self._memory, self._projection = manifold.layout.memory, projection
        self._pose = BoundFunction(pose_function(robot))
        target: Manifold = MovingFrameManifold(manifold) if in_moving_frame else manifold
        self._correction = BoundFunction(_correction_function(robot, target, inverse, posture))
        self._restraint = None
        if posture is not None and posture.speeds is not None:
            restraint = _restraint_function(robot, target, inverse, posture)
            self._restraint = BoundFunction(restraint)

    @once_per_content(30)
    def find(
        self,
        start: TrajectoryStart,
        reference: np.ndarray,
        times: np.ndarray,
        *,
        still: bool = False,
        frames: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the joints' coordinates and derivatives 0..r, shape (samples, r + 1, N).

        Args:
            start: Initial state.
            reference: Derivatives 0..r of the virtual output's reference, shape (samples, r + 1,
                m).
            times: Times of the samples, evenly spaced [s], shape (samples,).
            still: Whether the posture task is left out, so that redundant joints move as little as
                possible. The posture task needs the sampling time of the law.
            frames: Derivatives 0..r of the frame in which the manifold moves, if it does, shape
                (samples, 12 (r + 1)), see :func:`frame_jets`.

        Raises:
            TrajectoryError: If the iteration does not converge or the decoupling matrix is
                singular.
        """
        trajectory = np.zeros((len(times), self._order + 1, self._n))
        q, memory = np.zeros((self._order + 1, self._n)), start.memory
        q[0], q_0 = start.q_J, start.q_J
        step = float(times[1] - times[0]) if len(times) > 1 else 0.0
        advance = _advance(self._order, step)
        for i in range(len(times)):
            waits = frames is None or not frames[i - 1 : i + 1, POSE_SIZE:].any()
            if i == 0 or not (waits and _rests(q, reference[i - 1 : i + 1])):
                if i > 0:
                    q = advance @ q
                if still:
                    q[1:] = 0.0
                frame = None if frames is None else frames[i]
                posture = None if still else q_0
                try:
                    memory = self._correct(q, posture, reference[i], memory, frame)
                except TrajectoryError as error:
                    error.trajectory = np.vstack([trajectory[:i, 0], q[0]])
                    raise
            trajectory[i] = q
        return trajectory

    @once_per_content(30)
    def condition(
        self,
        start: TrajectoryStart,
        trajectory: np.ndarray,
        reference: np.ndarray,
        frames: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the reciprocal condition number of the decoupling matrix, shape (samples,).

        Args:
            start: Initial state of the trajectory.
            trajectory: Joint trajectory from :meth:`find`.
            reference: Reference of the virtual output.
            frames: Frames of the trajectory, as for :meth:`find`.
        """
        found, memory = np.zeros(len(trajectory)), start.memory
        arguments, results = self._correction.arguments, self._correction.results
        for i, (q, desired) in enumerate(zip(trajectory, reference, strict=True)):
            frame = None if frames is None else frames[i]
            arguments["derivatives"][:], arguments["desired"][:] = q.ravel(), desired.ravel()
            arguments["manifold_point"][:] = point = self._project(q[0], memory, frame)
            memory = point[self._memory].copy()
            self._correction.evaluate()
            found[i] = results["rcond"][0]
        return found

    @once_per_content(30)
    def without_posture(
        self, start: TrajectoryStart, trajectory: np.ndarray, reference: np.ndarray
    ) -> np.ndarray:
        """Return a trajectory without the posture task's share of the motion, of the same shape.

        Args:
            start: Initial state of the trajectory.
            trajectory: Joint trajectory from :meth:`find`; its coordinates are retained.
            reference: Reference of the virtual output.
        """
        found, memory = np.zeros_like(trajectory), start.memory
        found[:, 0] = trajectory[:, 0]
        for q, desired in zip(found, reference, strict=True):
            memory = self._correct(q, None, desired, memory)
        return found

    @once_per_content(30)
    def restraint_ratio(
        self, start: TrajectoryStart, trajectory: np.ndarray, reference: np.ndarray
    ) -> np.ndarray:
        """Return joint speeds relative to those at which the law restrains the posture task.

        The joint speeds for the outputs and those for the posture task are added. The law follows
        the trajectory as long as no ratio exceeds 1. The ratios are zero if the posture task is not
        restrained.

        Args:
            start: Initial state of the trajectory.
            trajectory: Joint trajectory from :meth:`find`.
            reference: Reference of the virtual output.

        Returns:
            Shape (samples, N).
        """
        found, memory = np.zeros((len(trajectory), self._n)), start.memory
        if self._restraint is None:
            return found
        arguments, results = self._restraint.arguments, self._restraint.results
        arguments["posture"][: self._n] = start.q_J
        for i, (q, desired) in enumerate(zip(trajectory, reference, strict=True)):
            arguments["derivatives"][:], arguments["desired"][:] = q.ravel(), desired.ravel()
            arguments["manifold_point"][:] = point = self._project(q[0], memory)
            memory = point[self._memory].copy()
            self._restraint.evaluate()
            found[i] = results["shares"]
        return found

    def _project(
        self, q: np.ndarray, memory: np.ndarray, frame: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the manifold point at joint coordinates."""
        self._pose.arguments["q"][:] = q
        self._pose.evaluate()
        y = self._pose.results["pose"][:3]
        if frame is None:
            return self._projection(y, memory)
        R_WC = frame[3:POSE_SIZE].reshape(3, 3)
        return np.concatenate([self._projection(R_WC.T @ (y - frame[:3]), memory), frame])

    def _correct(
        self,
        q: np.ndarray,
        q_0: np.ndarray | None,
        desired: np.ndarray,
        memory: np.ndarray,
        frame: np.ndarray | None = None,
    ) -> np.ndarray:
        """Correct the derivatives in place, and return the memory of the projection."""
        arguments, results = self._correction.arguments, self._correction.results
        arguments["desired"][:], point = desired.ravel(), None
        steps = results["steps"].reshape((-1, self._n))

        def correct(k: int, *, with_posture: bool = False) -> np.ndarray:
            arguments["derivatives"][:] = q.ravel()
            self._correction.evaluate()
            if not results["usable"][0]:
                rcond = results["rcond"][0]
                raise TrajectoryError(f"singular, reciprocal condition number {rcond:.2g}", rcond)
            step = results["posture_step"] if with_posture else steps[k]
            q[k] += step
            return step

        for _ in range(_STEPS):
            arguments["manifold_point"][:] = point = self._project(q[0], memory, frame)
            if not np.max(np.abs(correct(0))) > _TOLERANCE:
                break
        else:
            raise TrajectoryError("not reached")
        for k in range(1, self._order):
            correct(k)
        q[self._order] = 0.0
        if q_0 is not None:
            arguments["posture"][: self._n] = q_0
        correct(self._order, with_posture=q_0 is not None)
        return point[self._memory].copy()


def _rests(q: np.ndarray, reference: np.ndarray) -> bool:
    """Return whether joints at rest stay at rest from one reference sample to the next."""
    return (
        np.max(np.abs(q[1:])) < _AT_REST
        and not reference[:, 1:].any()
        and bool(np.all(reference[0, 0] == reference[1, 0]))
    )


def _advance(order: int, step: float) -> np.ndarray:
    """Return the matrix that advances derivatives 0..order by a step with the last one constant."""
    ahead = np.subtract.outer(np.arange(order + 1), np.arange(order + 1)).T
    return np.array(
        [[step**j / factorial(j) if j >= 0 else 0.0 for j in row.tolist()] for row in ahead]
    )


class _Relation(NamedTuple):
    """Symbolic error between the virtual output of a joint motion and the desired output.

    Attributes:
        derivatives: Derivatives 0..r of the joint coordinates by rows, shape ((r + 1) N,).
        point: The manifold point.
        desired: Desired derivatives 0..r of the output by rows, shape ((r + 1) m,).
        posture: Derivatives 0..r of the posture reference, shape ((r + 1) N,).
        A: Decoupling matrix, shape (m, N).
        missing: Errors of the output's derivatives 0..r, each (m,).
    """

    derivatives: ca.SX
    point: ca.SX
    desired: ca.SX
    posture: ca.SX
    A: ca.SX
    missing: list[ca.SX]

    @classmethod
    def of(cls, robot: RobotModel, manifold: Manifold) -> "_Relation":
        """Return the relation of a robot on a manifold."""
        n, order = robot.dimension, manifold.layout.order
        m = len(manifold.coordinates)
        derivatives = ca.SX.sym("derivatives", (order + 1) * n)
        point, rate = ca.SX.sym("manifold_point", manifold.layout.size), ca.SX.sym("rate", n)
        desired = ca.SX.sym("desired", (order + 1) * m)
        posture = ca.SX.sym("posture", (order + 1) * n)
        q = ca.vertsplit(derivatives, n)

        def output(motion: list[ca.SX]) -> list:
            y, R_e = robot.tool_pose(joint_jets(motion))
            return manifold.virtual_output(y, R_e, point, [])

        found = output(q)
        slopes = ca.vertcat(*[y.coefficients[1] for y in output([q[0], rate])])
        missing = [
            y_p - ca.vertcat(*[y.derivative(k) for y in found])
            for k, y_p in enumerate(ca.vertsplit(desired, m))
        ]
        return cls(derivatives, point, desired, posture, ca.jacobian(slopes, rate), missing)

    def function(self, name: str, results: dict[str, ca.SX]) -> ca.Function:
        """Return results as a function of all symbols."""
        return ca.Function(
            name,
            [self.derivatives, self.point, self.desired, self.posture],
            [ca.densify(e) for e in ca.cse(list(results.values()))],
            ["derivatives", "manifold_point", "desired", "posture"],
            list(results),
        )


@once_per_content()
def _correction_function(
    robot: RobotModel,
    manifold: Manifold,
    inverse: DecouplingInverse,
    posture: Posture | None,
) -> ca.Function:
    """Return the corrections of joint derivatives that make the virtual output the desired one.

    Column k of ``steps``, shape (N, r + 1), is the least correction of order k, given that the
    lower orders are correct. ``posture_step``, shape (N,), is the correction of order r with the
    posture task in the null space. For ``rcond`` and ``usable`` see :class:`DecouplingSolution`.
    """
    relation, n = _Relation.of(robot, manifold), robot.dimension
    A, still, posture_spare = relation.A, None, None
    if posture is not None:
        still = Spare(ca.SX(n, 1), posture.scale)
        q = ca.vertsplit(relation.derivatives, n)
        posture_spare = spare_motion(posture, robot, q[:-1], relation.posture)
        posture_spare = posture_spare._replace(restraint=None)
    steps = [inverse.solve(A, rhs, still) for rhs in relation.missing]
    last = inverse.solve(A, relation.missing[-1], posture_spare)
    results = {
        "steps": ca.horzcat(*[solution.x for solution in steps]),
        "posture_step": last.x,
        "rcond": last.rcond,
        "usable": last.usable,
    }
    return relation.function("correction", results)


@once_per_content()
def _restraint_function(
    robot: RobotModel, manifold: Manifold, inverse: DecouplingInverse, posture: Posture
) -> ca.Function:
    """Return ``shares`` of the speeds at which the posture task is restrained, shape (N,)."""
    relation, n = _Relation.of(robot, manifold), robot.dimension
    q = ca.vertsplit(relation.derivatives, n)
    spare = spare_motion(posture, robot, q[:-1], relation.posture)
    restraint, A = spare.restraint, relation.A
    assert restraint is not None and posture.speeds is not None
    # without the highest derivative of the joints
    rhs = relation.missing[-1] + A @ q[-1]
    x = inverse.solve(A, rhs, spare._replace(restraint=None)).x
    rest = inverse.solve(A, rhs, Spare(restraint.rest, spare.scale)).x
    taken = rest
    if restraint.velocity is not None:
        taken = inverse.solve(A, A @ restraint.velocity, Spare(ca.SX(n, 1), spare.scale)).x
    speeds = ca.fabs(taken) + ca.fabs(x - rest) / restraint.settling
    return relation.function("restraint", {"shares": speeds / ca.DM(posture.speeds)})
