"""Targets of metrics, checked before a run against the metrics that there will be."""

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.friction_metrics import friction_metric_names
from experiments.results.guidance_metrics import guidance_metric_names
from experiments.results.joint_limits import JointLimits
from experiments.results.limit_metrics import limit_metric_names
from experiments.results.link_signals import is_redundant
from experiments.results.mounting_metrics import mounting_metric_names
from experiments.results.path_metrics import metric_names
from experiments.results.posture_metrics import posture_metric_names
from experiments.results.press_metrics import press_metric_names
from experiments.results.run_signals import optional_signals
from experiments.results.shape_metrics import shape_metrics
from pfsc_drake.errors import InputError

# signals that another law may log on the same robot
_OF_OTHER_LAWS = {"xi_M"}
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
    signals = optional_signals(station)
    surface = settings.surface
    if settings.path.orientation.task == "none" or (surface and surface.orientation.kind == "none"):
        signals |= _OF_ORIENTATIONS
    for law, targets in settings.targets.items():
        other = set() if law == settings.controller.law else _OF_OTHER_LAWS
        known = [
            *metric_names(station.robot.dimension, signals | other),
            *press_metric_names(signals),
            *guidance_metric_names(station),
            *limit_metric_names(station),
            *mounting_metric_names(signals),
            *friction_metric_names(station.robot.dimension, signals | _OF_OBSERVERS),
            *shape_metrics(station.task.shape, station.task.fit),
            *JointLimits.of(station.robot).metric_names(),
            *posture_metric_names(signals, is_redundant(station), station.task.lap is not None),
            "real_time_factor",
            "controller_tick_us",
            "controller_tick_us_p99",
        ]
        for name in targets:
            if name not in known:
                raise InputError(
                    f"targets.{law}.{name}: no such metric; allowed: {', '.join(known)}"
                )
