"""Reading a text file that a user names: only real files, of bounded size, in UTF-8."""

import os
import stat
from pathlib import Path

from pfsc_drake.errors import InputError

MAX_BYTES = 1_000_000  # of a YAML file


def find_status(path: Path) -> os.stat_result | None:
    """Returns what the system knows of a path; None if there is no such file, or cannot be."""
    try:
        return path.stat()
    except (OSError, ValueError):  # e.g. a name that is too long, a NUL in it
        return None


def read_text(path: Path, max_bytes: int = MAX_BYTES) -> str:
    """Returns the text of a regular file.

    Pipes, devices and folders are refused before they are opened: opening one may wait for ever,
    and reading one may never end.

    Args:
        path: Of the file; links are followed.
        max_bytes: Largest size that is read.

    Raises:
        InputError: If the file cannot be read, is no regular file, is too large or not UTF-8; one
            line that names it.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe, socket or device"
            raise InputError(f"{path}: cannot be read: is {kind}; allowed: a file")
        if status.st_size > max_bytes:
            raise InputError(
                f"{path}: cannot be read: {status.st_size} bytes; allowed: up to {max_bytes}"
            )
        with path.open("rb") as file:
            # what grows meanwhile, and what claims to be empty as files of /proc do
            content = file.read(max_bytes + 1)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {os.strerror(error.errno or 0)}") from None
    except ValueError:  # a NUL in the name
        raise InputError(f"{str(path)!r}: cannot be read: no name of a file") from None
    if len(content) > max_bytes:
        raise InputError(f"{path}: cannot be read: allowed: up to {max_bytes} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read: not UTF-8 text") from None
