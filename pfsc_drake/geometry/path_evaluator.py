"""What a path tells the controller at each tick."""

import math
from collections.abc import Sequence

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.arc_length import ArcLength
from pfsc_drake.geometry.curve import Curve
from pfsc_drake.geometry.frame import ParallelTransportFrame
from pfsc_drake.geometry.orientation import OrientationCurve
from pfsc_drake.geometry.path_point import PathPointLayout, PathStatus
from pfsc_drake.geometry.projection import Projector

_OK = float(PathStatus.OK)
_BEYOND_END = float(PathStatus.BEYOND_END)
_NOT_CONVERGED = float(PathStatus.NOT_CONVERGED)


class PathEvaluator:
    """Projects a point on a path and evaluates everything a law of one order needs there.

    It has no memory: the same input gives the same output. `Path.evaluator` makes it.

    Args:
        position: Curve sigma_t in R^3.
        orientation: Curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Parallel transport frame of `position`.
        projector: Projector onto `position`.
        order: Relative degree r of the law.

    Attributes:
        layout: Where the quantities lie in the arrays returned.
    """

    def __init__(
        self,
        position: Curve,
        orientation: OrientationCurve | None,
        arc_length: ArcLength,
        frame: ParallelTransportFrame,
        projector: Projector,
        order: int,
    ) -> None:
        self.layout = PathPointLayout(order, orientation is not None)
        self._position = position.flat_sampler(order + 1)
        self._orientation = orientation.flat_sampler(order) if orientation is not None else None
        self._domain, self._closed = position.domain, position.closed
        self._arc_length = arc_length.at
        self._normal = frame.normal_at
        self._project = projector.project
        self._size = self.layout.size
        self._position_end = self.layout.position.stop

    def __call__(self, point: Sequence[float], theta_guess: float) -> np.ndarray:
        """Path quantities at the projection of a point.

        Args:
            point: y_t, [3], m. A list or tuple of floats is faster than an array.
            theta_guess: Unwrapped parameter of the last tick.

        Returns:
            New array [layout.size], see `PathPointLayout`. All its values but `status` are
            NaN if the point or the guess is not finite.
        """
        theta, alpha, at_end, _, converged = self._project(point, theta_guess)
        if alpha != alpha:
            out = np.full(self._size, math.nan)
            out[3] = _NOT_CONVERGED
            return out
        if not at_end:
            return self._fill(theta, alpha, _OK if converged else _NOT_CONVERGED)
        out = self._fill(theta, 0.0, _BEYOND_END)
        out[13 : self._position_end] = 0.0
        out[self._position_end + 4 :] = 0.0
        x, y, z, dx, dy, dz = out[7:13].tolist()
        along = (point[0] - x) * dx + (point[1] - y) * dy + (point[2] - z) * dz
        out[1] += along / math.sqrt(dx * dx + dy * dy + dz * dz)
        return out

    def evaluate_at(self, theta: float) -> np.ndarray:
        """Path quantities at a point on the path, for set-up.

        Args:
            theta: Unwrapped parameter.

        Returns:
            New array [layout.size], with alpha zero.

        Raises:
            InputError: theta is not finite or lies outside the domain of an open path.
        """
        begin, end = self._domain
        if not math.isfinite(theta) or (not self._closed and not begin <= theta <= end):
            raise InputError(f"theta: {theta:.9g}; the path is defined on [{begin:.9g}, {end:.9g}]")
        return self._fill(float(theta), 0.0, _OK)

    def _fill(self, theta: float, alpha: float, status: float) -> np.ndarray:
        position = self._position(theta)
        dx, dy, dz = position[3:6].tolist()
        scale = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        x, y, z = self._normal(theta, (dx * scale, dy * scale, dz * scale))
        out = np.empty(self._size)
        out[:7] = (theta, self._arc_length(theta), alpha, status, x, y, z)
        out[7 : self._position_end] = position
        if self._orientation is not None:
            out[self._position_end :] = self._orientation(theta)
        return out
