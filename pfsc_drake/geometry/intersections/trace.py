"""Tracing of an edge of two surfaces from a point on it."""

import math
from typing import NamedTuple

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.intersections.meeting import Meeting, numbers

# rad: largest turn of the tangent from one node to the next, and the desired one.
_MOST_TURN, _USUAL_TURN = 0.2, 0.1
# Of the size of the smaller surface: longest, first and shortest step.
_LONGEST, _FIRST, _SHORTEST = 1.0 / 24.0, 1e-3, 1e-7
# Sine of the angle between the surfaces below which they touch.
TOUCHING = 1e-4
# Of the size: shorter steps are not checked for an edge that leaves and comes back.
_GRAZING = 1e-4
_BETWEEN = np.linspace(0.0, 1.0, 12)[1:-1, None]
_MOST_NODES, _ATTEMPTS = 20_000, 6
# Of a neighbouring step: steps that make no piece of their own.
_TINY = 0.03
_ITERATIONS = 10
# Of the lengths of the domain: negligible steps, and distances beyond an end that count as on it.
_SETTLED, _SAME_SHARE = 1e-13, 1e-9


class Trace(NamedTuple):
    """Nodes along an edge.

    Attributes:
        theta: Parameters of both surfaces, not wrapped, [n, 4].
        is_closed: Whether a step leads from the last node to the first.
    """

    theta: np.ndarray
    is_closed: bool


class _Node(NamedTuple):
    theta: np.ndarray
    point: np.ndarray
    tangent: np.ndarray
    steps: np.ndarray  # of the parameters per length along the edge, [4]


