"""How joints move when a tool follows its reference exactly."""

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.law.decoupling import DecouplingInverse, Spare, scale_of
from pfsc_drake.control.law.posture import Posture, posture_expressions
from pfsc_drake.control.manifolds.manifold import PlaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function

# of a step of the joints [rad or m], below which a place is found; and how many steps are tried
_FOUND, _STEPS = 1e-9, 12
# of all derivatives, below which joints rest
_AT_REST = 1e-9
# finds the place on a manifold: (tool point, memory of the last place) -> manifold point
Projection = Callable[[np.ndarray, np.ndarray], np.ndarray]


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
    would let them do: their r-th derivative is the one next to the posture's wish, and what is
    integrated of it is corrected as little as the outputs allow.

    Args:
        robot: The robot as it is believed, N joints.
        manifold: What it follows; one that the tool is projected onto.
        projection: Finds the place on it.
        inverse: Inverts the decoupling matrix.
        posture: Of a robot with more joints than outputs.
    """

    def __init__(
        self,
        robot: RobotModel,
        manifold: PlaceManifold,
        projection: Projection,
        inverse: DecouplingInverse,
        posture: Posture | None = None,
    ) -> None:
        self._n, self._order = robot.dimension, manifold.layout.order
        self._memory, self._projection = manifold.layout.memory, projection
        self._inverse, self._posture = inverse, posture
        self._pose = BoundFunction(pose_function(robot))
        self._output = BoundFunction(_output_function(robot, manifold))
        self._wish = None
        if posture is not None:
            self._wish = BoundFunction(_wish_function(robot, posture, self._order))

    def find(
        self, start: CourseStart, reference: np.ndarray, times: np.ndarray, *, still: bool = False
    ) -> np.ndarray:
        """Return the joints' coordinates and derivatives 0..r, shape (samples, r + 1, N).

        Args:
            start: Where it begins.
            reference: Derivatives 0..r of the virtual output's reference, shape (samples, r + 1,
                m).
            times: Of the samples, evenly spaced [s], shape (samples,).
            still: Whether joints beyond the outputs only move with them, as little as they can.
                The posture's own motion needs samples as close as those of the law.

        Raises:
            InputError: If a place cannot be found, or is singular.
        """
        course = np.zeros((len(times), self._order + 1, self._n))
        q, memory = np.zeros((self._order + 1, self._n)), start.memory
        q[0], q_0 = start.q_J, start.q_J
        step = float(times[1] - times[0]) if len(times) > 1 else 0.0
        advance = _advance(self._order, step)
        for i in range(len(times)):
            if i == 0 or not _rests(q, reference[i - 1 : i + 1]):
                if i > 0:
                    q = advance @ q
                if still:
                    q[1:] = 0.0
                memory = self._correct(q, None if still else q_0, reference[i], memory)
            course[i] = q
        return course

    def _correct(
        self, q: np.ndarray, q_0: np.ndarray | None, wanted: np.ndarray, memory: np.ndarray
    ) -> np.ndarray:
        """Correct the derivatives in their place, and return the memory of the place found."""
        derivatives = self._output.arguments["derivatives"]
        Y, A = self._output.results["Y"], self._output.results["A"]
        outputs = wanted.shape[1]
        A = A.reshape((outputs, -1), order="F")
        Y = Y.reshape((-1, outputs))
        still, point = np.zeros(self._n), None
        scale = None if self._posture is None else self._posture.scale

        def solve(rhs: np.ndarray, spare: Spare) -> np.ndarray:
            solution = self._inverse.solve(A, rhs, None if self._wish is None else spare)
            if not self._inverse.accepts(solution):
                raise InputError(f"singular, reciprocal condition number {solution.rcond:.2g}")
            return solution.x

        for _ in range(_STEPS):
            self._pose.arguments["q"][:] = q[0]
            self._pose.evaluate()
            point = self._projection(self._pose.results["pose"][:3], memory)
            self._output.arguments["manifold_point"][:] = point
            derivatives[:] = q.ravel()
            self._output.evaluate()
            step = solve(wanted[0] - Y[0], Spare(still, scale))
            q[0] += step
            if not np.max(np.abs(step)) > _FOUND:
                break
        else:
            raise InputError("not reached")
        for k in range(1, self._order + 1):
            spare = Spare(still, scale)
            if k == self._order:
                q[k] = 0.0
                if q_0 is not None and self._wish is not None:
                    spare = self._spare(q, q_0, scale)
            derivatives[:] = q.ravel()
            self._output.evaluate()
            q[k] += solve(wanted[k] - Y[k], spare)
        return point[self._memory].copy()

    def _spare(self, q: np.ndarray, q_0: np.ndarray, scale: np.ndarray | None) -> Spare:
        """Return what the posture wishes of the r-th derivative."""
        wish = self._wish
        assert wish is not None
        wish.arguments["motion"][:] = q[:-1].ravel()
        wish.arguments["posture"][: self._n] = q_0
        wish.evaluate()
        results = wish.results
        if "weight" in results:
            scale = scale_of(results["weight"].reshape((self._n, -1)))
        if "slope" in results:
            return Spare(results["wish"], scale, results["slope"], results["rate"].item())
        return Spare(results["wish"], scale)


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


def _output_function(robot: RobotModel, manifold: PlaceManifold) -> ca.Function:
    """Return ``(derivatives, manifold_point) -> (Y, A)``, shapes ((r + 1) N,), (size,), (m, r + 1).

    ``Y`` holds derivatives 0..r of the virtual output in its columns.
    """
    n, order = robot.dimension, manifold.layout.order
    derivatives = ca.SX.sym("derivatives", (order + 1) * n)
    point, rate = ca.SX.sym("manifold_point", manifold.layout.size), ca.SX.sym("rate", n)
    q = ca.vertsplit(derivatives, n)

    def output(motion: list[ca.SX]) -> list:
        y, R_e = robot.tool_pose(joint_jets(motion))
        return manifold.virtual_output(y, R_e, point, [])

    found = output(q)
    Y = ca.horzcat(*[ca.vertcat(*[y.derivative(k) for y in found]) for k in range(order + 1)])
    slopes = ca.vertcat(*[y.coefficients[1] for y in output([q[0], rate])])
    return ca.Function(
        "course",
        [derivatives, point],
        [ca.densify(e) for e in ca.cse([Y, ca.jacobian(slopes, rate)])],
        ["derivatives", "manifold_point"],
        ["Y", "A"],
    )


def _wish_function(robot: RobotModel, posture: Posture, order: int) -> ca.Function:
    """Return ``(motion, posture) -> (wish, ..)``, see :func:`posture_expressions`."""
    n = robot.dimension
    motion, wanted = ca.SX.sym("motion", order * n), ca.SX.sym("posture", (order + 1) * n)
    wishes = posture_expressions(posture, robot, ca.vertsplit(motion, n), ca.vertsplit(wanted, n))
    results = {name: ca.densify(x) for name, x in wishes._asdict().items() if x.numel()}
    return ca.Function(
        "posture_wish",
        [motion, wanted],
        list(results.values()),
        ["motion", "posture"],
        list(results),
    )
