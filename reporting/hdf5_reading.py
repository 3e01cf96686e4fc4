"""HDF5 files of unknown origin: datasets of numbers in the file itself, of bounded size."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from pfsc_drake.errors import InputError

# gzip shrinks zeros at most 1030 times; data outside the file would have no bound
_COMPRESSION, _SMALLEST = 1100, 100_000_000  # times, bytes
_MOST_NAMES = 10_000
_NUMBERS = "fiub"  # kinds of numpy


@contextmanager
def open_hdf5(path: Path, what: str) -> Iterator["NumberFile"]:
    """Open an HDF5 file to read.

    Args:
        path: A regular file.
        what: Kind of file, for messages.

    Raises:
        InputError: If it cannot be read, or is another kind of file.
    """
    try:
        with h5py.File(path, "r") as file:
            yield NumberFile(file, _SMALLEST + _COMPRESSION * path.stat().st_size)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # HDF5 raises any exception for a manipulated file
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable {what}: {reason}") from None


class NumberFile:
    """Datasets of an HDF5 file.

    Args:
        file: The file.
        most: Largest size of all data that are read, uncompressed [bytes].
    """

    def __init__(self, file: h5py.File, most: int) -> None:
        self.file, self._left, self._names = file, most, 0

    def datasets(self) -> Iterator[tuple[str, h5py.Dataset]]:
        """Yield names and datasets of numbers at the root, without groups.

        Raises:
            InputError: If a dataset does not consist of numbers, is not in the file, or is too
                large.
        """
        for name, content in self._contents(self.file):
            if isinstance(content, h5py.Dataset):
                yield name, self._check_dataset(name, content)

    def check(self) -> None:
        """Check all datasets, including those in groups.

        Raises:
            InputError: See :meth:`datasets`.
        """
        groups = [self.file]
        while groups:
            for name, content in self._contents(groups.pop()):
                if isinstance(content, h5py.Dataset):
                    self._check_dataset(name, content)
                else:
                    groups.append(content)

    def _contents(self, group: h5py.Group) -> Iterator[tuple[str, h5py.Group | h5py.Dataset]]:
        """Yield names and contents of a group, all of which must be in the file."""
        for name in group:
            self._names += 1
            if self._names > _MOST_NAMES:  # a group may contain itself
                raise InputError(f"more than {_MOST_NAMES} names; allowed: fewer")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise InputError(f"'{name}' is a link; allowed: datasets of the file itself")
            yield name, group[name]

    def _check_dataset(self, name: str, dataset: h5py.Dataset) -> h5py.Dataset:
        if dataset.is_virtual or dataset.external:
            raise InputError(f"'{name}' is stored in another file; allowed: one file")
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
