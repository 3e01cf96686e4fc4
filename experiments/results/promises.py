"""What a run promises: targets checked before it, and which of them it broke.

A promise is a metric with a target that can be compared: those that a scenario names in
``targets``, and those that every run makes. They are measured on the truth, not on what the
controller believes or asks for.
"""

import math

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.drives import JointLimits, plan_metrics
from experiments.results.path import shape_metrics
from experiments.results.pushes import is_redundant
from experiments.results.run_signals import expected_signals
from pfsc_drake.errors import InputError
from reporting.metrics import Metric, Metrics, format_quantity
from reporting.registry import possible_metrics

# held at every instant, so that also a run that was cut short is judged by them
_ALWAYS = ("deepest_violation", "max_unanswered_force")
# how far a tool is from where it should be, the first of them that a run has, and from when on
# that is worth a word [m]
_DISTANCES = ("max_error_from_compliant_reference", "max_path_deviation")
_WORTH_A_WORD = 1e-3
# signals that another law may log on the same robot
_OF_OTHER_LAWS = {"xi_M", "eta_dot", "tau_d"}
# signals of an orientation, which may be no task
_OF_ORIENTATIONS = {"phi"}
# signals of an observer, which may be left out
_OF_OBSERVERS = {"tau_f", "friction_estimate", "f_c", "f_c_estimate", "f_v", "f_v_estimate"}


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
    task, surface = station.task, settings.surface
    signals = expected_signals(station) | _OF_OBSERVERS
    if settings.path.orientation.task == "none" or (surface and surface.orientation.kind == "none"):
        signals |= _OF_ORIENTATIONS
    properties = {"redundant": is_redundant(station), "closed": task.lap is not None}
    known = {
        *signals,
        *(name for name, is_so in properties.items() if is_so),
        *shape_metrics(task.shape, task.fit),
        *plan_metrics(task.drive_plan),
        *JointLimits.of(station.robot).metric_names(),
    }
    for law, targets in settings.targets.items():
        other = set() if law == settings.controller.law else _OF_OTHER_LAWS
        allowed = possible_metrics(known | other, station.robot.dimension)
        for name in targets:
            if name not in allowed:
                raise InputError(
                    f"targets.{law}.{name}: no such metric; allowed: {', '.join(allowed)}"
                )


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


def unpromised_distance(metrics: Metrics, law: str) -> list[str]:
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
    return f"{name} = {format_quantity(metric.value, metric.unit)}, {target}"
