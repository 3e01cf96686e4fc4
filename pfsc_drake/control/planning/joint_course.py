"""How joints move when a tool follows its reference exactly."""

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
from pfsc_drake.control.law.law_functions import spare_of
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.manifolds.manifold import Manifold, PlaceManifold
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, MovingFrameManifold
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function

# of a step of the joints [rad or m], below which a place is found; and how many steps are tried
_FOUND, _STEPS = 1e-9, 12
# of all derivatives, below which joints rest
_AT_REST = 1e-9
# finds the place on a manifold: (tool point, memory of the last place) -> manifold point
Projection = Callable[[np.ndarray, np.ndarray], np.ndarray]


class CourseError(InputError):
    """Joints cannot follow a reference.

    Attributes:
        course: Joint coordinates up to where they cannot, shape (samples, N).
        rcond: Reciprocal condition number of a singular decoupling matrix there, or None where the
            place is not found.
    """

    def __init__(self, message: str, rcond: float | None = None) -> None:
        super().__init__(message)
        self.course, self.rcond = np.zeros((0, 0)), rcond


@dataclass(frozen=True)
class CourseStart:
    """Where a course begins.

    Attributes:
        q_J: Posture of the joints, near the reference's first place, shape (N,).
        memory: Place on the manifold next to the tool, as its projector remembers it.
    """

    q_J: np.ndarray
    memory: np.ndarray


