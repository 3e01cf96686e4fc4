"""The drawing of a task's manifold."""

from collections.abc import Sequence
from functools import singledispatch
from typing import cast

from diagrams.tasks.drawing import ManifoldDrawing, PathDrawing, SpaceDrawing, SurfaceDrawing
from diagrams.tasks.drawn_plane import StreamDrawing
from diagrams.tasks.regions_and_guides import DrawnFixture
from diagrams.tasks.streaming import ScenarioStream
from pfsc_drake.controller.tasks.path_task import PathTask
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.controller.tasks.surface_task import SurfaceTask
from pfsc_drake.controller.tasks.task import Task


@singledispatch
def drawing_of(task: Task) -> ManifoldDrawing:
    """Return the drawing of a task's manifold.

    Args:
        task: The task.
    """
    raise NotImplementedError(type(task).__name__)


@drawing_of.register
def _(task: PathTask) -> ManifoldDrawing:
    return PathDrawing(task.path, task.projected_manifold.layout)


@drawing_of.register
def _(task: SurfaceTask) -> ManifoldDrawing:
    return SurfaceDrawing(task.surface, task.projected_manifold)


@drawing_of.register
def _(task: SpaceTask) -> ManifoldDrawing:
    fixtures = cast(Sequence[DrawnFixture], task.fixtures)
    return SpaceDrawing(fixtures, task.projected_manifold, [*task.guides.values()])


@drawing_of.register
def _(task: ScenarioStream) -> ManifoldDrawing:
    return StreamDrawing(task.drawn_lines(), task.projected_manifold.layout)
