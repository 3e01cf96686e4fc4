"""A feature of runs: what is logged of it, measured, required, reported and drawn."""

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
    """A feature that a run may have; what it does not have adds nothing.

    All of a feature stands in one file, which ends with its record, and ``features.FEATURES`` lists
    the records. Units and sentences of signals, metrics and figures are rows of
    ``reporting/registry.toml``.

    Attributes:
        signals: Adds signals to the log of a station from what the station logged.
        metrics: Returns metrics of a log, its station, and its scenario.
        requirements: Returns targets of metrics that every run of a scenario has, by name.
        always: Metrics with targets that hold at every instant, so that a run that was cut short
            is judged by them, too.
        known: Returns what metrics may need, beside signals that the station logs: properties of
            a run, metrics known beforehand, signals of another choice of options.
        warnings: Returns what may not have gone as well as hoped, one sentence each.
        figures: Draws each figure of a log that has the signals for it; None where it is not worth
            a look.
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
    """Return the time from which deviations count [s]: until then the tool comes to the path.

    Where it waits for obstacles its approach waits, too, by the time that is lost.

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