class CourseFinder:
    """Finds the joints' motion that lets the virtual output be equal to its reference.

    At every instant, order by order: with ``yhat^(k) = A q^(k) + b_k``, where ``b_k`` depends on
    lower orders only, ``q^(k)`` is corrected by the inverse of A until ``yhat^(k)`` is the
    reference's, for k = 0 .. r. What joints beyond the number of outputs do is what the law
    would let them do: their r-th derivative is next to what the posture desires, and what is
    integrated of it is corrected as little as the outputs allow. That the law holds a posture back
    where joints become fast is left out; :meth:`held_back` tells where it would.

    Args:
        robot: The robot as it is believed, N joints.
        manifold: What it follows; one that the tool is projected onto.
        projection: Finds the place on it.
        inverse: Inverts the decoupling matrix.
        posture: Posture of a robot with more joints than outputs.
        carried: Whether the manifold is one in a frame that moves.
    """

    def __init__(
        self,
        robot: RobotModel,
        manifold: PlaceManifold,
        projection: Projection,
        inverse: DecouplingInverse,
        posture: Posture | None = None,
        *,
        carried: bool = False,
    ) -> None:
        self._n, self._order = robot.dimension, manifold.layout.order
        self._memory, self._projection = manifold.layout.memory, projection
        self._pose = BoundFunction(pose_function(robot))
        seen: Manifold = MovingFrameManifold(manifold) if carried else manifold
        self._correction = BoundFunction(_correction_function(robot, seen, inverse, posture))
        self._restraint = None
        if posture is not None and posture.speeds is not None:
            restraint = _restraint_function(robot, seen, inverse, posture)
            self._restraint = BoundFunction(restraint)

    @once_per_content(30)
    def find(
        self,
        start: CourseStart,
        reference: np.ndarray,
        times: np.ndarray,
        *,
        still: bool = False,
        frames: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the joints' coordinates and derivatives 0..r, shape (samples, r + 1, N).

        Args:
            start: Where it begins.
            reference: Derivatives 0..r of the virtual output's reference, shape (samples, r + 1,
                m).
            times: Times of the samples, evenly spaced [s], shape (samples,).
            still: Whether joints beyond the outputs only move with them, as little as they can.
                The posture's own motion needs samples as close as those of the law.
            frames: Derivatives 0..r of the frame that carries the manifold, if one does, shape
                (samples, 12 (r + 1)), see :func:`frame_jets`.

        Raises:
            CourseError: If a place cannot be found, or is singular.
        """
        course = np.zeros((len(times), self._order + 1, self._n))
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
                led = None if still else q_0
                try:
                    memory = self._correct(q, led, reference[i], memory, frame)
                except CourseError as error:
                    error.course = np.vstack([course[:i, 0], q[0]])
                    raise
            course[i] = q
        return course

    @once_per_content(30)
    def condition(
        self,
        start: CourseStart,
        course: np.ndarray,
        reference: np.ndarray,
        frames: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the reciprocal condition number of the decoupling matrix, shape (samples,).

        Args:
            start: Where the course began.
            course: A course, from :meth:`find`.
            reference: That of the virtual output.
            frames: As of the course.
        """
        found, memory = np.zeros(len(course)), start.memory
        arguments, results = self._correction.arguments, self._correction.results
        for i, (q, wanted) in enumerate(zip(course, reference, strict=True)):
            frame = None if frames is None else frames[i]
            arguments["derivatives"][:], arguments["wanted"][:] = q.ravel(), wanted.ravel()
            arguments["manifold_point"][:] = point = self._place(q[0], memory, frame)
            memory = point[self._memory].copy()
            self._correction.evaluate()
            found[i] = results["rcond"][0]
        return found

    @once_per_content(30)
    def bare(self, start: CourseStart, course: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return a course without what only a posture moves, of the same shape.

        Args:
            start: Where it began.
            course: A course, from :meth:`find`; its coordinates are kept.
            reference: That of the virtual output.
        """
        found, memory = np.zeros_like(course), start.memory
        found[:, 0] = course[:, 0]
        for q, wanted in zip(found, reference, strict=True):
            memory = self._correct(q, None, wanted, memory)
        return found

    @once_per_content(30)
    def held_back(
        self, start: CourseStart, course: np.ndarray, reference: np.ndarray
    ) -> np.ndarray:
        """Return joint speeds by those from which on the law holds a posture back, (samples, N).

        Speeds are those that the outputs take and those that the posture asks for beside them,
        added; the law reaches what a course says as long as none is above 1. They are zero where
        nothing is held back.

        Args:
            start: Where it began.
            course: A course, from :meth:`find`.
            reference: That of the virtual output.
        """
        found, memory = np.zeros((len(course), self._n)), start.memory
        if self._restraint is None:
            return found
        arguments, results = self._restraint.arguments, self._restraint.results
        arguments["posture"][: self._n] = start.q_J
        for i, (q, wanted) in enumerate(zip(course, reference, strict=True)):
            arguments["derivatives"][:], arguments["wanted"][:] = q.ravel(), wanted.ravel()
            arguments["manifold_point"][:] = point = self._place(q[0], memory)
            memory = point[self._memory].copy()
            self._restraint.evaluate()
            found[i] = results["shares"]
        return found

    def _place(
        self, q: np.ndarray, memory: np.ndarray, frame: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the manifold point of joint coordinates."""
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
        wanted: np.ndarray,
        memory: np.ndarray,
        frame: np.ndarray | None = None,
    ) -> np.ndarray:
        """Correct the derivatives in their place, and return the memory of the place found."""
        arguments, results = self._correction.arguments, self._correction.results
        arguments["wanted"][:], point = wanted.ravel(), None
        steps = results["steps"].reshape((-1, self._n))

        def correct(k: int, *, led: bool = False) -> np.ndarray:
            arguments["derivatives"][:] = q.ravel()
            self._correction.evaluate()
            if not results["usable"][0]:
                rcond = results["rcond"][0]
                raise CourseError(f"singular, reciprocal condition number {rcond:.2g}", rcond)
            step = results["led"] if led else steps[k]
            q[k] += step
            return step

        for _ in range(_STEPS):
            arguments["manifold_point"][:] = point = self._place(q[0], memory, frame)
            if not np.max(np.abs(correct(0))) > _FOUND:
                break
        else:
            raise CourseError("not reached")
        for k in range(1, self._order):
            correct(k)
        q[self._order] = 0.0
        if q_0 is not None:
            arguments["posture"][: self._n] = q_0
        correct(self._order, led=q_0 is not None)
        return point[self._memory].copy()


def _rests(q: np.ndarray, reference: np.ndarray) -> bool:
    """Return whether joints at rest stay there from one sample of the reference to the next."""
    return (
        np.max(np.abs(q[1:])) < _AT_REST
        and not reference[:, 1:].any()
        and bool(np.all(reference[0, 0] == reference[1, 0]))
    )


def _advance(order: int, step: float) -> np.ndarray:
    """Return the matrix that advances derivatives 0..order by a step, the last being constant."""
    ahead = np.subtract.outer(np.arange(order + 1), np.arange(order + 1)).T
    return np.array(
        [[step**j / factorial(j) if j >= 0 else 0.0 for j in row.tolist()] for row in ahead]
    )


