"""What a scenario's tool is to do."""

from pathlib import Path as FilePath

from diagrams.scenario import Scenario
from diagrams.scenario.checks import require
from diagrams.tasks.path_following import PathTask, TrajectoryTask
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.surface_following import SurfaceTask
from diagrams.tasks.task import Task
from pfsc_drake.geometry.progress import Progress

TASKS: dict[str, type[PathTask | SurfaceTask | SpaceTask]] = {
    "path": PathTask,
    "trajectory": TrajectoryTask,
    "surface": SurfaceTask,
    "space": SpaceTask,
}


def make_task(scenario: Scenario, folder: FilePath, progress: Progress | None = None) -> Task:
    """Return what a scenario's tool is to do.

    Args:
        scenario: The scenario.
        folder: Where its relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If the path or the motion along it cannot be made, or regions are given that
            nothing keeps the tool out of.
    """
    regions = [] if scenario.fixtures is None else scenario.fixtures.regions
    led = scenario.controller.manifold == "space"
    allowed = (
        "none with controller.manifold = "
        f"{scenario.controller.manifold}; only a tool led through space is kept out of regions"
    )
    require(led or not regions, "fixtures.regions", f"{len(regions)} given", allowed)
    return TASKS[scenario.controller.manifold](scenario, folder, progress)
