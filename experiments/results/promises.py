"""What a run promises, and which of it was broken.

A promise is a metric with a target that can be compared: those that a scenario names in
``targets``, and those that every run makes. They are measured on the truth, not on what the
controller believes or asks for.
"""

import math

from diagrams.scenario import Scenario
from reporting.metrics import Metric, Metrics
from reporting.units import format_quantity

# held at every instant, so that also a run that was cut short is judged by them
_ALWAYS = ("deepest_violation", "max_unanswered_force")


def set_promises(metrics: Metrics, settings: Scenario) -> None:
    """Give metrics their targets: what every run promises, then what the scenario says.

    Args:
        metrics: Of the run.
        settings: Its scenario.
    """
    if settings.fixtures is not None and "deepest_violation" in metrics:
        bound = f"<= {settings.fixtures.bound:g}"
        metrics.set_target("deepest_violation", bound, "fixtures.bound")
    if settings.compliance.needs_sensor and "max_unanswered_force" in metrics:
        # what is less would be taken for a bias
        bound = f"<= {settings.sensor.taring_spread[:3].max():g}"
        metrics.set_target("max_unanswered_force", bound, "sensor.taring_spread")
    for name, target in settings.targets.get(settings.controller.law, {}).items():
        # what another choice of the controller would tell has been checked, and is no metric here
        if name in metrics:
            metrics.set_target(name, target.bound, target.source)


def broken_promises(metrics: Metrics, *, whole: bool) -> list[str]:
    """Return what was promised and not kept, one phrase each.

    Args:
        metrics: With their targets. One without a value has missed its target.
        whole: Whether the run lasted as long as its scenario, without a fault. Of others only
            those promises count that hold at every instant.
    """
    return [
        _phrase(name, metric)
        for name, metric in metrics.items()
        if metric.passed is False and (whole or name in _ALWAYS)
    ]


def _phrase(name: str, metric: Metric) -> str:
    """Return what was missed, with its target."""
    assert metric.bound is not None
    comparison, number = metric.bound
    target = f"target {comparison} {format_quantity(number, metric.unit)}"
    if math.isnan(metric.value):
        return f"{name} has no value, {target}"
    return f"{name} = {format_quantity(metric.value, metric.unit)}, {target}"
