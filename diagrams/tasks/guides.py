"""The paths of a scenario that attract a tool which is led through space."""

from pathlib import Path as FilePath

from diagrams.scenario.fixtures import FixtureParameters
from diagrams.scenario.path import OrientationParameters, PathParameters
from diagrams.tasks.path import make_path
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress

# a place on it is all that is asked of a guide
_AS_SMOOTH_AS_FOR = "velocity_servo"


def make_guides(
    parameters: FixtureParameters, folder: FilePath, progress: Progress | None = None
) -> dict[str, Guide]:
    """Return the paths that attract a tool, by their names.

    Args:
        parameters: What the scenario says.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If a path cannot be made.
    """
    guides = {}
    for number, (name, said) in enumerate(
        zip(parameters.guide_names, parameters.guides, strict=True)
    ):
        shape = PathParameters(said.shape, OrientationParameters(task="none"))
        try:
            path = make_path(shape, _AS_SMOOTH_AS_FOR, folder, progress)
            guides[name] = Guide(path, said.stiffness, said.reach)
        except InputError as error:
            raise InputError(f"fixtures.guides[{number}]: {error}") from None
    return guides