class Tracer:
    """Predictor-corrector tracing of the edge of two surfaces along ``n_1 x n_2``.

    A step along the tangent over which it turns by 0.1 rad, then Newton's method within the plane
    across it. Tracing ends at its start, or at the border of a surface.

    Args:
        meeting: Two surfaces of class C^2.
    """

    def __init__(self, meeting: Meeting) -> None:
        self._meeting = meeting
        first, second = meeting.surfaces
        self._samplers = (first.flat_sampler(1), second.flat_sampler(1))
        self._open = np.flatnonzero(~meeting.closed).tolist()

    def trace(self, theta: np.ndarray) -> Trace:
        """Return the nodes of the whole edge.

        Args:
            theta: Parameters of a point on it, [4].

        Raises:
            InputError: The surfaces touch on it, or it is too long and too bent.
        """
        start = self._node(theta)
        longest = _LONGEST * self._meeting.size
        for _ in range(_ATTEMPTS):
            nodes, is_closed = self._go(start, 1.0, longest)
            back_again = False
            if not is_closed:
                backward, back_again = self._go(start, -1.0, longest)
                nodes = [*backward[:0:-1], *nodes]
            if not back_again:
                return Trace(self._without_tiny_steps(np.array(nodes), is_closed), is_closed)
            longest *= 0.25  # it stepped over the end of the other direction
        raise InputError(
            f"surfaces: their edge runs along the border of one of them near"
            f" {numbers(start.point)}; larger or smaller bounds are required"
        )

    def _without_tiny_steps(self, theta: np.ndarray, is_closed: bool) -> np.ndarray:
        """Return the nodes without those very close to another, at an end or a closure."""
        points = self._meeting.partials(theta, 0)[0, :, 0]
        keep = np.ones(len(theta), dtype=bool)
        steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
        count = len(steps) if is_closed else len(steps) - 1
        for k in range(count):
            longest = max(steps[(k - 1) % count], steps[(k + 1) % count])
            if steps[k] < _TINY * longest and keep[k]:
                keep[k if k > 0 else 1] = False
        return theta[keep]

    def _node(self, theta: np.ndarray) -> _Node:
        """Return the tangent and parameter rates at a point of the edge."""
        p, s_1, s_2, n = self._tangents(0, theta)
        _, r_1, r_2, m = self._tangents(1, theta)
        cross = np.cross(n / np.linalg.norm(n), m / np.linalg.norm(m))
        sine = float(np.linalg.norm(cross))
        if not sine > TOUCHING:
            raise self._touching(p)
        t = cross / sine
        steps = np.array([np.cross(t, s_2) @ n, np.cross(s_1, t) @ n, 0.0, 0.0])
        steps[:2] /= n @ n
        steps[2:] = np.array([np.cross(t, r_2) @ m, np.cross(r_1, t) @ m]) / (m @ m)
        return _Node(np.array(theta), p, t, steps)

    def _tangents(
        self, k: int, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        rows = self._samplers[k](float(theta[2 * k]), float(theta[2 * k + 1])).reshape(3, 3)
        return rows[0], rows[1], rows[2], np.cross(rows[1], rows[2])

    def _go(self, start: _Node, sign: float, longest: float) -> tuple[list[np.ndarray], bool]:
        """Return the nodes from the start on, and whether they came back to it."""
        size = self._meeting.size
        nodes, here, step = [start.theta], start, _FIRST * size
        left = False
        while len(nodes) < _MOST_NODES:
            there = self._next_node(here, sign * step)
            turn = math.inf
            if there is not None:
                turn = math.acos(min(1.0, max(-1.0, float(here.tangent @ there.tangent))))
            if there is None or turn > _MOST_TURN:
                step *= 0.5
                if step < _SHORTEST * size:
                    raise self._touching(here.point)
                continue
            before, after = (
                sign * float((node.point - start.point) @ start.tangent) for node in (here, there)
            )
            near = np.linalg.norm(there.point - start.point) < 1.5 * step
            if left and near and before < 0.0 <= after and there.tangent @ start.tangent > 0.0:
                return nodes, True
            left = left or not near
            if not self._holds(there.theta):
                border = self._border(here.theta, there.theta)
                if border is None and step > _SHORTEST * size:
                    step *= 0.5  # two ends at once, or out and in again
                    continue
                return [*nodes, *([] if border is None else [border])], False
            if step > _GRAZING * size and self._leaves(here, there, sign * step):
                step *= 0.5
                continue
            nodes.append(there.theta)
            here = there
            step = min(longest, step * min(2.0, _USUAL_TURN / max(turn, 1e-9)))
        raise InputError(
            f"surfaces: their edge needs more than {_MOST_NODES} nodes, near {numbers(here.point)};"
            " smoother or smaller surfaces are required"
        )

    def _next_node(self, node: _Node, distance: float) -> _Node | None:
        """Return the node a distance further along the tangent, or None."""
        goal = node.point + distance * node.tangent
        theta = self._solve(node.theta + distance * node.steps, plane=(goal, node.tangent))
        return None if theta is None else self._node(theta)

    def _border(self, here: np.ndarray, there: np.ndarray) -> np.ndarray | None:
        """Return where the edge leaves a surface between two nodes, or None if undetermined."""
        begin, end = self._meeting.begin, self._meeting.end
        outside = [k for k in self._open if not begin[k] <= there[k] <= end[k]]
        crossings = []
        for k in outside:
            value = float(begin[k] if there[k] < begin[k] else end[k])
            share = (value - here[k]) / (there[k] - here[k])
            crossings.append((share, k, value))
        for share, k, value in sorted(crossings):
            theta = self._solve(here + share * (there - here), fixed=(k, value))
            if theta is None:
                continue
            within = self._meeting.inside(theta[None])[0]
            if np.abs((within - theta) / self._meeting.lengths).max() < _SAME_SHARE:
                return within
        return None

    def _leaves(self, here: _Node, there: _Node, distance: float) -> bool:
        """Return whether the edge is out of bounds between two nodes within, by cubics."""
        k, s = self._open, _BETWEEN
        slope, last = distance * here.steps[k], distance * there.steps[k]
        rise = (there.theta - here.theta)[k]
        theta = here.theta[k] + s * (
            slope + s * (3.0 * rise - 2.0 * slope - last + s * (slope + last - 2.0 * rise))
        )
        beyond = np.maximum(self._meeting.begin[k] - theta, theta - self._meeting.end[k])
        return bool(np.any(beyond > _SAME_SHARE * self._meeting.lengths[k]))

    def _holds(self, theta: np.ndarray) -> bool:
        """Return whether a point is within the bounds of both surfaces."""
        return bool(np.all(self._meeting.inside(theta[None])[0] == theta))

    def _solve(
        self,
        theta: np.ndarray,
        *,
        plane: tuple[np.ndarray, np.ndarray] | None = None,
        fixed: tuple[int, float] | None = None,
    ) -> np.ndarray | None:
        """Return parameters where the surfaces meet in a plane or at a fixed parameter, or None."""
        theta, J, r = np.array(theta), np.zeros((4, 4)), np.zeros(4)
        for _ in range(_ITERATIONS):
            p, s_1, s_2, _ = self._tangents(0, theta)
            q, r_1, r_2, _ = self._tangents(1, theta)
            J[:3] = np.column_stack([s_1, s_2, -r_1, -r_2])
            r[:3] = p - q
            J[3] = 0.0
            if plane is not None:
                r[3] = plane[1] @ (p - plane[0])
                J[3, :2] = plane[1] @ s_1, plane[1] @ s_2
            elif fixed is not None:
                J[3, fixed[0]], r[3] = 1.0, theta[fixed[0]] - fixed[1]
            try:
                step = np.linalg.solve(J, r)
            except np.linalg.LinAlgError:
                return None
            if not np.abs(step / self._meeting.lengths).max() < 0.5:
                return None
            theta = theta - step
            if np.abs(step / self._meeting.lengths).max() < _SETTLED:
                break
        if fixed is not None:
            theta[fixed[0]] = fixed[1]
        p, q = self._tangents(0, theta)[0], self._tangents(1, theta)[0]
        return theta if np.linalg.norm(p - q) < 1e-10 * self._meeting.size else None

    def _touching(self, point: np.ndarray) -> InputError:
        return InputError(
            f"surfaces: touch at {numbers(point)} instead of crossing each other; an edge is where "
            "their normals differ"
        )
