"""HDF5 files of unknown origin: datasets of numbers in the file itself, of bounded size."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from pfsc_drake.errors import InputError

# gzip makes 1030 times less of zeros at most; what is in no file can be as large as one likes
_COMPRESSION, _SMALLEST = 1100, 100_000_000  # times, bytes
_MOST_NAMES = 10_000
_NUMBERS = "fiub"  # kinds of numpy


@contextmanager
def opened(path: Path, what: str) -> Iterator["NumberFile"]:
    """Open an HDF5 file to read.

    Args:
        path: A regular file.
        what: What it must be, in messages.

    Raises:
        InputError: If it cannot be read, or is something else.
    """
    try:
        with h5py.File(path, "r") as file:
            yield NumberFile(file, _SMALLEST + _COMPRESSION * path.stat().st_size)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # HDF5 raises whatever it likes of a file that is broken on purpose
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable {what}: {reason}") from None


class NumberFile:
    """Datasets of an HDF5 file.

    Args:
        file: The file.
        most: Largest size of all that is read, once it is expanded [bytes].
    """

    def __init__(self, file: h5py.File, most: int) -> None:
        self.file, self._left, self._names = file, most, 0

    def datasets(self) -> Iterator[tuple[str, h5py.Dataset]]:
        """Yield names and datasets of numbers at the root; groups are left out.

        Raises:
            InputError: If a dataset is not of numbers, elsewhere, or too large.
        """
        for name, content in self._contents(self.file):
            if isinstance(content, h5py.Dataset):
                yield name, self._checked(name, content)

    def check(self) -> None:
        """Check all datasets, those in groups, too.

        Raises:
            InputError: See :meth:`datasets`.
        """
        groups = [self.file]
        while groups:
            for name, content in self._contents(groups.pop()):
                if isinstance(content, h5py.Dataset):
                    self._checked(name, content)
                else:
                    groups.append(content)

    def _contents(self, group: h5py.Group) -> Iterator[tuple[str, h5py.Group | h5py.Dataset]]:
        """Yield names and contents of a group, of which none may be elsewhere."""
        for name in group:
            self._names += 1
            if self._names > _MOST_NAMES:  # a group may contain itself
                raise InputError(f"more than {_MOST_NAMES} names; allowed: fewer")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise InputError(f"'{name}' is a link; allowed: datasets of the file itself")
            yield name, group[name]

    def _checked(self, name: str, dataset: h5py.Dataset) -> h5py.Dataset:
        if dataset.is_virtual or dataset.external:
            raise InputError(f"'{name}' is kept in another file; allowed: one file")
        if dataset.shape is None or dataset.dtype.kind not in _NUMBERS:
            raise InputError(f"'{name}' is of {dataset.dtype}; allowed: numbers")
        size = int(np.prod(dataset.shape, dtype=object)) * dataset.dtype.itemsize
        if size > self._left:
            raise InputError(
                f"'{name}' takes {size / 1e9:.3g} GB; allowed: {self._left / 1e9:.3g} GB in a "
                "file of this size"
            )
        self._left -= size
        return dataset