class _Relation(NamedTuple):
    """What a motion of the joints misses of a virtual output that is wanted, as expressions.

    Attributes:
        derivatives: 0..r of the joints by rows, shape ((r + 1) N,).
        point: The manifold point.
        wanted: Derivatives 0..r of the output by rows, shape ((r + 1) m,).
        posture: Those of the posture reference, shape ((r + 1) N,).
        A: Decoupling matrix, shape (m, N).
        missing: What each derivative of the output misses, each (m,).
    """

    derivatives: ca.SX
    point: ca.SX
    wanted: ca.SX
    posture: ca.SX
    A: ca.SX
    missing: list[ca.SX]

    @classmethod
    def of(cls, robot: RobotModel, manifold: Manifold) -> "_Relation":
        """Return that of a robot on a manifold."""
        n, order = robot.dimension, manifold.layout.order
        m = len(manifold.coordinates)
        derivatives = ca.SX.sym("derivatives", (order + 1) * n)
        point, rate = ca.SX.sym("manifold_point", manifold.layout.size), ca.SX.sym("rate", n)
        wanted = ca.SX.sym("wanted", (order + 1) * m)
        posture = ca.SX.sym("posture", (order + 1) * n)
        q = ca.vertsplit(derivatives, n)

        def output(motion: list[ca.SX]) -> list:
            y, R_e = robot.tool_pose(joint_jets(motion))
            return manifold.virtual_output(y, R_e, point, [])

        found = output(q)
        slopes = ca.vertcat(*[y.coefficients[1] for y in output([q[0], rate])])
        missing = [
            y_p - ca.vertcat(*[y.derivative(k) for y in found])
            for k, y_p in enumerate(ca.vertsplit(wanted, m))
        ]
        return cls(derivatives, point, wanted, posture, ca.jacobian(slopes, rate), missing)

    def function(self, name: str, results: dict[str, ca.SX]) -> ca.Function:
        """Return results as a function of all symbols."""
        return ca.Function(
            name,
            [self.derivatives, self.point, self.wanted, self.posture],
            [ca.densify(e) for e in ca.cse(list(results.values()))],
            ["derivatives", "manifold_point", "wanted", "posture"],
            list(results),
        )


@once_per_content()
def _correction_function(
    robot: RobotModel,
    manifold: Manifold,
    inverse: DecouplingInverse,
    posture: Posture | None,
) -> ca.Function:
    """Return by what derivatives of joints are to change, if the virtual output is to be wanted.

    The columns of ``steps``, shape (N, r + 1), are corrections of each order of which those below
    are right; joints beyond the outputs move as little as they can. ``led``, shape (N,), is the
    one of order r by which they follow the posture. ``rcond`` and ``usable`` are those of
    :class:`DecouplingSolution`.
    """
    relation, n = _Relation.of(robot, manifold), robot.dimension
    A, still, led = relation.A, None, None
    if posture is not None:
        still = Spare(ca.SX(n, 1), posture.scale)
        q = ca.vertsplit(relation.derivatives, n)
        led = spare_of(posture, robot, q[:-1], relation.posture)._replace(restraint=None)
    steps = [inverse.solve(A, rhs, still) for rhs in relation.missing]
    last = inverse.solve(A, relation.missing[-1], led)
    results = {
        "steps": ca.horzcat(*[solution.x for solution in steps]),
        "led": last.x,
        "rcond": last.rcond,
        "usable": last.usable,
    }
    return relation.function("course", results)


@once_per_content()
def _restraint_function(
    robot: RobotModel, manifold: Manifold, inverse: DecouplingInverse, posture: Posture
) -> ca.Function:
    """Return ``shares`` of the speeds from which on a posture is held back, shape (N,)."""
    relation, n = _Relation.of(robot, manifold), robot.dimension
    q = ca.vertsplit(relation.derivatives, n)
    led = spare_of(posture, robot, q[:-1], relation.posture)
    restraint, A = led.restraint, relation.A
    assert restraint is not None and posture.speeds is not None
    # with the highest derivative of the joints left out
    rhs = relation.missing[-1] + A @ q[-1]
    x = inverse.solve(A, rhs, led._replace(restraint=None)).x
    rest = inverse.solve(A, rhs, Spare(restraint.rest, led.scale)).x
    taken = rest
    if restraint.velocity is not None:
        taken = inverse.solve(A, A @ restraint.velocity, Spare(ca.SX(n, 1), led.scale)).x
    speeds = ca.fabs(taken) + ca.fabs(x - rest) / restraint.settling
    return relation.function("restraint", {"shares": speeds / ca.DM(posture.speeds)})
