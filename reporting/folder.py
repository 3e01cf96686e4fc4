"""The folder that results are written into: taken by one process, never a user's own files."""

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

# copies of inputs, which are no results yet
_INPUTS = frozenset({"scenario.yaml"})
# where a file system knows no locks on folders, nothing is locked
_NO_LOCKS = (errno.EBADF, errno.EINVAL, errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)


class ResultsFolder:
    """A folder that this process alone writes results into; from :func:`open_results`.

    Attributes:
        path: The folder.
    """

    def __init__(self, path: Path, kind: str, handle: int, *, resume: bool) -> None:
        """Take over a folder.

        Args:
            path: Path of the folder.
            kind: Kind of results, e.g. ``run``.
            handle: Descriptor of the open folder.
            resume: Whether results replace earlier ones one by one, at once; else all together, by
                :meth:`exchange`.
        """
        self.path = path
        self._kind = kind
        self._handle = handle
        end_exchange(path)
        (path / UNFINISHED).unlink(missing_ok=True)
        self._earlier = {name: _version(path / name) for name in listed_results(path)}
        self._files = [*self._earlier] if resume else []
        self._home = path if resume else begin_exchange(path, kind)
        self._inputs: dict[str, bytes] = {}  # small, and kept for a folder that is removed
        self._elsewhere: Path | None = None
        self._reasons: dict[str, str] = {}  # why a file could not be written here
        self._lost: list[str] = []  # what could not be written elsewhere either
        self._outcome: Mapping[str, Any] | None = None
        self._write_manifest()

    def write(self, name: str, content: str | bytes) -> Path | None:
        """Write one result, whole or not at all; it is in the folder from the exchange on.

        One that is replaced is there at every moment, as it was or as it is now.

        What cannot be written here is written into a temporary folder instead, see
        :meth:`explain_problems`.

        Args:
            name: See :mod:`reporting.provenance`: a result's, or ``figures/NAME.png``.
            content: Content of the file; text becomes UTF-8.

        Returns:
            The file as it is called after the exchange; None if it could not be written anywhere.
        """
        assert is_result(name), name
        if isinstance(content, str):
            content = content.encode("utf-8", "backslashreplace")  # names of files may be no text
        if name in _INPUTS:
            self._inputs[name] = content
        try:
            return self._write_here(name, content)
        except OSError as error:
            self._reasons[name] = _reason(error)
        return self._write_elsewhere(name, content)

    def exchange(self) -> None:
        """Replace the earlier results by the new ones; what cannot be is written elsewhere."""
        if self._home == self.path:
            return
        home, self._home = self._home, self.path
        try:
            self._require_same_folder()
            for name in (name for name in self._files if self._is_foreign(name)):
                self._move_elsewhere(STAGED, name, f"somebody else has made {name} meanwhile")
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
                    continue  # it has been exchanged
                if name not in self._reasons:
                    self._move_elsewhere(READY if began else STAGED, name, _reason(error))

    def _is_foreign(self, name: str) -> bool:
        """Return whether a file of a result's name has been made or changed since the beginning."""
        version = _version(self.path / name)
        return version is not None and version != self._earlier.get(name)

    def close(self, *, failed: bool) -> None:
        """End the writing: exchange, but for a failure before there was a result.

        Args:
            failed: Whether an exception ends it.
        """
        if not failed or set(self._files) - _INPUTS:
            self.exchange()
        elif self._home != self.path:
            shutil.rmtree(self._home, ignore_errors=True)

    def tell(self, outcome: Mapping[str, Any]) -> None:
        """Note how it ended, so that it is known to whoever reads the results.

        Args:
            outcome: Of numbers, texts and lists of these, by name.
        """
        self._outcome = outcome
        with suppress(OSError):  # the files themselves say what could not be written
            self._write_manifest()

    def explain_problems(self) -> str | None:
        """Exchange the results, and return what could not be written, why, and where it is instead.

        None if all was.
        """
        self.exchange()
        if not self._reasons:
            return None
        reasons = " and ".join(dict.fromkeys(self._reasons.values()))
        text = f"cannot write {_listed(self._reasons)} into {self.path}: {reasons}"
        if len(self._lost) < len(self._reasons):
            text += f"; kept in {self._elsewhere}"
        return f"{text}; lost: {_listed(self._lost)}" if self._lost else text

    def _write_here(self, name: str, content: bytes) -> Path:
        self._require_same_folder()
        if name not in self._files:
            if self._is_foreign(name):
                raise FileExistsError(errno.EEXIST, f"somebody else has made {name} meanwhile")
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
        """Take a staged result out of those to be exchanged, also from a folder that was moved."""
        self._reasons[name] = reason
        try:
            with open(
                f"{staged}/{name}", "rb", opener=partial(os.open, dir_fd=self._handle)
            ) as file:
                kept = self._write_elsewhere(name, file.read())
            if kept is not None:
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
    """Take a folder for results until the end of the context.

    The folder is created if it is missing and locked against other processes; the lock ends with
    the process, also if that crashes. Earlier results of the same kind stay until the end, or until
    :meth:`ResultsFolder.explain_problems`, and are then exchanged for the new ones all at once; if
    the process is killed before, or fails without a result, they stay whole.

    Args:
        path: Path of the folder.
        kind: Kind of results, e.g. ``run``.
        inputs: Files that the results are made from.
        resume: Whether earlier results stay until others replace them.

    Raises:
        InputError: If the folder cannot be written, is in use, or holds something else where
            results belong; one line. Nothing in it has been changed then.
    """
    check_folder(path, kind, inputs)
    with _naming(path):
        path.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with _naming(path):
            _lock(path, handle)
            check_folder(path, kind, inputs)  # as it is now that nobody else writes
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
    """Refuse a folder that results must not be written into; changes nothing.

    Args:
        path: Path of the folder, which may be missing.
        kind: Kind of results.
        inputs: Files that the results are made from.

    Raises:
        InputError: If the folder is in use, or holds something else than results.
    """
    with _naming(path):
        exists = _exists(path)
        if exists and not path.is_dir():
            raise InputError(f"--out {path}: is no folder; allowed: a folder")
        obstacle = find_obstacle(path, kind, inputs) if exists else None
    if obstacle is not None:
        raise InputError(f"--out {path}: {obstacle}; allowed: another folder")


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Turn what the system says against a folder into one line that names it."""
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
    """Write a file under another name, which it changes for its own when it is complete."""
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
    """Whether something has this name, be it a link that leads nowhere."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    return True


def _version(file: Path) -> tuple[int, int, int] | None:
    """Return what changes when a file does; None if there is none."""
    try:
        status = file.lstat()
    except FileNotFoundError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def _reason(error: OSError) -> str:
    """What the system says, without the names of files."""
    return error.strerror or type(error).__name__


def _listed(names: Sequence[str] | dict[str, str]) -> str:
    """Names for people, figures as one."""
    shown = [FIGURES if name.startswith(f"{FIGURES}/") else name for name in names]
    return ", ".join(dict.fromkeys(shown))
