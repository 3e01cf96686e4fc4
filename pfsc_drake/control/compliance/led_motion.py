"""A tool that a hand leads along a path or a surface, as far as the robot can follow."""

import math
from typing import Any, Protocol

import numpy as np

from pfsc_drake.control.fixtures.program import MOST_LIMITS, GuidanceProgram, NearRegion
from pfsc_drake.control.fixtures.robot_limits import RobotLimits, limit_kinds, tightest
from pfsc_drake.control.fixtures.vectors import Vector
from pfsc_drake.control.manifolds.manifold import Kind, Manifold, indices

# below it a limit does not depend on the motion along the manifold
_ACROSS = 1e-6


class LeadingManifold(Manifold, Protocol):
    """A path or a surface."""

    def axes(self, point: Any) -> Any:
        """Return the axes at a point as columns, the tangential ones first, shape (3, 3)."""


class LedMotion:
    """What a robot can do, as limits of the motion along a path or a surface.

    With the directions t of the tangential coordinates, a limit ``n w >= -beta`` of the tool's
    velocity (:class:`RobotLimits`) is one of ``eta'``, ``(n t) eta' >= -beta``. Near the manifold
    ``y' = t eta'``; motion across it, which a position loop makes, goes on as measured.

    Args:
        limits: Of the tool's velocity.
        manifold: The path or surface.
        period: Sampling time [s].

    Attributes:
        point_size: Of the manifold's point.
        tangential: Which coordinates are tangential.
        kinds: What limits there are, see :func:`limit_kinds`, each once.
    """

    def __init__(
        self,
        limits: RobotLimits,
        manifold: LeadingManifold,
        period: float,
    ) -> None:
        self._limits, self._axes = limits, manifold.axes
        self.point_size = manifold.layout.size
        self.tangential = indices(manifold.coordinates, Kind.TANGENTIAL)
        self._count = self.tangential.stop - self.tangential.start
        self._program, self._n = GuidanceProgram(period), limits.num_joints
        self._every = limit_kinds(self._n)
        self.kinds = list(dict.fromkeys(self._every))

    @property
    def num_joints(self) -> int:
        """N."""
        return self._n

    def allowed(
        self, q: np.ndarray, v: np.ndarray, point: np.ndarray, wanted: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the motion next to a wanted one that the robot can follow.

        Args:
            q: Measured joint coordinates, shape (N,).
            v: Measured joint velocities, shape (N,).
            point: The manifold's point.
            wanted: ``eta'`` [m/s], shape (1,) or (2,).

        Returns:
            ``eta'``, and by how much of each kind of limit it is held [m/s^2], shape (kinds,).
        """
        held = np.zeros(len(self.kinds))
        t, w = self._axes(point).full()[:, : self._count], wanted.copy()
        if not math.isfinite(float(t.sum()) + float(w.sum())):
            return w, held
        along = [_along(limit, t) for limit in self._limits.rows(q, v, 0)]
        target = [*w.tolist(), 0.0, 0.0][:3]
        near = tightest([limit for limit in along if limit is not None], target, MOST_LIMITS)
        solution = self._program.solve(1.0, target, near)
        for limit, force in zip(near, solution.forces, strict=True):
            held[self.kinds.index(self._every[limit.number])] += force
        return np.array(solution.velocity[: self._count]), held


def _along(limit: NearRegion, t: np.ndarray) -> NearRegion | None:
    """Return a limit of the motion along axes t, None if that does not matter to it."""
    row = [*(np.array(limit.n) @ t).tolist(), 0.0, 0.0]
    size = math.hypot(*row)
    if size < _ACROSS:
        return None
    n: Vector = (row[0] / size, row[1] / size, row[2] / size)
    return limit._replace(n=n, beta=limit.beta / size)
