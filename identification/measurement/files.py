"""Records as files: CSV, HDF5 and MATLAB's MAT.

All of them contain the time ``t`` and per joint ``q`` and ``tau``, optionally ``v``, ``a``
and ``q_motor``, with their units:

- CSV: a column for each joint under a line of names and units, ``t [s], q_1 [rad], tau_1
  [Nm]``; a joint's own name may replace its number, ``q_elbow [deg]``. The comment ``# period
  [s] = 10`` contains the period.
- HDF5: datasets ``t``, ``q`` ... of shape (K, N), or of single joints, with the attributes ``unit``
  (one, or one for each column) and, if there are other columns than N in the robot's order,
  ``labels`` (joints by name or number); attribute ``period`` of the file [s].
- MAT (to version 7.2): arrays of the same names, a struct ``units`` with the same fields,
  optionally ``joint_names`` and ``period``.
"""

import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import loadmat, savemat

from identification.measurement.columns import RawSignal, Reading, make_record, parse_name, si_unit
from identification.measurement.record import SIGNALS, Record, check_record
from identification.measurement.synchronization import check_velocities
from identification.model.subject import Subject
from identification.output import write_bytes
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.geometry.files.number_table import read_numbers, read_regular_file, unreadable
from reporting.hdf5_reading import open_hdf5

_HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
_PERIOD = re.compile(r"#\s*period\s*\[s\]\s*=\s*(\S+)\s*")
_FORMATS = {".csv": "csv", ".h5": "hdf5", ".hdf5": "hdf5", ".mat": "mat"}
# of a MAT file beside signals
_NOT_SIGNALS = ("units", "joint_names", "period")

Raw = tuple[list[RawSignal], float | None]


def read_record(
    path: str | Path,
    robot: Subject,
    period: float | None = None,
    reading: Reading | None = None,
    *,
    still: bool = False,
) -> Record:
    """Read a record and check it.

    Args:
        path: Path of a file as described above; its suffix decides its kind.
        robot: Robot of the record.
        period: Period of the motion [s], if the file does not state it.
        reading: Names and units that the file lacks or spells otherwise.
        still: Whether the links may stand still, as those of locked joints do.

    Returns:
        The record in SI units, checked by :func:`~identification.measurement.record.check_record`
        and :func:`~identification.measurement.synchronization.check_velocities`.

    Raises:
        InputError: If the file cannot be read, signals are missing, unknown or without a unit, or
            the record is not valid.
    """
    readers: dict[str, Callable[[Path], Raw]] = {
        "csv": _read_csv,
        "hdf5": _read_hdf5,
        "mat": _read_mat,
    }
    signals, stated = readers[_kind(path)](Path(path))
    if stated is not None and period is not None and not np.isclose(stated, period, rtol=1e-9):
        raise InputError(f"{path}: period [s] = {stated:g}; one of {period:g} s was given")
    period = stated if period is None else period
    record = make_record(signals, robot, period, reading or Reading(), str(path))
    check_record(record, robot, still)
    check_velocities(record)
    return record


def write_record(path: str | Path, record: Record, robot: Subject) -> None:
    """Write a record with all its signals.

    Args:
        path: Path of the file; its suffix decides its kind.
        record: The record.
        robot: Robot of the record.

    Raises:
        InputError: If the suffix is of no known kind, or the path is not possible.
        WriteError: If the disk is full.
    """
    kind = _kind(path)
    signals = {s: getattr(record, s) for s in SIGNALS if getattr(record, s) is not None}
    units = {s: [si_unit(s, unit) for unit in robot.joint_units] for s in signals}
    file = BytesIO()  # HDF5 reports a full disk in its own words
    if kind == "csv":
        _write_csv(file, record, signals, units)
    elif kind == "hdf5":
        _write_hdf5(file, record, signals, units)
    else:
        content: dict[str, Any] = {"t": record.t, **signals}
        content["units"] = {"t": "s"} | {s: np.array(u, object) for s, u in units.items()}
        content["joint_names"] = np.array(record.joint_names, object)
        if record.period is not None:
            content["period"] = record.period
        savemat(file, content, oned_as="column")
    write_bytes(Path(path), file.getvalue())


