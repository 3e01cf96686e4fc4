"""Files that are shipped with the models of robots."""

from pathlib import Path

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory


def shipped_or_own(robot: str | Path, name: str) -> Path:
    """Return a file that is shipped with a robot, or a user's own.

    Args:
        robot: Name of a shipped robot, or a file.
        name: Of the shipped file.

    Raises:
        InputError: If there is no such file with the robot.
    """
    path = Path(robot)
    if path.suffix:
        return path
    path = models_directory() / path / name
    if not path.is_file():
        known = sorted(file.parent.name for file in models_directory().glob(f"*/{name}"))
        raise InputError(f"robot {str(robot)!r}: must be a file or one of {', '.join(known)}")
    return path
