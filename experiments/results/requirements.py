"""Requirements of a run: targets checked before it, and which of them it missed.

A requirement is a metric with a target that can be compared: those that a scenario names in
``targets``, and those that features have in every run. They are measured on the ground truth, not
on what the controller measures or commands.
"""

import math

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.features import FEATURES
from experiments.results.run_signals import expected_signals
from pfsc_drake.errors import InputError, did_you_mean
from reporting.metrics import Metric, Metrics, format_quantity
from reporting.registry import possible_metrics

# metrics that only grow while a run lasts, or only fall, by how their names begin
_GROWING = (
    *("max_", "peak_", "largest_", "deepest_", "audit_", "rest_", "joint_velocity_share"),
    *("limit_reversals", "saturated_samples", "clipped_ticks", "missed_ticks", "waited_time"),
)
_FALLING = ("least_", "joint_limit_margin", "slide_limit_margin")
# errors of the last sample, the worst of all axes
_OF_THE_END = ("max_coulomb_error", "max_viscous_error")
# signals that another law may log on the same robot
_OF_OTHER_LAWS = {"xi_M", "eta_dot", "tau_d"}
# how far a tool is from where it should be, the first of them that a run has, and from when on
# that is worth a word [m]
_DISTANCES = ("max_error_from_compliant_reference", "max_path_deviation")
_WORTH_A_WORD = 1e-3


def check_targets(settings: Scenario, station: Station) -> None:
    """Refuse targets for metrics that a run with their law would not have.

    Args:
        settings: The scenario.
        station: Its station.

    Raises:
        InputError: One line that names law, metric and the metrics that there are.
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
    """Give metrics their targets: those of every run, then those of the scenario.

    Args:
        metrics: Metrics of the run.
        settings: Its scenario.
    """
    own = settings.targets.get(settings.controller.law, {})
    for targets in (*(feature.requirements(settings) for feature in FEATURES), own):
        for name, target in targets.items():
            # what another choice of options would measure has been checked, and is no metric here
            if name in metrics:
                metrics.set_target(name, target.bound, target.source)


def missed_targets(metrics: Metrics) -> list[str]:
    """Return the targets that were missed, one phrase each.

    Args:
        metrics: With their targets. One without a value has missed its target, unless it is
            not judged.
    """
    return [
        _phrase(name, metric)
        for name, metric in metrics.items()
        if metric.passed is False and metric.judged
    ]


def leave_unjudged(metrics: Metrics, *, fault: bool) -> None:
    """Take back the verdict on metrics for which a run that was cut short is too short.

    It is judged by what holds at every instant, and by extremes that have passed their bound:
    nothing that follows could mend them. After a fault the tool does not follow its reference,
    so that extremes do not count.

    Args:
        metrics: With their targets.
        fault: Whether a fault cut it short.
    """
    always = {name for feature in FEATURES for name in feature.always}
    for name, metric in metrics.items():
        if metric.bound is not None:
            at_all_times = name in always and not math.isnan(metric.value)
            extreme = not fault and _is_exceeded_extreme(name, metric)
            metric.judged = at_all_times or extreme


def _is_exceeded_extreme(name: str, metric: Metric) -> bool:
    """Whether a metric has passed a bound that it cannot come back to."""
    assert metric.bound is not None
    begins = _GROWING if metric.bound[0].startswith("<") else _FALLING
    extreme = name.startswith(begins) and name not in _OF_THE_END
    return extreme and metric.passed is False and not math.isnan(metric.value)


def unjudged_distance(metrics: Metrics, law: str) -> list[str]:
    """Return what there is to say of a tool that was far from where no target wants it nearer.

    Args:
        metrics: With their targets.
        law: That moved the tool.
    """
    name = next((name for name in _DISTANCES if name in metrics), None)
    if name is None or metrics[name].target is not None or not metrics[name].value > _WORTH_A_WORD:
        return []
    far = format_quantity(metrics[name].value, "m")
    return [
        f"the tool was up to {far} from where it should be ({name}), and no target says whether "
        f"that is too far: with targets: {{{law}: {{{name}: {{bound: '< 1e-3'}}}}}} such a run "
        "ends with status 3"
    ]


def _phrase(name: str, metric: Metric) -> str:
    """Return what was missed, with its target."""
    assert metric.bound is not None
    comparison, number = metric.bound
    target = f"target {comparison} {format_quantity(number, metric.unit)}"
    if math.isnan(metric.value):
        return f"{name} has no value, {target}"
    why = f" ({metric.source})" if name == "arrived" and metric.source else ""
    return f"{name} = {format_quantity(metric.value, metric.unit)}, {target}{why}"
