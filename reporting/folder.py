"""Results folder: locked by one process, without overwriting a user's own files."""

import errno
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from pfsc_drake.errors import InputError
from reporting.exchange import begin_exchange, complete_exchange, end_exchange
from reporting.provenance import (
    FIGURES,
    MANIFEST,
    READY,
    STAGED,
    UNFINISHED,
    find_obstacle,
    is_result,
    listed_results,
    manifest_text,
)

# copies of inputs, which are not results
_INPUTS = frozenset({"scenario.yaml"})
# on file systems without locks for folders, nothing is locked
_NO_LOCKS = (errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)


class ResultsFolder:
    """A folder into which only this process writes results; from :func:`open_results`.

    Attributes:
        path: The folder.
    """

    def __init__(self, path: Path, kind: str, handle: int, *, resume: bool) -> None:
        """Take over a folder.

        Args:
            path: Path of the folder.
            kind: Kind of results, e.g. ``run``.
            handle: Descriptor of the open folder.
            resume: Whether results replace earlier ones one by one, immediately; otherwise all
                together, by :meth:`exchange`.
        """
        self.path = path
        self._kind = kind
        self._handle = handle
        end_exchange(path)
        (path / UNFINISHED).unlink(missing_ok=True)
        self._earlier = {name: _fingerprint(path / name) for name in listed_results(path)}
        self._files = [*self._earlier] if resume else []
        self._home = path if resume else begin_exchange(path, kind)
        self._inputs: dict[str, bytes] = {}  # small, and stored in case the folder is removed
        self._elsewhere: Path | None = None
        self._reasons: dict[str, str] = {}  # reasons why files could not be written here
        self._lost: list[str] = []  # files that could not be written elsewhere either
        self._outcome: Mapping[str, Any] | None = None
        self._write_manifest()

    def write(self, name: str, content: str | bytes) -> Path | None:
        """Write one result as a whole; it is in the folder after the exchange.

        A result that is replaced exists at every moment, in its old or its new version.

        If a file cannot be written here, it is written into a temporary folder instead, see
        :meth:`explain_problems`.

        Args:
            name: Name of a result, see :mod:`reporting.provenance`, or ``figures/NAME.png``.
            content: Content of the file; text becomes UTF-8.

        Returns:
            Path of the file after the exchange; None if it could not be written anywhere.
        """
        assert is_result(name), name
        if isinstance(content, str):
            content = content.encode("utf-8", "backslashreplace")  # file names may be no valid text
        if name in _INPUTS:
            self._inputs[name] = content
        try:
            return self._write_here(name, content)
        except OSError as error:
            self._reasons[name] = _reason(error)
        return self._write_elsewhere(name, content)

    def exchange(self) -> None:
        """Replace the earlier results by the new ones; write the rest elsewhere."""
        if self._home == self.path:
            return
        home, self._home = self._home, self.path
        try:
            self._require_same_folder()
            for name in (name for name in self._files if self._is_foreign(name)):
                self._move_elsewhere(STAGED, name, f"another process has created {name} meanwhile")
            own = [name for name in self._earlier if not self._is_foreign(name)]
            if len(own) < len(self._earlier):
                text = manifest_text(self._kind, own)
                _write_whole(self.path, MANIFEST, text.encode("utf-8"))
            self._files = [name for name in self._files if (home / name).exists()]
            text = manifest_text(self._kind, self._files, self._outcome)
            _write_whole(home, MANIFEST, text.encode("utf-8"))
            complete_exchange(self.path)
        except OSError as error:
            began = (self.path / READY).exists()
            for name in self._files:
                if began and not _exists(self.path / READY / name):
                    continue  # already exchanged
                if name not in self._reasons:
                    self._move_elsewhere(READY if began else STAGED, name, _reason(error))

    def _is_foreign(self, name: str) -> bool:
        """Return whether a result's file has been created or changed by others meanwhile."""
        version = _fingerprint(self.path / name)
        return version is not None and version != self._earlier.get(name)

    def close(self, *, failed: bool) -> None:
        """Finish writing: exchange, unless it failed before there was a result.

        Args:
            failed: Whether an exception ends it.
        """
        if not failed or set(self._files) - _INPUTS:
            self.exchange()
        elif self._home != self.path:
            shutil.rmtree(self._home, ignore_errors=True)

    def tell(self, outcome: Mapping[str, Any]) -> None:
        """Store the outcome in the manifest.

        Args:
            outcome: Numbers, texts and lists of these, by name.
        """
        self._outcome = outcome
        with suppress(OSError):  # explain_problems reports the files
            self._write_manifest()

    def explain_problems(self) -> str | None:
        """Exchange the results, and describe files that could not be written: reason and place.

        None if all were written.
        """
        self.exchange()
        if not self._reasons:
            return None
        reasons = " and ".join(dict.fromkeys(self._reasons.values()))
        text = f"cannot write {_join_names(self._reasons)} into {self.path}: {reasons}"
        if len(self._lost) < len(self._reasons):
            text += f"; saved in {self._elsewhere}"
        return f"{text}; lost: {_join_names(self._lost)}" if self._lost else text

    def _write_here(self, name: str, content: bytes) -> Path:
        self._require_same_folder()
        if name not in self._files:
            if self._is_foreign(name):
                raise FileExistsError(errno.EEXIST, f"another process has created {name} meanwhile")
            # listed first, so that a file is known as a result whenever the process ends
            self._files.append(name)
            self._write_manifest()
        _write_whole(self._home, name, content)
        return self.path / name

    def _require_same_folder(self) -> None:
        if not os.path.samestat(os.fstat(self._handle), self.path.stat()):
            raise FileExistsError(errno.EEXIST, "another folder has taken its place")

    def _write_elsewhere(self, name: str, content: bytes) -> Path | None:
        try:
            if self._elsewhere is None:
                self._elsewhere = Path(tempfile.mkdtemp(prefix=f"pfsc_drake_{self._kind}_"))
            return _write_whole(self._elsewhere, name, content)
        except OSError:
            self._lost.append(name)
            return None

    def _move_elsewhere(self, staged: str, name: str, reason: str) -> None:
        """Remove a staged result from the exchange, also from a folder that was moved."""
        self._reasons[name] = reason
        try:
            with open(
                f"{staged}/{name}", "rb", opener=partial(os.open, dir_fd=self._handle)
            ) as file:
                saved = self._write_elsewhere(name, file.read())
            if saved is not None:
                os.unlink(f"{staged}/{name}", dir_fd=self._handle)
        except OSError:
            if name not in self._inputs:
                self._lost.append(name)
            else:
                self._write_elsewhere(name, self._inputs[name])

    def _write_manifest(self) -> None:
        text = manifest_text(self._kind, self._files, self._outcome)
        _write_whole(self._home, MANIFEST, text.encode("utf-8"))


