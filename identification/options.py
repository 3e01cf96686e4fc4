"""Arguments and options that several commands take, how they are read, where results go."""

import errno
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pfsc_drake.errors import InputError, WriteError, shortened

if TYPE_CHECKING:
    from identification.measurement.columns import Reading

Robot = Annotated[
    str, typer.Argument(help="Shipped robot, SDF or URDF file, or scenario with a robot.")
]
Tool = Annotated[
    bool, typer.Option("--tool/--no-tool", help="Whether the shipped robot carries its tool.")
]
Records = Annotated[list[Path], typer.Argument(help="Runs of one excitation: CSV, HDF5 or MAT.")]
Validation = Annotated[
    Path | None, typer.Option(help="Record of another motion, to choose friction and to predict.")
]
Bounds = Annotated[
    Path | None, typer.Option(help="What is known of the links (YAML). Default: what is shipped")
]
Excitation = Annotated[
    Path | None, typer.Option(help="excitation.yaml, to see the robot move on the page.")
]
Units = Annotated[
    list[str] | None,
    typer.Option("--unit", metavar="SIGNAL=UNIT", help="Unit that a file does not state."),
]
Names = Annotated[
    list[str] | None,
    typer.Option("--name", metavar="FILE_NAME=SIGNAL", help="What a file calls otherwise."),
]
Scales = Annotated[
    list[str] | None,
    typer.Option("--scale", metavar="SIGNAL=NUMBER", help="SI units per unit of the file."),
]
Simulated = Annotated[
    bool, typer.Option("--simulated", help="The robot's model is the truth: compare with it.")
]


def read_pairs(options: list[str] | None, option: str) -> list[tuple[str, str]]:
    """Return names and values of a repeatable option.

    Raises:
        InputError: If one is not ``NAME=VALUE``.
    """
    pairs = []
    for text in options or []:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f"{option} {shortened(text)}: allowed: NAME=VALUE")
        pairs.append((name, value))
    return pairs


def read_reading(
    names: list[str] | None, units: list[str] | None, scales: list[str] | None
) -> "Reading":
    """Return what options say of files.

    Raises:
        InputError: If one is not of its form.
    """
    from identification.measurement.columns import Reading

    scale = {name: read_number(value, "--scale") for name, value in read_pairs(scales, "--scale")}
    return Reading(dict(read_pairs(names, "--name")), dict(read_pairs(units, "--unit")), scale)


def read_number(text: str, option: str) -> float:
    """Return the number of an option.

    Raises:
        InputError: If it is none.
    """
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} {shortened(text)}: allowed: a number") from None


def read_range(text: str, option: str) -> tuple[float, float]:
    """Return the two numbers of an option.

    Raises:
        InputError: If it is not ``LOW:HIGH``.
    """
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"{option} {shortened(text)}: allowed: LOW:HIGH")
    return read_number(low, option), read_number(high, option)


def read_integer(text: str, option: str) -> int:
    """Return the integer of an option.

    Raises:
        InputError: If it is none.
    """
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{option} {shortened(text)}: allowed: integers, e.g. 1,3,5") from None


# what a system says of a disk that takes no more, whoever asks
_NO_MORE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def write_text(path: Path, text: str) -> None:
    """Write a file; see :func:`write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file; where the disk takes no more, into a temporary folder.

    Raises:
        WriteError: If the disk takes no more; says where the file is instead.
        InputError: If there can be no such file.
    """
    try:
        path.write_bytes(content)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no name of a file"
        if getattr(error, "errno", None) not in _NO_MORE:
            raise InputError(f"{path}: cannot be written: {reason}") from None
        with suppress(OSError):
            path.unlink()
        raise WriteError(f"{path}: cannot be written: {reason}; {_keep(path, content)}") from None


def _keep(path: Path, content: bytes) -> str:
    """Write a file elsewhere, and return where in words."""
    try:
        kept = Path(tempfile.mkdtemp(prefix="pfsc_drake_identification_")) / path.name
        kept.write_bytes(content)
    except OSError:
        return "lost"
    return f"kept in {kept}"


def check_folder(folder: Path) -> None:
    """Refuse a folder that nothing can be written into, before there is anything to write.

    Args:
        folder: May be missing; is not made.

    Raises:
        InputError: If it is no folder, or one that cannot be made or written into.
    """
    try:
        nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    except (OSError, ValueError):
        raise InputError(f"--out {folder}: cannot be made; allowed: a folder") from None
    if not nearest.is_dir():
        raise InputError(f"--out {folder}: {nearest} is no folder; allowed: a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"--out {folder}: cannot be written; allowed: a folder to write in")


def make_folder(folder: Path) -> None:
    """Make a folder with its parents.

    Raises:
        InputError: If that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
