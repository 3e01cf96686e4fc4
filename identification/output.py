"""Files and folders that results are written into."""

import errno
import os
import tempfile
from contextlib import suppress
from pathlib import Path

from pfsc_drake.errors import InputError, WriteError

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
