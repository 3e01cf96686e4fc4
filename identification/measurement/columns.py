"""Records from named signals with units, for any kind of file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from identification.measurement.record import REQUIRED_SIGNALS, SIGNALS, Record
from identification.model.subject import Subject
from pfsc_drake.errors import InputError, in_one_line, shorten, suggestion

_TURN = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi}
_LENGTH = {"m": 1.0, "mm": 1e-3}
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_RATES: dict[str, dict[str, float]] = {
    "rad": {f"{unit}/s": factor for unit, factor in _TURN.items()} | {"rpm": np.pi / 30.0},
    "m": {f"{unit}/s": factor for unit, factor in _LENGTH.items()},
}
_SECOND_RATES = {
    "rad": {f"{unit}/s^2": factor for unit, factor in _TURN.items()},
    "m": {f"{unit}/s^2": factor for unit, factor in _LENGTH.items()},
}
_POSITIONS = {"rad": _TURN, "m": _LENGTH}
_EFFORTS = {
    "rad": {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3},
    "m": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
_OF_SIGNAL = {
    "q": _POSITIONS,
    "q_motor": _POSITIONS,
    "v": _RATES,
    "a": _SECOND_RATES,
    "tau": _EFFORTS,
}


def si_unit(signal: str, joint_unit: str) -> str:
    """Return a signal's unit in records.

    Args:
        signal: Signal of a record, or ``t``.
        joint_unit: ``rad`` or ``m``.
    """
    return "s" if signal == "t" else next(iter(_OF_SIGNAL[signal][joint_unit]))


def to_si(signal: str, joint_unit: str, unit: str, scale: float | None, where: str) -> float:
    """Return the factor of a signal to SI units on the joint side.

    Args:
        signal: Signal of a record, or ``t``.
        joint_unit: ``rad`` or ``m``.
        unit: Unit in the file.
        scale: SI units per unit of the file, for a unit without fixed size, such as ``counts`` or
            ``A``; None for others.
        where: File and name of the signal, for messages.

    Raises:
        InputError: If the unit is not one of the signal's and there is no scale, or if there is one
            although the unit needs none.
    """
    known: Mapping[str, float] = _TIME if signal == "t" else _OF_SIGNAL[signal][joint_unit]
    if unit in known:
        if scale is not None:
            raise InputError(
                f"{where}: unit [{unit}] with a scale of {scale:g}; a scale is allowed only for "
                "units without fixed size, such as [counts]"
            )
        return known[unit]
    if scale is None:
        raise InputError(
            f"{where}: unit [{unit}]; allowed: {', '.join(known)}, or another one with a scale, "
            f"in {si_unit(signal, joint_unit)} per {unit or 'unit'}"
        )
    if not np.isfinite(scale) or scale == 0.0:
        raise InputError(f"{where}: scale = {scale}; must be finite and not 0")
    return float(scale)


TIME = "t"
# q_motor before q
_NAME = re.compile(rf"({'|'.join(sorted(SIGNALS, key=len, reverse=True))})(?:_(.+))?", re.ASCII)
_MOST_NAMES = 12


@dataclass(frozen=True)
class Reading:
    """Names and units that a file lacks or spells otherwise.

    Signals are named as in :mod:`~identification.measurement.files`: ``q`` for all joints,
    ``q_2`` or ``q_<joint name>`` for one.

    Attributes:
        names: Signal by name in the file, for files with other names; all other columns of such a
            file are left out.
        units: Unit by signal, for files without units.
        scale: SI units per unit of the file by signal, for units like ``counts`` or ``A``.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)


class RawSignal(NamedTuple):
    """A signal from a file.

    Attributes:
        name: Name in the file.
        values: Shape (K,), or (K, m) for several joints.
        units: One for each column; empty if the file has none.
        joints: Joints by name or number; empty if the file has none.
    """

    name: str
    values: np.ndarray
    units: Sequence[str] = ()
    joints: Sequence[str] = ()


def parse_name(name: str) -> tuple[str, str] | None:
    """Return the signal and joint of a name, joint empty for all joints; None if unknown."""
    if name == TIME:
        return TIME, ""
    found = _NAME.fullmatch(name)
    return None if found is None else (found[1], found[2] or "")


def make_record(
    signals: Sequence[RawSignal],
    robot: Subject,
    period: float | None,
    reading: Reading,
    source: str,
) -> Record:
    """Return the record of a file's signals.

    Args:
        signals: Signals of the file.
        robot: Robot of the signals.
        period: Period of the motion [s], or None.
        reading: Names and units that the file lacks.
        source: Name of the file.

    Raises:
        InputError: If a signal is unknown, missing, repeated, or of another robot, or its unit is
            missing or not one of its own.
    """
    table = _Table(robot, reading, source)
    for signal in signals:
        table.add(signal)
    return table.record(period)


