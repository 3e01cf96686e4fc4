"""Files and folders that results are written into."""

import errno
import os
import tempfile
from contextlib import suppress
from pathlib import Path

from pfsc_drake.errors import InputError, WriteError

# errors of a full disk, for any user
_NO_MORE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def write_text(path: Path, text: str) -> None:
    """Write a file; see :func:`write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file; on a full disk, write into a temporary folder.

    Raises:
        WriteError: If the disk is full; names the temporary file.
        InputError: If the path is not possible.
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
    """Write a file elsewhere, and return the place in words."""
    try:
        saved = Path(tempfile.mkdtemp(prefix="pfsc_drake_identification_")) / path.name
        saved.write_bytes(content)
    except OSError:
        return "lost"
    return f"saved in {saved}"


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be written, before there is anything to write.

    Args:
        folder: Folder, which may be missing and is not created.

    Raises:
        InputError: If it is not a folder, or cannot be created or written.
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
    """Create a folder with its parents.

    Raises:
        InputError: If that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
