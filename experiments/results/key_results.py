"""Key results of a run: requirements, deviation, duration, and saturation of the drives."""

import math

from experiments.results.run_log import RunLog
from reporting.metrics import NARROW_SPACE, Metric, Metrics, format_quantity
from reporting.page import Fact

_REQUIREMENTS = 5  # at most, missed ones first
# deviation of the tool, the first with a value
_DEVIATIONS = (
    "max_error_from_compliant_reference",
    "max_path_deviation",
    "deepest_violation",
    "following_error",
    "static_path_deviation",
)
_SLOWER, _COMPLETE = 0.95, 0.999  # shares


def key_metrics(metrics: Metrics) -> list[str]:
    """Return the names of the key metrics: those with a target, and the deviation of the tool.

    Missed targets come first. Of the others, only five with the missed ones are taken.

    Args:
        metrics: All metrics of the run, with targets.
    """
    required = [name for name, metric in metrics.items() if metric.target is not None]
    required.sort(key=lambda name: _is_met(metrics[name]))
    missed = [name for name in required if not _is_met(metrics[name])]
    chosen = required[: max(_REQUIREMENTS, len(missed))]
    known = (name for name in _DEVIATIONS if name in metrics)
    deviation = next((name for name in known if math.isfinite(metrics[name].value)), None)
    return chosen if deviation is None or deviation in chosen else [*chosen, deviation]


def _is_met(metric: Metric) -> bool:
    return metric.verdict not in ("missed", "no value")


def key_facts(log: RunLog, metrics: Metrics, planned: float, *, simulated: bool) -> list[Fact]:
    """Return duration and saturation of a run.

    Args:
        log: Log of the run.
        metrics: All metrics of the run.
        planned: Planned duration [s].
        simulated: Whether the robot was simulated.
    """
    notes = [] if log.end > _COMPLETE * planned else [f"of {format_quantity(planned, 's')}"]
    if simulated and "real_time_factor" in metrics:
        notes.append(f"simulated at {_speed(metrics['real_time_factor'].value)}")
    facts = [Fact("Duration", format_quantity(log.end, "s"), ", ".join(notes))]
    if "saturated_samples" in metrics:
        count, share = metrics["saturated_samples"].value, metrics["saturated_share"].value
        if count:
            value, note = f"{100.0 * share:.2g}{NARROW_SPACE}%", f"of the run, {count:.0f} samples"
        else:
            value, note = "none", "no drive reached its limit"
        facts.append(Fact("Saturated drives", value, note))
    return facts


def _speed(factor: float) -> str:
    """Return simulated time over real time in words."""
    number = f"{factor:.2g}" if factor < 1.0 else f"{factor:.1f}"
    return f"{number} times real time" + (", slower than the robot" if factor < _SLOWER else "")
