"""The task of a scenario."""

from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario import OrientationParameters, ReferenceParameters, Scenario, Streamed
from diagrams.scenario.virtual_fixtures import FixtureParameters
from diagrams.tasks.regions_and_guides import make_fixtures, make_guides
from diagrams.tasks.streaming import stream_task
from diagrams.tasks.task_geometry import (
    followed_angles,
    make_path,
    make_path_on_surface,
    make_surface,
    make_surface_manifold,
    require_joints,
    require_orientation,
    surface_of_path,
)
from pfsc_drake.checks import require, require_numbers
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.reference import rest_to_rest, straight_lines, together
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.controller.fixtures import free_motion, make_command_dynamics
from pfsc_drake.controller.tasks.path_task import PathTask, is_on
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.controller.tasks.stream_task import StreamTask
from pfsc_drake.controller.tasks.surface_task import SurfaceTask
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path, PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.path_warnings import closing_gap, euler_warnings, path_warnings
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters
from pfsc_drake.robot.inverse_kinematics import ToolTarget

_ORIENTATIONS = 1001
_LOOKS_CLOSED = "; it ends where it starts: if it is to go round, write path.shape.closed: true"


def make_task(scenario: Scenario, folder: FilePath, progress: Progress | None = None) -> Task:
    """Return the task of a scenario's tool.

    Args:
        scenario: The scenario.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If the manifold or the motion along it cannot be created, or regions have no
            effect.
    """
    manifold, chosen = scenario.controller.manifold, _ScenarioTasks(scenario, folder, progress)
    if manifold == "space":
        return chosen.space_task()
    for key, why in {"regions": "kept out of regions", "guides": "pulled to guides"}.items():
        items = getattr(scenario.fixtures, key, [])
        allowed = (
            f"none with controller.manifold = {manifold}; only a tool guided through space is {why}"
        )
        require(not items, f"fixtures.{key}", f"{len(items)} given", allowed)
    if manifold == "surface":
        return chosen.surface_task()
    if isinstance(scenario.path.shape, Streamed):
        allowed = "path where waypoints come while the tool moves"
        require(manifold == "path", "controller.manifold", manifold, allowed)
        known = scenario.path, scenario.controller, scenario.start, scenario.duration
        return stream_task(*known, folder)
    return chosen.path_task()


@dataclass
class _ScenarioTasks:
    """A scenario, the folder of its files, and the display of progress."""

    scenario: Scenario
    folder: FilePath
    progress: Progress | None

    def path_task(self) -> PathTask:
        """Return the task of a tool on a path."""
        scenario, folder, progress = self.scenario, self.folder, self.progress
        parameters, law, start = scenario.path, scenario.controller.law, scenario.start
        surface = surface_of_path(parameters, scenario.surface)
        orientation: OrientationParameters | SurfaceOrientationParameters
        if surface is None:
            path = make_path(parameters, law, folder, progress)
            orientation = parameters.orientation
        else:
            path = make_path_on_surface(parameters, surface, law, folder, progress)
            orientation = surface.orientation
        points = scenario.reference.arc_lengths(path.length)
        for eta in points:
            if not is_on(path, eta):
                closed = closing_gap(path) is not None
                raise InputError(
                    f"reference.points: {eta:g} m; the path is open and "
                    f"{path.length:.6g} m long{_LOOKS_CLOSED if closed else ''}"
                )
        task = PathTask(
            path,
            rest_to_rest(points, **_limits(scenario.reference)),
            RELATIVE_DEGREE[law],
            followed_angles(orientation),
            tracks=scenario.controller.manifold == "trajectory",
            offset=start.offset,
            rotation_deg=start.rotation_deg,
            max_alpha=scenario.controller.max_alpha,
        )
        task.warnings += path_warnings(path, task.shape)
        task.warnings += _euler_warnings_along(path, task, "path" if surface is None else "surface")
        return task

    def surface_task(self) -> SurfaceTask:
        """Return the task of a tool on a surface."""
        scenario = self.scenario
        parameters, start, law = scenario.surface, scenario.start, scenario.controller.law
        if parameters is None:
            raise InputError(
                "controller.manifold = surface: there is none; write surface: {shape: !Plane {..}}"
            )
        try:
            sheet = make_surface(parameters.shape, law, self.folder, self.progress)
        except InputError as error:
            raise InputError(f"surface.shape: {error}") from None
        manifold = make_surface_manifold(RELATIVE_DEGREE[law], parameters)
        motion = _surface_motion(scenario.reference)
        if start.theta and not start.position:
            require_numbers("start.theta", start.theta, 2)
        task = SurfaceTask(
            sheet.surface,
            manifold,
            motion,
            parameters.orientation.quaternion,
            theta=start.theta,
            offset=start.offset[0],
            position=start.position,
            rotation_deg=start.rotation_deg,
            max_alpha=scenario.controller.max_alpha,
        )
        task.fit = sheet.fit
        task.warnings += sheet.notes
        task.warnings += _euler_warnings_at_start(task)
        return task

    def space_task(self) -> SpaceTask:
        """Return the task of a tool that is guided through space."""
        scenario, folder, progress = self.scenario, self.folder, self.progress
        parameters, start = scenario.fixtures or FixtureParameters(), scenario.start
        period, duration = scenario.controller.sampling_time, scenario.duration
        admittance = free_motion(scenario.compliance, period)
        lead = make_command_dynamics(
            RELATIVE_DEGREE[scenario.controller.law],
            parameters,
            period,
            lag=parameters.lag_behind(scenario.servo.bandwidth),
            delay=scenario.servo.bus_delay,
        )
        orientation, position = parameters.orientation, start.position
        space = SpaceManifold(
            RELATIVE_DEGREE[scenario.controller.law],
            orientation.quaternion,
            **followed_angles(orientation),
        )
        allowed = "the tool point where it starts [m], 3 numbers"
        require(bool(position), "start.position", position, allowed)
        first = np.array(position, dtype=float)
        require(duration > 0.0, "duration", duration, "a positive number [s]")
        fixtures, warnings = make_fixtures(parameters, first, folder, progress)
        task = SpaceTask(
            space,
            first,
            fixtures,
            admittance,
            lead,
            parameters,
            make_guides(parameters, folder, progress),
            rotation_deg=start.rotation_deg,
            duration=duration,
        )
        task.warnings += warnings
        if space.is_oriented:
            R_d = space.orientation(space.point(position)[None])
            task.warnings += euler_warnings(
                space.tool.euler, R_d, "fixtures", lambda _: "everywhere"
            )
        return task


