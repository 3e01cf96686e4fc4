"""Metrics: named numbers with unit and target, their file, and their text form."""

import json
import math
import operator
import re
from collections import UserDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import read_text
from reporting.registry import find_metric

_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_TARGET = re.compile(r"\s*(<=|>=|<|>)\s*(\S+)\s*")
NOT_A_NUMBER = "\u2013"
NARROW_SPACE = "\u202f"
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
# lowest and highest power of ten of a prefix, for units with prefixes
_PREFIX_RANGE = {"m": (-9, 0), "rad": (-9, 0), "m/s": (-6, 0), "s": (-9, 0), "N": (-3, 3)}
# values below are rounding errors, by unit
_ROUNDING = 1e-12
_ROUNDING_OF = dict.fromkeys(("rad/m", "1/m", "m/s^2", "N", "Nm", "N m", "N/m"), 1e-9)
_SPELLINGS = {"us": "µs", "Nm": "N\u2009m", "N m": "N\u2009m", "1": "", "-": ""}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass
class Metric:
    """A number for the assessment of a run.

    Attributes:
        value: In ``unit``; NaN if the run has none (e.g. it never settled).
        unit: SI unit, e.g. ``"m"``; ``"1"`` without unit.
        target: Target, ``"< 0.05e-3"`` (in ``unit``; also ``<= > >=``) or free text.
        source: Source of the target or the definition, e.g. ``"Sec. 3.8.3"``.
        judged: Whether the run was long enough for the target.
    """

    value: float
    unit: str
    target: str | None = None
    source: str | None = None
    judged: bool = True

    @property
    def bound(self) -> tuple[str, float] | None:
        """Comparison and number [unit] of the target, None if it is free text or missing."""
        match = _TARGET.fullmatch(self.target or "")
        if match is None:
            return None
        try:
            return match[1], float(match[2])
        except ValueError:
            return None

    @property
    def passed(self) -> bool | None:
        """Whether the target is met; None without a comparable target. NaN meets no target."""
        if self.bound is None:
            return None
        comparison, number = self.bound
        return _COMPARISONS[comparison](self.value, number)

    @property
    def verdict(self) -> str:
        """``met``, ``missed``, ``no value``, ``not judged``; empty without a comparable target."""
        if self.passed is None:
            return ""
        if not self.judged:
            return "not judged"
        if math.isnan(self.value):
            return "no value"
        return "met" if self.passed else "missed"


class Metrics(UserDict[str, Metric]):
    """Metrics by name, in the order they were added."""

    def add(
        self,
        name: str,
        value: float,
        unit: str | None = None,
        target: str | None = None,
        source: str | None = None,
    ) -> None:
        """Add or replace a metric.

        Args:
            name: Name of the metric.
            value: Value in ``unit``.
            unit: SI unit; unit and source are those of the registry by default.
            target: Largest allowed value; None without one.
            source: Source of the target.
        """
        if unit is None:
            known = find_metric(name)
            if known is None:
                raise KeyError(f"no such metric {name!r} in the registry, and no unit")
            unit, source = known.unit, source or known.source
        self[name] = Metric(float(value), unit, target, source)

    def set_target(self, name: str, target: str, source: str | None = None) -> None:
        """Set the target of an existing metric.

        Args:
            name: Name of the metric.
            target: Target; None without one.
            source: Source of the target; None keeps the metric's source.

        Raises:
            InputError: If there is no metric of this name.
        """
        if name not in self:
            raise InputError(
                f"target {target!r} names an unknown metric {name!r}; known: {', '.join(self)}"
            )
        self[name].target = target
        self[name].source = source or self[name].source

    def write(self, path: Path) -> None:
        """Writes the metrics to a file, see :meth:`to_json`; an existing file is replaced."""
        path.write_text(self.to_json(), encoding="utf-8")

    def to_json(self) -> str:
        """Returns flat JSON ``name: {value, unit, target?, source?}``; NaN, infinity are null."""
        return json.dumps(self.to_data(), indent=2, allow_nan=False) + "\n"

    def to_data(self) -> dict[str, Any]:
        """Returns the content of :meth:`to_json` as data."""
        return {name: _to_json(metric) for name, metric in self.items()}

    @classmethod
    def from_data(cls, flat: dict[str, Any]) -> Self:
        """Returns the metrics of data from :meth:`to_data`; null becomes NaN.

        Raises:
            ValueError, KeyError, TypeError, AttributeError: If it is something else.
        """
        return cls({name: _from_json(entry) for name, entry in flat.items()})

    @classmethod
    def read(cls, path: Path) -> Self:
        """Reads a file of :meth:`write`; null becomes NaN.

        Args:
            path: JSON file.

        Returns:
            The metrics.

        Raises:
            InputError: If the file cannot be read or is not such a file.
        """
        try:
            return cls.from_data(json.loads(read_text(path)))
        except InputError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise InputError(f"{path}: not a readable metrics file: {error!r}") from None


def _to_json(metric: Metric) -> dict[str, Any]:
    """One entry of the file."""
    entry: dict[str, Any] = {
        "value": metric.value if math.isfinite(metric.value) else None,
        "unit": metric.unit,
    }
    if metric.target is not None:
        entry["target"] = metric.target
    if metric.source is not None:
        entry["source"] = metric.source
    return entry


def _from_json(entry: dict[str, Any]) -> Metric:
    """The metric of one entry."""
    value = math.nan if entry["value"] is None else float(entry["value"])
    return Metric(value, entry["unit"], entry.get("target"), entry.get("source"))


def format_quantity(value: float, unit: str) -> str:
    """Formats a value with its unit, e.g. ``0.0000432``, ``"m"`` as ``43.2 µm``.

    Args:
        value: In ``unit``.
        unit: ``"m"``, ``"rad"``, ``"m/s"``, ``"s"``, ``"N"`` get an SI prefix, others are
            unchanged; ``"1"``, ``"-"`` and ``""`` are no unit.

    Returns:
        Text with a narrow no-break space before the unit; an en dash for NaN and infinity; 0 for
            rounding errors.
    """
    if not math.isfinite(value):
        return NOT_A_NUMBER
    if abs(value) < _ROUNDING_OF.get(unit, _ROUNDING):
        value = 0.0
    exponent = _prefix_exponent(value, unit)
    number = _format_number(value / 10.0**exponent)
    symbol = _PREFIXES[exponent] + _SPELLINGS.get(unit, unit)
    return f"{number}{NARROW_SPACE}{symbol}" if symbol else number


def format_cell(value: float) -> str:
    """Format a number of a table: four significant digits, 0 for a rounding error."""
    return f"{0.0 if abs(value) < _ROUNDING else value:.4g}"


def _prefix_exponent(value: float, unit: str) -> int:
    """Return the power of ten of a suitable prefix for a value, 0 for units without prefixes."""
    if unit not in _PREFIX_RANGE or value == 0.0 or not math.isfinite(value):
        return 0
    lowest, highest = _PREFIX_RANGE[unit]
    # Rounded to four digits first: 0.99999e-3 is 1 m..., not 1000 µ...
    decade = math.floor(math.log10(float(f"{abs(value):.3e}")))
    return min(max(3 * (decade // 3), lowest), highest)


def _format_number(value: float) -> str:
    """Return four significant digits without trailing zeros; integers in full up to a million."""
    if float(value).is_integer() and abs(value) < 1e6:
        return f"{value:.0f}"
    if 1e-3 <= abs(value) < 1e6:
        digits = max(0, 3 - math.floor(math.log10(abs(value))))
        text = f"{value:.{digits}f}"
        return text.rstrip("0").rstrip(".") if digits else text
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
