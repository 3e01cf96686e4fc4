"""Log of one run: named signals over time, stored in one HDF5 file."""

import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pfsc_drake.errors import InputError, nearest_file, suggestion
from pfsc_drake.yaml.reading import find_status
from reporting.hdf5_reading import open_hdf5
from reporting.registry import SIGNALS, KnownSignal

FloatArray = NDArray[np.float64]


@dataclass
class Signal:
    """A sampled signal with its unit and a name for each component.

    Attributes:
        values: [samples, dim] in ``unit``; a vector [samples] becomes one column.
        unit: Unit of all components, e.g. ``"m"``; ``"1"`` without unit.
        labels: One name per column. A signal of names (``mode``) has one integer column
            and a label per *value* instead.
        limits: Optional [dim], magnitude of the admissible range, or [dim, 2], its lower and
            upper end, in ``unit``.
    """

    values: FloatArray
    unit: str
    labels: list[str]
    limits: FloatArray | None = None

    def __post_init__(self) -> None:
        self.values = _as_columns(self.values)
        if self.limits is not None:
            limits, dim = np.asarray(self.limits, dtype=float), self.values.shape[1]
            self.limits = np.broadcast_to(limits, (dim, 2)[: max(limits.ndim, 1)]).copy()

    @property
    def dim(self) -> int:
        """Number of components."""
        return int(self.values.shape[1])


@dataclass
class RunLog:
    """All signals of one run on one time axis.

    ``log["xi"]`` is the signal ``xi``; ``"xi" in log`` is whether the run has it; ``for name in
    log`` iterates over all names.

    Attributes:
        time: [samples] s.
        signals: By name, as listed in :meth:`write`; each has as many samples as ``time``.
        attributes: Identification of the run, see ``provenance.standard_attributes``.
        turning: Whether each joint is revolute, else prismatic; determines units.
    """

    time: FloatArray
    signals: dict[str, Signal] = field(default_factory=dict)
    attributes: dict[str, str] = field(default_factory=dict)
    turning: Sequence[bool] = (True,)

    def __post_init__(self) -> None:
        self.time = np.asarray(self.time, dtype=float).reshape(-1)
        for name, signal in self.signals.items():
            self._check(name, signal)

    @property
    def end(self) -> float:
        """Time of the last sample [s], 0 without samples."""
        return float(self.time[-1]) if self.time.size else 0.0

    def __getitem__(self, name: str) -> Signal:
        try:
            return self.signals[name]
        except KeyError:
            raise KeyError(
                f"log has no signal {name!r}; it has: {', '.join(self.signals)}"
                f"{suggestion(name, self.signals)}"
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        return len(self.signals)

    def add(
        self,
        name: str,
        values: ArrayLike,
        unit: str | None = None,
        labels: list[str] | None = None,
        limits: ArrayLike | None = None,
    ) -> Signal:
        """Add a signal and return it.

        Args:
            name: Name in the log, e.g. ``"q_J"``.
            values: [samples, dim] or [samples], in ``unit``.
            unit: Unit of all components; by default from the registry.
            labels: One name per column; by default from the registry, or the name itself, numbered
                from 1 if dim > 1.
            limits: [dim] or scalar, magnitude of the admissible range, or [dim, 2], its lower
                and upper end, in ``unit``.

        Returns:
            The added signal.
        """
        columns = _as_columns(values)
        known = SIGNALS[name] if unit is None else SIGNALS.get(name, KnownSignal(name, unit, ""))
        signal = Signal(
            columns,
            known.unit_of(self.turning) if unit is None else unit,
            known.labels_of(columns.shape[1]) if labels is None else labels,
            None if limits is None else np.asarray(limits, dtype=float),
        )
        self._check(name, signal)
        self.signals[name] = signal
        return signal

    @property
    def period(self) -> float:
        """Time from sample to sample [s], the median; 0 of less than two samples."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else 0.0

    def norm(self, name: str) -> FloatArray:
        """Return the Euclidean norm of a signal at each sample, shape (samples,)."""
        return np.asarray(np.linalg.norm(self[name].values, axis=1))

    def write(self, path: Path) -> None:
        """Write the log, see :meth:`to_hdf5`, to a file, which is replaced if it exists."""
        path.write_bytes(self.to_hdf5())

    def to_hdf5(self) -> bytes:
        """Return the log as the content of an HDF5 file.

        It is created in memory, since HDF5 does not reliably report a full disk.

        Dataset ``t`` [s] and one dataset [samples, dim] per signal with attributes ``unit``,
        ``labels`` and, where known, ``limits``; ``attributes`` become the root's attributes.
        """
        content = BytesIO()
        with h5py.File(content, "w") as file:
            file.attrs.update(self.attributes)
            file.create_dataset("t", data=self.time).attrs["unit"] = "s"
            for name, signal in self.signals.items():
                dataset = file.create_dataset(
                    name, data=signal.values, compression="gzip", compression_opts=4, shuffle=True
                )
                dataset.attrs["unit"] = signal.unit
                dataset.attrs.create("labels", signal.labels, dtype=h5py.string_dtype())
                if signal.limits is not None:
                    dataset.attrs["limits"] = signal.limits
        return content.getvalue()

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a log written by :meth:`write`.

        Args:
            path: HDF5 file.

        Returns:
            The log.

        Raises:
            InputError: If the file cannot be read or is not such a log.
        """
        status = find_status(path)
        if status is None or not stat.S_ISREG(status.st_mode):
            hint = nearest_file(path) or nearest_file(path.parent)
            raise InputError(f"{path}: no such file; allowed: the log of a run (HDF5){hint}")
        with open_hdf5(path, "run log (HDF5 with 't')") as content:
            datasets = dict(content.datasets())
            time = datasets.pop("t")[:]
            signals = {name: _read_signal(dataset) for name, dataset in datasets.items()}
            attributes = {name: str(value) for name, value in content.file.attrs.items()}
            return cls(time, signals, attributes)

    def _check(self, name: str, signal: Signal) -> None:
        """Reject a signal whose number of samples differs from the time axis."""
        if signal.values.shape[0] != self.time.size:
            raise ValueError(
                f"signal {name!r} has {signal.values.shape[0]} samples, time has {self.time.size}"
            )


def peak(values: FloatArray) -> float:
    """Return the largest value, NaN of none."""
    return float(np.max(values)) if values.size else np.nan


def _as_columns(values: ArrayLike) -> FloatArray:
    """Return values as [samples, dim]; a vector becomes one column, integers remain integers."""
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        array = array.astype(float)
    return array[:, np.newaxis] if array.ndim == 1 else array


def _read_signal(dataset: h5py.Dataset) -> Signal:
    """Return one signal from its dataset."""
    labels = [str(label) for label in dataset.attrs["labels"]]
    limits = dataset.attrs.get("limits")
    return Signal(dataset[:], str(dataset.attrs["unit"]), labels, limits)