@contextmanager
def open_results(
    path: Path, kind: str, inputs: Sequence[Path] = (), resume: bool = False
) -> Iterator[ResultsFolder]:
    """Open a folder for results until the end of the context.

    The folder is created if it is missing and locked against other processes; the lock ends with
    the process, also after a crash. Earlier results of the same kind stay until the end, or until
    :meth:`ResultsFolder.explain_problems`, and are then replaced by the new ones as a whole; if the
    process is killed before, or fails without a result, they stay complete.

    Args:
        path: Path of the folder.
        kind: Kind of results, e.g. ``run``.
        inputs: Input files of the results.
        resume: Whether earlier results stay until others replace them.

    Raises:
        InputError: If the folder cannot be written, is in use, or contains other files in place of
            results; one line. Nothing in it has been changed then.
    """
    check_folder(path, kind, inputs)
    with _name_in_errors(path):
        path.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with _name_in_errors(path):
            _lock(path, handle)
            check_folder(path, kind, inputs)  # again, now that no other process writes
            results = ResultsFolder(path, kind, handle, resume=resume)
        try:
            yield results
        except BaseException:
            results.close(failed=True)
            raise
        results.close(failed=False)
    finally:
        os.close(handle)


def check_folder(path: Path, kind: str, inputs: Sequence[Path] = ()) -> None:
    """Refuse a folder that results must not be written into; change nothing.

    Args:
        path: Path of the folder, which may be missing.
        kind: Kind of results.
        inputs: Input files of the results.

    Raises:
        InputError: If the folder is in use, or contains anything but results.
    """
    with _name_in_errors(path):
        exists = _exists(path)
        if exists and not path.is_dir():
            raise InputError(f"--out {path}: is no folder; allowed: a folder")
        obstacle = find_obstacle(path, kind, inputs) if exists else None
    if obstacle is not None:
        raise InputError(f"--out {path}: {obstacle}; allowed: another folder")


@contextmanager
def _name_in_errors(path: Path) -> Iterator[None]:
    """Turn errors of the system about a folder into one line that names it."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = _reason(error) if isinstance(error, OSError) else "no name of a folder"
        raise InputError(
            f"--out {path}: cannot be written: {reason}; allowed: a folder to write in"
        ) from None


def _lock(path: Path, handle: int) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"--out {path}: another run is writing into it; allowed: another folder"
        ) from None
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise


def _write_whole(folder: Path, name: str, content: bytes) -> Path:
    """Write a file under another name, and rename it when it is complete."""
    target, unfinished = folder / name, folder / UNFINISHED
    try:
        unfinished.write_bytes(content)
        if target.parent != folder:
            target.parent.mkdir(exist_ok=True)
        unfinished.replace(target)
    except BaseException:
        with suppress(OSError):
            unfinished.unlink()
        raise
    return target


def _exists(path: Path) -> bool:
    """Return whether the name exists, possibly as a broken link."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    return True


def _fingerprint(file: Path) -> tuple[int, int, int] | None:
    """Return values that change with the file; None if there is none."""
    try:
        status = file.lstat()
    except FileNotFoundError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def _reason(error: OSError) -> str:
    """Return the system's message without file names."""
    return error.strerror or type(error).__name__


def _join_names(names: Sequence[str] | dict[str, str]) -> str:
    """Return names in words, all figures as one."""
    shown = [FIGURES if name.startswith(f"{FIGURES}/") else name for name in names]
    return ", ".join(dict.fromkeys(shown))