class _Table:
    """Columns of a record, by signal and joint."""

    def __init__(self, robot: Subject, reading: Reading, source: str) -> None:
        self._robot, self._reading, self._source = robot, reading, source
        self._columns: dict[tuple[str, int], np.ndarray] = {}
        self._without_unit: list[tuple[str, int]] = []
        self._problems: list[str] = []  # as continuations of the file's name
        self._unused = {
            option: set(getattr(reading, option)) for option in ("names", "units", "scale")
        }

    def add(self, raw: RawSignal) -> None:
        """Add a signal of the file."""
        self._unused["names"].discard(raw.name)
        name = self._reading.names.get(raw.name, raw.name)
        parsed = parse_name(name)
        if parsed is None:
            if self._reading.names and raw.name not in self._reading.names:
                return
            joints = range(len(self._robot.joint_names))
            known = [self._label(signal, i) for signal in SIGNALS for i in joints]
            self._problems.append(
                f": '{shorten(name)}' is unknown; allowed: t, "
                f"{', '.join(f'{signal}_1' for signal in SIGNALS)} and so on, or names that are "
                f"said to mean these{suggestion(name, known)}"
            )
            return
        signal, joint = parsed
        columns = raw.values[:, None] if raw.values.ndim == 1 else raw.values
        for i, column in enumerate(columns.T):
            index = 0 if signal == TIME else self._joint(raw, name, joint, i, columns.shape[1])
            key = (signal, index)
            label = self._label(signal, index)
            if key in self._columns:
                self._problems.append(f": {label} twice; once is allowed")
                continue
            unit = raw.units[min(i, len(raw.units) - 1)] if raw.units else ""
            self._columns[key] = column
            try:
                self._columns[key] = column * self._factor(signal, index, unit)
            except InputError as error:
                self._problems.append(f", {error}")

    def _joint(self, raw: RawSignal, name: str, joint: str, column: int, width: int) -> int:
        """Return the joint of a column, from 0."""
        names, n = list(self._robot.joint_names), len(self._robot.joint_names)
        if not joint:
            if raw.joints:
                joint = raw.joints[column] if column < len(raw.joints) else "?"
                joint = joint.removeprefix(f"{raw.name}_")
            elif width == n:
                return column
            else:
                raise InputError(
                    f"{self._source}: {name} has {width} columns; {self._robot.name} has the {n} "
                    f"joints {', '.join(names[:_MOST_NAMES])}"
                )
        if joint in names:
            return names.index(joint)
        if joint.isdecimal() and 1 <= int(joint) <= n:
            return int(joint) - 1
        raise InputError(
            f"{self._source}: {name} is of joint '{shorten(joint)}'; {self._robot.name} has the "
            f"joints 1 to {n}: {', '.join(names[:_MOST_NAMES])}"
        )

    def _label(self, signal: str, index: int) -> str:
        return TIME if signal == TIME else f"{signal}_{index + 1}"

    def _option(self, option: str, signal: str, index: int) -> str | float | None:
        """Return the user's option for a column."""
        values: Mapping[str, str | float] = getattr(self._reading, option)
        own = f"{signal}_{self._robot.joint_names[index]}"
        for key in (self._label(signal, index), own, signal):
            # q of a joint 'motor_2' is not q_motor of joint 2
            if key in values and (parse_name(key) or ("",))[0] == signal:
                self._unused[option].discard(key)
                return values[key]
        return None

    def _factor(self, signal: str, index: int, stated: str) -> float:
        label, option = self._label(signal, index), self._option("units", signal, index)
        if stated and option and stated != option:
            raise InputError(f"{label}: the file says [{stated}]; a unit of [{option}] was given")
        unit = str(option or stated)
        scale = self._option("scale", signal, index)
        if not unit and scale is None:
            self._without_unit.append((signal, index))
            return 1.0
        joint_unit = self._robot.joint_units[index]
        return to_si(signal, joint_unit, unit, None if scale is None else float(scale), label)

    def _refuse(self, problems: Sequence[str]) -> None:
        """Refuse all problems in one line, if there are any."""
        if len(problems) == 1:
            raise InputError(f"{self._source}{problems[0]}")
        if problems:
            lines = [problem.lstrip(":, ") for problem in problems]
            raise InputError(f"{self._source}: {in_one_line(lines)}")

    def _unstated(self) -> list[str]:
        """Return the message about columns with unknown units, for all of them together."""
        if self._without_unit:
            labels = ", ".join(self._label(*column) for column in self._without_unit)
            alike = len(set(self._robot.joint_units)) == 1
            units = {
                signal if alike else self._label(signal, index): si_unit(
                    signal, self._robot.joint_units[index]
                )
                for signal, index in self._without_unit
            }
            options = " ".join(f"--unit {name}={unit}" for name, unit in units.items())
            return [
                f": {labels}: no unit is stated; each must be, as in 'tau_1 [Nm]', "
                f"or by options like {options}"
            ]
        return []

    def record(self, period: float | None) -> Record:
        """Return the record."""
        self._refuse([*self._problems, *self._unused_options(), *self._unstated()])
        names = tuple(self._robot.joint_names)
        lacking = [] if (TIME, 0) in self._columns else [": no time; 't [s]' is required"]
        values: dict[str, np.ndarray] = {}
        for signal in SIGNALS:
            there = [j for j in range(len(names)) if (signal, j) in self._columns]
            if not there and signal not in REQUIRED_SIGNALS:
                continue
            missing = [j for j in range(len(names)) if j not in there]
            if missing:
                labels = ", ".join(f"{signal}_{j + 1} ({names[j]})" for j in missing)
                lacking.append(
                    f": no {labels}; {signal} of all {len(names)} joints of "
                    f"{self._robot.name} is required"
                )
                continue
            values[signal] = np.column_stack([self._columns[signal, j] for j in there])
        self._refuse(lacking)
        return Record(
            self._columns[TIME, 0],
            values["q"],
            values["tau"],
            names,
            period,
            values.get("v"),
            values.get("a"),
            values.get("q_motor"),
            self._source,
        )

    def _unused_options(self) -> list[str]:
        return [
            f": {option} of '{shorten(sorted(keys)[0])}' given, which the file does not have; "
            "must be of something in it"
            for option, keys in self._unused.items()
            if keys
        ]
