"""Reading whole files of which nobody knows where they come from."""

import stat
from pathlib import Path as FilePath

from pfsc_drake.errors import InputError, shortened

_MAX_BYTES = 1 << 28
_KINDS = {
    stat.S_IFDIR: "Is a directory",
    stat.S_IFIFO: "is a FIFO",
    stat.S_IFCHR: "is a device",
    stat.S_IFBLK: "is a device",
    stat.S_IFSOCK: "is a socket",
}


def read_regular_file(name: str | FilePath, kind: str) -> bytes:
    """Return what a file holds.

    Args:
        name: Of a regular file of at most 256 MiB.
        kind: What it should be, for messages, as "CSV".

    Raises:
        InputError: It cannot be read, is not regular or too large.
    """
    try:
        status = FilePath(name).stat()
        if not stat.S_ISREG(status.st_mode):
            raise OSError(0, _KINDS.get(stat.S_IFMT(status.st_mode), "is no regular file"))
        if status.st_size > _MAX_BYTES:
            raise OSError(0, f"{status.st_size >> 20} MiB, at most {_MAX_BYTES >> 20} are read")
        return FilePath(name).read_bytes()
    # ValueError: a name that no file can have.
    except (OSError, ValueError) as error:
        raise unreadable(name, kind, getattr(error, "strerror", None)) from error


def unreadable(name: str | FilePath, kind: str, reason: str | None = None) -> InputError:
    """Return the error that refuses a file, by default because it is not text."""
    what = reason or "not a text file"
    return InputError(f"{shortened(str(name), 1000)}: {what}; a readable {kind} file is required")
