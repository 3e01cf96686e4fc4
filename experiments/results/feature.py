"""Features of runs: their signals, metrics, requirements, warnings and figures."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from diagrams.scenario import Scenario, Target
from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from reporting.style import Drawing

# signals of a station by name, see run_signals.collect_log
Raw = Mapping[str, FloatArray]


@dataclass(frozen=True)
class Feature:
    """Optional feature of a run; without its signals it adds nothing.

    Each feature has one file, which ends with its record; ``features.FEATURES`` lists the records.
    Units and sentences of signals, metrics and figures are rows of ``reporting/registry.toml``.

    Attributes:
        signals: Adds signals to the log of a run from a station's logged signals.
        metrics: Returns metrics of a log, its station, and its scenario.
        requirements: Returns targets of metrics that apply to every run of a scenario, by name.
        always: Metrics with targets at every instant, which also apply to an incomplete run.
        known: Returns further inputs of metrics: properties of a run, metrics known before it,
            signals with other options.
        warnings: Returns warnings, one sentence each.
        figures: Draws each figure whose signals the log has; None for one without information.
    """

    signals: Callable[[RunLog, Station, Raw], None] = lambda log, station, raw: None
    metrics: Callable[[RunLog, Station, Scenario], Metrics] = lambda log, station, settings: (
        Metrics()
    )
    requirements: Callable[[Scenario], Mapping[str, Target]] = lambda settings: {}
    always: tuple[str, ...] = ()
    known: Callable[[Station, Scenario], Collection[str]] = lambda station, settings: ()
    warnings: Callable[[RunLog, Station, Scenario], list[str]] = lambda log, station, settings: []
    figures: "Mapping[str, Callable[[RunLog], Drawing | None]]" = field(default_factory=dict)


def converged_after(settings: Scenario, log: RunLog) -> float:
    """Return the time from which deviations count [s], after the approach to the path.

    The approach is extended by the time of waiting for obstacles.

    Args:
        settings: Scenario of the run.
        log: Its log.
    """
    begin = max(settings.reference.dwell, settings.start.transition)
    if "time_lost" not in log:
        return begin
    there = log.time[log.time - log["time_lost"].values[:, 0] >= begin]
    return float(there[0]) if there.size else np.inf


def by_order(values: FloatArray, outputs: int) -> FloatArray:
    """Return outputs and their derivatives, shape (samples, orders, outputs)."""
    return values.reshape(len(values), values.shape[1] // outputs, outputs)
