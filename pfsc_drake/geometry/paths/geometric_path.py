"""Path of positions and orientations, and a point that moves beside it."""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.frame import Frame, ParallelTransportFrame, manifold_axes
from pfsc_drake.geometry.paths.path_evaluator import PathEvaluator

_IRREGULAR = 1e-6
_SUSPICIOUS = 0.2
_SAMPLES_PER_SEGMENT = 64


class PathWaypoints(NamedTuple):
    """Waypoints of a path.

    Attributes:
        positions: Waypoints [n, 3], m; the last may repeat the first.
        parameters: theta of each, or of the path's closest point, [n].
        manner: Whether the path passes through them, or near them by smoothing or rounding.
    """

    positions: np.ndarray
    parameters: np.ndarray
    manner: Literal["interpolated", "smoothed", "rounded"]


class Path:
    """Path gamma of section 3.1: position sigma_t(theta) and orientation sigma_r(theta).

    Args:
        position: Regular curve in R^3, m.
        orientation: Quaternions over the same parameter, or None for arms that only
            position. Closed if `position` is, with a period of one or two revolutions.
        initial_normal: e_perp at the begin of the path, [3], see `ParallelTransportFrame`.
        frame: Frame along the path; one of parallel transport by default.
        waypoints: Waypoints of the path, if it has some.
        notes: Sentences on ignored parts of a file.

    Attributes:
        position: The curve sigma_t.
        orientation: The curve of quaternions, or None.
        arc_length: Arc length of `position`.
        frame: Frame along `position`.
        waypoints: Waypoints of the path, or None.
        notes: Sentences on ignored parts of a file.

    Raises:
        InputError: the position is not a regular curve in R^3, or the orientation does not
            cover its domain.
    """

    def __init__(
        self,
        position: Curve,
        orientation: OrientationCurve | None = None,
        *,
        initial_normal: ArrayLike | None = None,
        frame: Frame | None = None,
        waypoints: PathWaypoints | None = None,
        notes: tuple[str, ...] = (),
    ) -> None:
        if position.dimension != 3:
            raise InputError(f"path: curve of dimension {position.dimension}; 3 is required")
        _check_regular(position)
        if orientation is not None:
            _check_domains(position, orientation)
        self.position = position
        self.orientation = orientation
        self.waypoints = waypoints
        self.notes = notes
        self.arc_length = ArcLength(position)
        self.frame = frame or ParallelTransportFrame(position, initial_normal)
        self._evaluators: dict[int, PathEvaluator] = {}

    def __content__(self) -> object:
        """Return all objects that the path depends on."""
        return self.position, self.orientation, self.frame, self.waypoints

    @property
    def closed(self) -> bool:
        """True if the path is closed."""
        return self.position.closed

    @property
    def length(self) -> float:
        """Length of the path (of one revolution), m."""
        return self.arc_length.length

    def require_smoothness(self, k: int, purpose: str) -> None:
        """Refuse a path that is not smooth enough for its use.

        A law of relative degree r needs sigma_t of class C^(r + 1) and the orientation of
        class C^r, one less.

        Args:
            k: Class C^k needed of the position; the orientation needs C^(k - 1).
            purpose: Use that needs it, for the message.

        Raises:
            InputError: a derivative of too low an order jumps.
        """
        parts: list[tuple[str, Curve | None, int]] = [
            ("position", self.position, k),
            ("orientation", self.orientation, k - 1),
        ]
        for name, curve, needed in parts:
            if curve is None or curve.smoothness >= needed:
                continue
            theta = curve.first_discontinuity(needed)
            where = "" if theta is None else f" (a derivative jumps at theta = {theta:.6g})"
            raise InputError(
                f"path: {name} is of class C^{curve.smoothness:.0f}{where};"
                f" C^{needed} or better is required for {purpose}"
            )

    def evaluator(self, order: int) -> PathEvaluator:
        """Return the evaluator that a law calls at each tick, created once for every order.

        Args:
            order: Relative degree r of the law, 1..5.

        Returns:
            Function of (point, theta_guess), see `PathEvaluator`.

        Raises:
            InputError: order out of range.
        """
        if order not in self._evaluators:
            self._evaluators[order] = PathEvaluator(
                self.position, self.orientation, self.arc_length, self.frame, order
            )
        return self._evaluators[order]

    def nearest(self, point: ArrayLike) -> float:
        """Return the parameter of the path's point that is nearest to a point, [3], m."""
        return float(self.evaluator(1).find(np.asarray(point, dtype=float)))

    def pose(self, eta: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the reference pose at an arc length.

        Args:
            eta: Arc length, m. Beyond an end of an open path the position is extended along
                the tangent and the orientation is constant.

        Returns:
            Position [3], m, and rotation matrix [3, 3], or None without orientation.

        Raises:
            InputError: eta is not finite.
        """
        beyond = 0.0
        if not self.closed and math.isfinite(eta):
            beyond = eta - min(max(eta, 0.0), self.length)
        theta = self.arc_length.parameter(eta - beyond)
        sigma, tangent = self.position.derivatives(theta, 1)
        position = sigma + beyond * tangent / np.linalg.norm(tangent)
        if self.orientation is None:
            return position, None
        return position, self.orientation.rotation_matrix(theta)


def _check_regular(curve: Curve) -> None:
    """Refuse a curve whose derivative vanishes somewhere (section 3.1)."""
    grid = np.linspace(curve.breakpoints[:-1], curve.breakpoints[1:], _SAMPLES_PER_SEGMENT, axis=1)

    def speed(theta: ArrayLike) -> np.ndarray:
        return np.linalg.norm(curve.derivatives(theta, 1)[..., 1, :], axis=-1)

    speeds = speed(grid)
    mean = float(np.average(speeds.mean(axis=1), weights=np.diff(curve.breakpoints)))
    found = [(float(speeds.min()), float(grid.flat[np.argmin(speeds)]))]
    lower_left = np.pad(speeds[:, :-1], ((0, 0), (1, 0)), constant_values=np.inf) >= speeds
    lower_right = np.pad(speeds[:, 1:], ((0, 0), (0, 1)), constant_values=np.inf) >= speeds
    for s, i in np.argwhere(lower_left & lower_right & (speeds < _SUSPICIOUS * mean)):
        bounds = (grid[s, max(i - 1, 0)], grid[s, min(i + 1, grid.shape[1] - 1)])
        best = minimize_scalar(
            lambda theta: float(speed(theta)) ** 2,
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-12 * (bounds[1] - bounds[0])},
        )
        found.append((math.sqrt(best.fun), float(best.x)))
    lowest, theta = min(found)
    if not lowest > _IRREGULAR * mean:
        raise InputError(
            f"path: |sigma'| = {lowest:.3g} at theta = {theta:.6g}, mean {mean:.3g};"
            f" a regular curve needs more than {_IRREGULAR:g} of the mean"
        )


def _check_domains(position: Curve, orientation: OrientationCurve) -> None:
    """Refuse an orientation that is not defined wherever the position is."""
    begin, end = position.domain
    first, last = orientation.domain
    slack = 1e-9 * (end - begin)
    if orientation.constant:
        return
    if position.closed != orientation.closed:
        words = {True: "closed", False: "open"}
        raise InputError(
            f"path: position is {words[position.closed]}, orientation {words[orientation.closed]};"
            " both must be of the same kind"
        )
    revolutions = round(orientation.period / position.period)
    if position.closed:
        fits = abs(first - begin) <= slack and revolutions in (1, 2)
        fits = fits and abs(orientation.period - revolutions * position.period) <= slack
    else:
        fits = first <= begin + slack and last >= end - slack
    if not fits:
        raise InputError(
            f"path: orientation on theta = [{first:.9g}, {last:.9g}];"
            f" the position has [{begin:.9g}, {end:.9g}]"
        )


class PathTarget:
    """The point with path coordinates ``(eta, xi_1, xi_2)``, and its velocity.

    ``p = sigma + xi_1 e_perp + xi_2 e_cross`` at the arc length eta; with the curvature vector
    ``k = d e_par / d eta`` and a parallel transport frame, which does not spin about the path::

        p' = e_par eta' (1 - xi_1 k . e_perp - xi_2 k . e_cross) + xi_1' e_perp + xi_2' e_cross

    A prescribed frame, which turns by ``w = d psi / d eta``, adds
    ``w eta' (xi_1 e_cross - xi_2 e_perp)``.

    Args:
        path: The path. Beyond the ends of an open path eta is clamped.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._evaluator = path, path.evaluator(1)
        self._layout = self._evaluator.layout

    def __call__(self, coordinates: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return p [m] and p' [m/s], world axes, shape (3,) each.

        Args:
            coordinates: ``(eta, xi_1, xi_2)`` [m], shape (3,).
            rates: Their derivatives [m/s], shape (3,).
        """
        eta, xi = float(coordinates[0]), coordinates[1:]
        if not self._path.closed:
            eta = min(max(eta, 0.0), self._path.length)
        point = self._evaluator.evaluate_at(self._path.arc_length.parameter(eta))
        sigma, slope, bend = point[self._layout.position].reshape(-1, 3)
        axes = manifold_axes(slope, point[self._layout.normal])
        e_par, normals = axes[:, 0], axes[:, 1:]
        curvature = (bend - e_par * (e_par @ bend)) / (slope @ slope)
        along = rates[0] * (1.0 - xi @ (normals.T @ curvature))
        across = rates[1:]
        if self._layout.turning:
            spin = point[self._layout.turn][0] / np.linalg.norm(slope)
            across = across + rates[0] * spin * np.array([-xi[1], xi[0]])
        return sigma + normals @ xi, along * e_par + normals @ across