def _kind(path: str | Path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise InputError(f"{path}: suffix '{suffix}'; allowed: {', '.join(_FORMATS)}")
    return _FORMATS[suffix]


def _read_csv(path: Path) -> Raw:
    headers: list[tuple[str, str]] = []

    def check_header(location: str, names: list[str]) -> None:
        for name in names:
            found = _HEADER.fullmatch(name)
            if found is None:
                raise InputError(
                    f"{location}: column '{shorten(name)}'; must be a name and a unit, as "
                    "'q_1 [rad]'"
                )
            headers.append((found["name"].strip(), (found["unit"] or "").strip()))

    table = read_numbers(str(path), "samples", check_header)
    signals = [
        RawSignal(name, column, [unit] if unit else [])
        for (name, unit), column in zip(headers, table.rows.T, strict=True)
    ]
    return signals, _csv_period(path)


def _csv_period(path: Path) -> float | None:
    with path.open(encoding="utf-8-sig") as file:
        for line in file:
            if not line.startswith("#"):
                return None
            if found := _PERIOD.fullmatch(line):
                return _number(found[1], f"{path}, period")
    return None


def _number(value: Any, where: str) -> float:
    try:
        return float(np.asarray(value).item())
    except (TypeError, ValueError):
        raise InputError(f"{where}: {shorten(repr(value))}; must be a number") from None


def _read_hdf5(path: Path) -> Raw:
    read_regular_file(path, "HDF5")
    with open_hdf5(path, "HDF5 file") as content:
        period = content.file.attrs.get("period")
        signals = [
            RawSignal(
                name,
                _numbers(dataset[()], f"'{name}'"),
                _words(dataset.attrs.get("unit")),
                _words(dataset.attrs.get("labels")),
            )
            for name, dataset in content.datasets()
        ]
    return signals, None if period is None else _number(period, f"{path}, period")


def _read_mat(path: Path) -> Raw:
    read_regular_file(path, "MAT")
    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise unreadable(path, "MAT", "of MATLAB version 7.3; save it with '-v7'") from None
    except Exception:  # of any kind for other files
        raise unreadable(path, "MAT", "not a MAT file") from None
    units, joints = content.get("units", {}), _words(content.get("joint_names"))
    if not isinstance(units, dict):
        raise InputError(f"{path}, units: no struct; must have a field for each signal")
    signals = []
    for name, values in content.items():
        if name.startswith("__") or name in _NOT_SIGNALS:
            continue
        of_all = (parse_name(name) or ("", "?"))[1] == ""
        raw = _numbers(values, f"{path}, {name}")
        signals.append(RawSignal(name, raw, _words(units.get(name)), joints if of_all else ()))
    period = content.get("period")
    return signals, None if period is None else _number(period, f"{path}, period")


def _numbers(values: Any, where: str) -> np.ndarray:
    array = np.asarray(values)
    if array.dtype.kind not in "fiu" or array.ndim not in (1, 2):
        raise InputError(
            f"{where}: {array.dtype} of shape {array.shape}; must be numbers, samples by joints"
        )
    return array.astype(float)


def _words(value: Any) -> list[str]:
    """Return one word or several as text; none if there is nothing."""
    if value is None:
        return []
    words = [value] if isinstance(value, str | bytes) else np.asarray(value).ravel().tolist()
    return [word.decode() if isinstance(word, bytes) else str(word) for word in words]


def _write_csv(
    file: BytesIO, record: Record, signals: dict[str, np.ndarray], units: dict[str, list[str]]
) -> None:
    names = ["t [s]"]
    for signal in signals:
        names += [f"{signal}_{j + 1} [{unit}]" for j, unit in enumerate(units[signal])]
    head = "" if record.period is None else f"# period [s] = {record.period!r}\n"
    rows = np.column_stack([record.t, *signals.values()])
    header = head + ", ".join(names)
    np.savetxt(file, rows, fmt="%.12g", delimiter=", ", header=header, comments="")


def _write_hdf5(
    file: BytesIO, record: Record, signals: dict[str, np.ndarray], units: dict[str, list[str]]
) -> None:
    with h5py.File(file, "w") as content:
        content.create_dataset("t", data=record.t).attrs["unit"] = "s"
        for signal, values in signals.items():
            dataset = content.create_dataset(signal, data=values)
            dataset.attrs["unit"] = units[signal]
            dataset.attrs["labels"] = list(record.joint_names)
        if record.period is not None:
            content.attrs["period"] = record.period
