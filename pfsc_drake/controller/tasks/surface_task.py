"""Surface following: the tool converges to a surface and follows two coordinates on it."""

from collections.abc import Iterator, Sequence

import numpy as np

from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.surfaces.curvature import SurfaceTarget
from pfsc_drake.geometry.surfaces.length import parameters_along_motion
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.geometry.surfaces.regularity import surface_report
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator

# s, between the positions along the motion
_SPACING = 0.02
_MAX_ALPHA = 0.95


class SurfaceTask(Task):
    """Surface following (chapter 4).

    Args:
        surface: The surface.
        manifold: Its manifold, with the orientation of the tool.
        motion: Two tangential coordinates over time [m].
        quaternion: Orientation of the tool, if it is constant, shape (4,).
        theta: Surface parameters of the start; the middle of the domain if omitted.
        offset: Distance of the start along the normal [m].
        position: Tool point at the start [m], shape (3,), instead of both.
        rotation_deg: ZYX angles of the tool at the start from the surface's orientation [deg].
        max_alpha: End of the feasible neighbourhood, below 1.

    Attributes:
        surface: The surface.
        evaluator: Functions that find the closest point.

    Raises:
        InputError: If theta is outside the domain.
    """

    projector_name = "surface_projector"
    projected_manifold: SurfaceManifold
    motion: PiecewisePolynomialCurve

    def __init__(
        self,
        surface: Surface,
        manifold: SurfaceManifold,
        motion: PiecewisePolynomialCurve,
        quaternion: np.ndarray | None = None,
        *,
        theta: Sequence[float] = (),
        offset: float = 0.0,
        position: Sequence[float] = (),
        rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
        max_alpha: float = _MAX_ALPHA,
    ) -> None:
        self.surface, self.motion, self.warnings = surface, motion, []
        self.projected_manifold = self.manifold = manifold
        self.evaluator = SurfaceEvaluator(surface, manifold.layout.order, quaternion)
        self.shape = surface_report(surface)
        self._rotation_deg, self._max_alpha = rotation_deg, max_alpha
        if len(position):
            self.first = np.array(position, dtype=float)
            return
        middle = [sum(ends) / 2.0 for ends in surface.domain]
        try:
            point = self.evaluator.evaluate_at(list(theta) or middle)
        except InputError as error:
            raise InputError(f"start.theta: {error}") from None
        on_surface = point[manifold.layout.position][:3]
        self.first = on_surface + offset * manifold.axes(point).full()[:, 2]

    @property
    def projection_block(self) -> Projector:
        """Block that finds the closest point on the manifold."""
        return Projector(self.evaluator, np.append([0.0, 0.0], self._eta(0.0)))

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``projected_manifold`` closest to a tool, shape (size,)."""
        return self.evaluator(y_t.tolist(), memory)

    def _eta(self, time: float) -> np.ndarray:
        return self.motion.derivatives(np.array([time]), 0)[0, 0]

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return the start of the tool."""
        y_t, max_alpha = self.first + shift, self._max_alpha
        try:
            closest_point = self.evaluator.project_globally(y_t)
        except InputError as error:
            raise InputError(f"start: {error}") from None
        subject = f"start: tool point {np.round(y_t, 6).tolist()} m"
        if not (closest_point.converged and closest_point.alpha < max_alpha):
            raise InputError(
                f"{subject} is outside the feasible neighbourhood of the surface, "
                f"alpha = {closest_point.alpha:.3g}; alpha must be below {max_alpha:g}"
            )
        if closest_point.at_border:
            raise InputError(
                f"{subject} is beside the patch, {1e3 * closest_point.distance:.3g} mm from its "
                f"border at theta = {np.round(closest_point.theta, 6).tolist()}; it must be above "
                "or below it"
            )
        projection = np.append(closest_point.theta, self._eta(0.0))
        R_d = None
        if self.projected_manifold.is_oriented:
            R_d = self.projected_manifold.orientation(self.evaluate(y_t, projection)[None])[0]
        return StartPoint(self._target(y_t, R_d, self._rotation_deg), projection)

    def tool_positions(self) -> Iterator[tuple[np.ndarray, str]]:
        """Iterate over positions of the tool along its motion [m], each (3,), with their names.

        Raises:
            InputError: If the motion leaves the surface.
        """
        begin, end = self.motion.domain
        times = np.linspace(begin, end, 2 + int((end - begin) / _SPACING))
        first = self.start(np.zeros(3)).projection[:2]
        parameters = parameters_along_motion(self.surface, self.motion, first, times)
        for t, theta in zip(times, parameters, strict=True):
            where = f"eta = {np.round(self._eta(t), 4).tolist()} m"
            for k, ends in enumerate(self.surface.domain):
                closed = self.surface.closed[k]
                if not (closed or ends.begin <= theta[k] <= ends.end):
                    raise InputError(
                        f"reference: leaves the surface at {where}, theta_{k + 1} = "
                        f"{theta[k]:.6g}; the patch is from {ends.begin:.6g} to {ends.end:.6g}"
                    )
            yield self.surface.partials(theta, 0)[0], f"surface at {where}"

    @property
    def target(self) -> SurfaceTarget:
        """Map from coordinates ``(theta_1, theta_2, xi)`` to positions in the world."""
        return SurfaceTarget(self.surface)

    def check_coordinates(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold."""
        domain = self.surface.domain
        for value, ends, closed in zip(coordinates[:2], domain, self.surface.closed, strict=True):
            inside = closed or ends.begin <= value <= ends.end
            allowed = f"theta within {[list(ends) for ends in domain]}"
            require(inside, key, coordinates.tolist(), allowed)
