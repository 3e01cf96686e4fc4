"""Machine code that is kept on disk, by content."""

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

__all__ = ["ObjectStore", "user_store"]

_DIGEST = hashlib.sha256().digest_size


class ObjectStore:
    """A folder of object files.

    Any number of processes may share it, and everything in it may be lost or damaged at any time:
    then there is nothing under that key. Where nothing can be written, nothing is kept.

    Args:
        folder: The folder; it need not exist.
        capacity: Of all files together [bytes]; the oldest give way.
    """

    def __init__(self, folder: Path, capacity: int = 200_000_000) -> None:
        self._folder, self._capacity = folder, capacity

    def get(self, key: str) -> bytes | None:
        """Return what is kept under a key, or None.

        Args:
            key: A file name.
        """
        try:
            content = (self._folder / key).read_bytes()
        except OSError:
            return None
        digest, code = content[:_DIGEST], content[_DIGEST:]
        return code if digest == hashlib.sha256(code).digest() else None

    def put(self, key: str, code: bytes) -> None:
        """Keep something under a key.

        Args:
            key: A file name.
            code: What to keep.
        """
        with contextlib.suppress(OSError):
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._make_room(len(code) + _DIGEST)
            # another name until it is whole: no one reads half a file
            handle, name = tempfile.mkstemp(dir=self._folder, prefix=".")
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(hashlib.sha256(code).digest() + code)
                Path(name).replace(self._folder / key)
            except OSError:
                Path(name).unlink(missing_ok=True)

    def _make_room(self, size: int) -> None:
        files = [(entry.stat(), entry.path) for entry in os.scandir(self._folder)]
        excess = sum(status.st_size for status, _ in files) + size - self._capacity
        for status, path in sorted(files, key=lambda file: file[0].st_mtime):
            if excess <= 0:
                return
            Path(path).unlink(missing_ok=True)
            excess -= status.st_size


def user_store() -> ObjectStore:
    """Return the store in the user's folder for what can be made again."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        base = Path(given) if Path(given).is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # there is no such user; nothing can be kept below what is no folder
        base = Path(os.devnull)
    return ObjectStore(base / "pfsc_drake" / "machine_code")
