"""Templates of pages, in files of this folder; all text that is filled in is escaped."""

from base64 import b64encode
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from reporting.metrics import Metric, format_quantity
from reporting.registry import known_metric

_SYMBOLS = {"<=": "≤", ">=": "≥"}
_SIGNS = {"met": "✓", "missed": "✗", "no value": "✗"}


def fill(template: str, **values: Any) -> str:
    """Return a template with its values.

    Args:
        template: Name of its file.
        values: What it is filled with.
    """
    return _environment().get_template(template).render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        autoescape=True,
        loader=FileSystemLoader(Path(__file__).parent),
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {
        "base64": lambda data: b64encode(data.encode() if isinstance(data, str) else data).decode(),
        "bound": _bound,
        "spoken": _spoken,
        "value": lambda metric: format_quantity(metric.value, metric.unit),
    }
    environment.globals |= {"known_metric": known_metric, "signs": _SIGNS}
    return environment


def _bound(metric: Metric, space: str) -> str:
    """Return the target in the unit of the metric, as text where it is no comparison."""
    if metric.bound is None:
        return metric.target or ""
    comparison, number = metric.bound
    symbol = _SYMBOLS.get(comparison, comparison)
    return f"{symbol}{space}{format_quantity(number, metric.unit)}"


def _spoken(name: str, unit: str = "") -> str:
    """``controller_tick_us_p99`` in ``us`` as ``Controller tick p99``; a torque in N is a force."""
    words = " ".join(word for word in name.split("_") if word and word != unit)
    if unit == "N":
        words = words.replace("torque", "force")
    return words[:1].upper() + words[1:]
