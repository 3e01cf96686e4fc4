"""Following a surface: the tool converges to it, and moves along it as two coordinates say."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario import (
    ControllerParameters,
    ReferenceParameters,
    StartParameters,
    SurfaceParameters,
)
from diagrams.scenario.checks import require, require_numbers
from diagrams.tasks.drawing import SurfaceDrawing
from diagrams.tasks.task import StartPoint, Task
from diagrams.tasks.task_geometry import make_surface, make_surface_manifold, require_joints
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.reference import straight_lines, together
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.path_warnings import euler_warnings
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.surfaces.curvature import SurfaceTarget
from pfsc_drake.geometry.surfaces.length import way_on_surface
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport, surface_report
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator
from pfsc_drake.robot.inverse_kinematics import ToolTarget

# s, between the places of the way along the surface
_SPACING = 0.02


class SurfaceTask(Task):
    """Surface following (chapter 4).

    Args:
        parameters: The surface; it must be given.
        controller: The controller; its law decides how smooth the surface must be.
        reference: The motion over the surface.
        start: Where the tool starts.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If the surface or the motion along it cannot be made.
    """

    projector_name = "surface_projector"
    place: SurfaceManifold
    manifold: SurfaceManifold

    def __init__(
        self,
        parameters: SurfaceParameters | None,
        controller: ControllerParameters,
        reference: ReferenceParameters,
        start: StartParameters,
        folder: FilePath,
        progress: Progress | None = None,
    ) -> None:
        self._start_parameters, self._max_alpha, law = start, controller.max_alpha, controller.law
        if parameters is None:
            raise InputError(
                "controller.manifold = surface: there is none; write surface: {shape: !Plane {..}}"
            )
        try:
            made = make_surface(parameters.shape, law, folder, progress)
        except InputError as error:
            raise InputError(f"surface.shape: {error}") from None
        self.surface, self.fit = made.surface, made.fit
        self.relative_degree = RELATIVE_DEGREE[law]
        self._is_normal = parameters.orientation.kind == "normal"
        self.place = make_surface_manifold(self.relative_degree, parameters)
        self.manifold = self.place
        self._evaluator = SurfaceEvaluator(
            self.surface, self.relative_degree, parameters.orientation.quaternion
        )
        self.shape: SurfaceReport = surface_report(self.surface)
        self.warnings = list(made.notes)
        self.motion = _motion(reference)
        self._start = self._find_start()
        self.warnings += self._euler_warnings()

    def require_joints(self, num_joints: int) -> None:
        """Refuse a robot that cannot follow, or would lose its orientation by oversight."""
        require_joints(self.manifold, num_joints)

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of the true place's manifold next to a tool, shape (size,)."""
        return self._evaluator(y_t.tolist(), memory)

    @property
    def evaluator(self) -> SurfaceEvaluator:
        """What finds places on the true place's manifold."""
        return self._evaluator

    @property
    def drawing(self) -> SurfaceDrawing:
        """How the manifold is drawn."""
        return SurfaceDrawing(self.surface, self.place)

    def _find_start(self) -> np.ndarray:
        """Return the tool point at the start [m], shape (3,)."""
        start = self._start_parameters
        if start.position:
            return np.array(start.position, dtype=float)
        theta = [sum(ends) / 2.0 for ends in self.surface.domain]
        if start.theta:
            require_numbers("start.theta", start.theta, 2)
            theta = start.theta
        try:
            point = self._evaluator.evaluate_at(theta)
        except InputError as error:
            raise InputError(f"start.theta: {error}") from None
        position = point[self.place.layout.position][:3]
        return position + start.offset[0] * self.place.axes(point).full()[:, 2]

    def _euler_warnings(self) -> list[str]:
        """Return :func:`euler_warnings` of the orientation where the tool starts."""
        if self.place.tool.euler is None:
            return []
        try:
            foot = self._evaluator.project_globally(self._start)
            point = self._evaluator.evaluate_at(foot.theta)
        except InputError:  # which is told when the start is looked for
            return []
        R_d = self.place.orientation(point[None])
        return euler_warnings(self.place.tool.euler, R_d, "surface", lambda _: "at the start")

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts."""
        y_t, max_alpha = self._start + shift, self._max_alpha
        try:
            foot = self._evaluator.project_globally(y_t)
        except InputError as error:
            raise InputError(f"start: {error}") from None
        said = f"start: tool point {np.round(y_t, 6).tolist()} m"
        if not (foot.converged and foot.alpha < max_alpha):
            raise InputError(
                f"{said} is outside the feasible neighbourhood of the surface, "
                f"alpha = {foot.alpha:.3g}; alpha must be below {max_alpha:g}"
            )
        if foot.at_border:
            raise InputError(
                f"{said} is beside the patch, {1e3 * foot.distance:.3g} mm from its border at "
                f"theta = {np.round(foot.theta, 6).tolist()}; it must be above or below it"
            )
        eta = self.motion.derivatives(np.zeros(1), 0)[0, 0]
        place = np.append(foot.theta, eta)
        R_d = None
        if self.place.is_oriented:
            R_d = self.place.orientation(self.evaluate(y_t, place)[None])[0]
        target = self._tool_target(y_t, R_d, self._start_parameters.rotation_deg)
        return StartPoint(target, place)

    def inverted(self, start: StartPoint) -> tuple[ToolTarget, str] | None:
        """Return what a start may have been meant to be, and how to say so."""
        R_e = start.target.R_e
        if not self._is_normal or R_e is None:
            return None
        axes = self.place.axes(self.point(start)).full()
        # the tangent stays, which leaves the frame right-handed
        turned = axes @ np.diag([1.0, -1.0, -1.0]) @ axes.T @ R_e
        advice = (
            f"with the normal {np.round(axes[:, 2], 3).tolist()} inverted it is within reach: let "
            "the shape's axis, inward or seen_from turn the normal over, or "
            "surface.orientation.angles_deg the tool"
        )
        return replace(start.target, R_e=turned), advice

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start."""
        return self.evaluate(start.target.y_t, start.place)

    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions along the way of the tool [m], each (3,), with what to call them.

        The way of the reference over the surface must stay on it.
        """
        begin, end = self.motion.domain
        times = np.linspace(begin, end, 2 + int((end - begin) / _SPACING))
        first = self.start(np.zeros(3)).place[:2]
        way = way_on_surface(self.surface, self.motion, first, times)
        for t, theta in zip(times, way, strict=True):
            eta = self.motion.derivatives(np.array([t]), 0)[0, 0]
            where = f"eta = {np.round(eta, 4).tolist()} m"
            for k, ends in enumerate(self.surface.domain):
                closed = self.surface.closed[k]
                if not (closed or ends.begin <= theta[k] <= ends.end):
                    raise InputError(
                        f"reference: leaves the surface at {where}, theta_{k + 1} = "
                        f"{theta[k]:.6g}; the patch is from {ends.begin:.6g} to {ends.end:.6g}"
                    )
            yield self.surface.partials(theta, 0)[0], f"surface at {where}"

    def target(self) -> SurfaceTarget:
        """Return where given coordinates of the manifold are in the world.

        Coordinates are ``(theta_1, theta_2, xi)``.
        """
        return SurfaceTarget(self.surface)

    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold."""
        for value, ends, closed in zip(
            coordinates[:2], self.surface.domain, self.surface.closed, strict=True
        ):
            inside = closed or ends.begin <= value <= ends.end
            allowed = f"theta within {[list(ends) for ends in self.surface.domain]}"
            require(inside, key, coordinates.tolist(), allowed)


def _motion(reference: ReferenceParameters) -> PiecewisePolynomialCurve:
    """Return the tangential references over time, of dimension 2."""
    limits = (reference.largest_velocity, reference.acceleration, reference.dwell)
    if reference.places:
        return straight_lines(reference.places, *limits)
    if reference.second is None:
        raise InputError(
            "reference: a surface has two coordinates; write reference.places: "
            "[[eta_1, eta_2], ..] (m), or reference.second: {points, velocity, acceleration}"
        )
    return together(
        (reference.arc_lengths(None), *limits),
        (
            reference.second.points,
            reference.second.velocity,
            reference.second.acceleration,
            reference.dwell,
        ),
    )
