"""Requirements of a run: check of targets before it, and missed targets after it.

A requirement is a metric with a target: those in a scenario's ``targets``, and those of features
for every run. Metrics refer to ground truth, not to measurements or commands of the controller.
"""

import math

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.features import FEATURES
from experiments.results.run_signals import expected_signals
from pfsc_drake.errors import InputError, did_you_mean
from reporting.metrics import Metric, Metrics, format_quantity
from reporting.registry import possible_metrics

# prefixes of metrics that only increase or only decrease during a run
_GROWING = (
    *("max_", "peak_", "largest_", "deepest_", "audit_", "rest_", "joint_velocity_share"),
    *("limit_reversals", "saturated_samples", "clipped_ticks", "missed_ticks", "waited_time"),
)
_FALLING = ("least_", "joint_limit_margin", "slide_limit_margin")
# errors of the last sample, worst axis
_OF_THE_END = ("max_coulomb_error", "max_viscous_error")
# signals that another law may log on the same robot
_OF_OTHER_LAWS = {"xi_M", "eta_dot", "tau_d"}
# how far a tool is from where it should be, the first of them that a run has, and from when on
# that is worth a word [m]
_DISTANCES = ("max_error_from_compliant_reference", "max_path_deviation")
_WORTH_A_WORD = 1e-3


def check_targets(settings: Scenario, station: Station) -> None:
    """Reject targets for metrics that do not exist with their law.

    Args:
        settings: The scenario.
        station: Its station.

    Raises:
        InputError: With law, metric and the available metrics.
    """
    if not settings.targets:
        return
    known = expected_signals(station)
    for feature in FEATURES:
        known.update(feature.known(station, settings))
    for law, targets in settings.targets.items():
        other = set() if law == settings.controller.law else _OF_OTHER_LAWS
        allowed = possible_metrics(known | other, station.robot.dimension)
        for name in targets:
            if name not in allowed:
                raise InputError(
                    f"targets.{law}.{name}: no such metric; {did_you_mean(name, allowed)}"
                    f"allowed: {', '.join(allowed)}"
                )


def set_targets(metrics: Metrics, settings: Scenario) -> None:
    """Set targets of metrics: those of every run, then those of the scenario.

    Args:
        metrics: Metrics of the run.
        settings: Its scenario.
    """
    own = settings.targets.get(settings.controller.law, {})
    for targets in (*(feature.requirements(settings) for feature in FEATURES), own):
        for name, target in targets.items():
            # checked metrics of other options do not exist in this run
            if name in metrics:
                metrics.set_target(name, target.bound, target.source)


def missed_targets(metrics: Metrics) -> list[str]:
    """Return the targets that were missed, one phrase each.

    Args:
        metrics: Metrics with targets. A metric without value misses its target, unless it is not
            judged.
    """
    return [
        _phrase(name, metric)
        for name, metric in metrics.items()
        if metric.passed is False and metric.judged
    ]


def leave_unjudged(metrics: Metrics, *, fault: bool) -> None:
    """Withdraw the verdict on metrics that an incomplete run does not determine.

    It is judged by requirements at every instant, and by extremes beyond their bound, which cannot
    recover. After a fault the tool does not follow its reference, so that extremes do not count.

    Args:
        metrics: Metrics with targets.
        fault: Whether a fault ended the run early.
    """
    always = {name for feature in FEATURES for name in feature.always}
    for name, metric in metrics.items():
        if metric.bound is not None:
            at_all_times = name in always and not math.isnan(metric.value)
            extreme = not fault and _is_exceeded_extreme(name, metric)
            metric.judged = at_all_times or extreme


def _is_exceeded_extreme(name: str, metric: Metric) -> bool:
    """Return whether a monotonic metric has exceeded its bound."""
    assert metric.bound is not None
    begins = _GROWING if metric.bound[0].startswith("<") else _FALLING
    extreme = name.startswith(begins) and name not in _OF_THE_END
    return extreme and metric.passed is False and not math.isnan(metric.value)


def unjudged_distance(metrics: Metrics, law: str) -> list[str]:
    """Return a warning about a large deviation of the tool without target.

    Args:
        metrics: Metrics with targets.
        law: Name of the control law.
    """
    name = next((name for name in _DISTANCES if name in metrics), None)
    if name is None or metrics[name].target is not None or not metrics[name].value > _WORTH_A_WORD:
        return []
    far = format_quantity(metrics[name].value, "m")
    return [
        f"the tool deviated by up to {far} ({name}), and there is no target to judge this: with "
        f"targets: {{{law}: {{{name}: {{bound: '< 1e-3'}}}}}} such a run "
        "ends with status 3"
    ]


def _phrase(name: str, metric: Metric) -> str:
    """Return a missed metric with its target as a phrase."""
    assert metric.bound is not None
    comparison, number = metric.bound
    target = f"target {comparison} {format_quantity(number, metric.unit)}"
    if math.isnan(metric.value):
        return f"{name} has no value, {target}"
    why = f" ({metric.source})" if name == "arrived" and metric.source else ""
    return f"{name} = {format_quantity(metric.value, metric.unit)}, {target}{why}"