def _limits(reference: ReferenceParameters) -> dict[str, float]:
    return {
        "velocity": reference.largest_velocity,
        "acceleration": reference.acceleration,
        "dwell": reference.dwell,
    }


def _euler_warnings_along(path: Path, task: PathTask, block: str) -> list[str]:
    """Return :func:`euler_warnings` of a path's orientation, of a block of the scenario."""
    euler = task.projected_manifold.tool.euler
    if path.orientation is None or euler is None:
        return []
    theta = np.linspace(*path.position.domain, _ORIENTATIONS)
    eta, R_d = path.arc_length(theta), path.orientation.rotation_matrix(theta)
    return euler_warnings(euler, R_d, block, lambda i: f"at eta = {eta[i]:.4g} m")


def _surface_motion(reference: ReferenceParameters) -> PiecewisePolynomialCurve:
    """Return the tangential references over time, of dimension 2."""
    limits = (reference.largest_velocity, reference.acceleration, reference.dwell)
    if reference.places:
        return straight_lines(reference.places, *limits)
    second = reference.second
    if second is None:
        raise InputError(
            "reference: a surface has two coordinates; write reference.places: "
            "[[eta_1, eta_2], ..] (m), or reference.second: {points, velocity, acceleration}"
        )
    return together(
        (reference.arc_lengths(None), *limits),
        (second.points, second.velocity, second.acceleration, reference.dwell),
    )


def _euler_warnings_at_start(task: SurfaceTask) -> list[str]:
    """Return :func:`euler_warnings` of the orientation where the tool starts."""
    euler = task.projected_manifold.tool.euler
    if euler is None:
        return []
    try:
        closest = task.evaluator.project_globally(task.first)
        point = task.evaluator.evaluate_at(closest.theta)
    except InputError:  # which is reported when the start is computed
        return []
    return euler_warnings(
        euler, task.projected_manifold.orientation(point[None]), "surface", lambda _: "at the start"
    )


def check_joints(scenario: Scenario, task: Task, num_joints: int) -> None:
    """Refuse a robot with too few joints, or a task that leaves the orientation open by oversight.

    Args:
        scenario: The scenario.
        task: Its task.
        num_joints: Number of joints of the robot.

    Raises:
        InputError: If the number of joints does not suit the task.
    """
    names = [coordinate.name for coordinate in task.projected_manifold.coordinates]
    if isinstance(task, StreamTask):
        few = f"{num_joints} joints for {len(names)} outputs ({', '.join(names)})"
        require(num_joints >= len(names), "path", few, "path.orientation.task: tool_axis or none")
    elif isinstance(task, PathTask) and surface_of_path(scenario.path, scenario.surface) is None:
        require_orientation(task.path, scenario.path.orientation.task, num_joints)
    else:
        require_joints(task.manifold, num_joints)


def inverted_start(task: Task, start: StartPoint) -> tuple[ToolTarget, str] | None:
    """Return the start with the normal of a surface inverted, and advice; None without a normal.

    Args:
        task: The task.
        start: Its start.
    """
    R_e, surface = start.target.R_e, task.projected_manifold
    if R_e is None or not isinstance(surface, SurfaceManifold) or surface.offset is None:
        return None
    axes = surface.axes(task.point(start)).full()
    # the tangent stays, which leaves the frame right-handed
    turned = axes @ np.diag([1.0, -1.0, -1.0]) @ axes.T @ R_e
    advice = (
        f"with the normal {np.round(axes[:, 2], 3).tolist()} inverted it is within reach: let "
        "the shape's axis, inward or visible_from turn the normal over, or "
        "surface.orientation.angles_deg the tool"
    )
    return replace(start.target, R_e=turned), advice
