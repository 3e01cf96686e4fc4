"""Files and folders that are written, or one line that says why not."""

from pathlib import Path

from pfsc_drake.errors import InputError


def write_text(path: Path, text: str) -> None:
    """Write a file.

    Raises:
        InputError: If that is not possible.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no name of a file"
        raise InputError(f"{path}: cannot be written: {reason}") from None


def make_folder(folder: Path) -> None:
    """Make a folder with its parents.

    Raises:
        InputError: If that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
