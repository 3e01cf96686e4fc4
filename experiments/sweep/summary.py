"""Summary of a sweep: outcomes, quantiles, the worst run, and a table of all runs."""

import csv
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.sweep.definition import Sample
from experiments.sweep.worker import COMPLETED, DIED, FAILED, FAULT, REFUSED, RunRow
from reporting.metrics import Metric, Metrics, format_quantity

# metrics of the machine and its load, not of the robot
MACHINE_METRICS = ("real_time_factor", "controller_tick_us", "controller_tick_us_p99")
_FAVOURITE = "max_path_deviation"
_SPOKEN = {
    COMPLETED: "completed",
    FAULT: "stopped by a fault",
    REFUSED: "refused as wrong input",
    FAILED: "failed",
    DIED: "died with their process",
}
_LARGE = ("real_time_factor", "joint_limit_margin")
_SINGLE = {FAULT: "fault", REFUSED: "refused", FAILED: "failed", DIED: "died"}
Columns = dict[str, list[Any]]
_ABOUT = ("run", "status", "reason", "warnings", "simulated_time", "seconds", "host", "revision")


class Spread:
    """Distribution of a metric over the completed runs.

    Args:
        name: Name of the metric.
        metrics: Its finite values, by number of the sample; one or more.

    Attributes:
        name: See above.
        unit: SI.
        runs: Number of the samples with a value.
        values: Their values.
        is_better_large: Whether the worst is the smallest.
        target: Target of the metric, if there is one.
        source: Source of the target.
    """

    def __init__(self, name: str, metrics: Mapping[int, Metric]) -> None:
        self.name, self.runs, all_of = name, tuple(metrics), list(metrics.values())
        self.values, self.unit = np.array([metric.value for metric in all_of]), all_of[0].unit
        # only targets shared by all runs count, and none of machine metrics
        targets = {(metric.target, metric.source) for metric in all_of}
        is_shared = len(targets) == 1 and name not in MACHINE_METRICS
        self.target, self.source = targets.pop() if is_shared else (None, None)
        bounds = [metric.bound for metric in all_of if metric.bound is not None]
        self.is_better_large = name in _LARGE or any(b[0].startswith(">") for b in bounds)

    @property
    def worst_run(self) -> int:
        """Number of the sample with the worst value."""
        find = np.argmin if self.is_better_large else np.argmax
        return self.runs[int(find(self.values))]

    @property
    def worst(self) -> float:
        """Worst value."""
        return float(self.values.min() if self.is_better_large else self.values.max())

    def quantile(self, share: float) -> float:
        """Return the value that a share of the runs is not worse than."""
        at = 1.0 - share if self.is_better_large else share
        return float(np.quantile(self.values, at))


def count_ends(rows: Mapping[int, RunRow]) -> dict[str, int]:
    """Return the number of runs by outcome."""
    counts = Counter(row.status for row in rows.values())
    return {spoken: counts[status] for status, spoken in _SPOKEN.items() if counts[status]}


def choose_metric(spreads: Mapping[str, Spread], requested: str | None) -> str | None:
    """Return the metric to draw: the requested one if a run has it, else the default.

    Args:
        spreads: Spreads of the sweep's metrics.
        requested: Name of a metric; None for the default.

    Returns:
        None if no run completed.
    """
    for name in (requested, _FAVOURITE):
        if name in spreads:
            return name
    return next(iter(spreads), None)


def measure_spreads(rows: Mapping[int, RunRow]) -> dict[str, Spread]:
    """Return the distribution of each metric over the completed runs with a value."""
    completed = {i: rows[i] for i in sorted(rows) if rows[i].status == COMPLETED}
    spreads = {}
    for name in dict.fromkeys(name for row in completed.values() for name in row.metrics):
        own = {i: row.metrics[name] for i, row in completed.items() if name in row.metrics}
        own = {i: metric for i, metric in own.items() if np.isfinite(metric.value)}
        if own:
            spreads[name] = Spread(name, own)
    return spreads


def summary_metrics(rows: Mapping[int, RunRow], chosen: str | None) -> Metrics:
    """Return the number of runs by outcome, then the worst value of each metric.

    Args:
        rows: Rows of the sweep.
        chosen: Metric that comes first, with its quantiles.
    """
    metrics = Metrics()
    metrics.add("runs", len(rows), "1")
    for spoken, count in count_ends(rows).items():
        metrics.add(f"runs_{spoken.replace(' ', '_')}", count, "1")
    spreads = measure_spreads(rows)
    if chosen is not None:
        spread = spreads[chosen]
        metrics.add(f"{chosen}_median", spread.quantile(0.5), spread.unit)
        metrics.add(f"{chosen}_quantile_99", spread.quantile(0.99), spread.unit)
    for name in sorted(spreads, key=lambda name: name != chosen):
        spread = spreads[name]
        described = _described(spread)
        if spread.source:
            described += f"; {'target: ' if spread.target else ''}{spread.source}"
        metrics.add(f"{name}_worst", spread.worst, spread.unit, spread.target, described)
    return metrics


def key_metrics(metrics: Metrics, chosen: str | None) -> list[str]:
    """Return the names of the metrics to look at first.

    Args:
        metrics: From :func:`summary_metrics`.
        chosen: As there.
    """
    return [
        name
        for name, metric in metrics.items()
        if name.startswith("runs")
        or metric.target is not None
        or name in {f"{chosen}_{end}" for end in ("median", "quantile_99", "worst")}
    ]


def _described(spread: Spread) -> str:
    """Return a text with the worst run, median and 99 % quantile."""
    median, share = (format_quantity(spread.quantile(q), spread.unit) for q in (0.5, 0.99))
    return f"run {spread.worst_run}; median {median}, 99 % quantile {share}"


def striking_runs(rows: Mapping[int, RunRow], chosen: str | None, most: int) -> dict[str, int]:
    """Return the runs to inspect, by their descriptions.

    Args:
        rows: Rows of the sweep.
        chosen: Metric by which the worst run is found.
        most: Number of runs of each kind of end, completed ones aside.
    """
    striking = {}
    if chosen is not None:
        spread = measure_spreads(rows)[chosen]
        value = format_quantity(spread.worst, spread.unit)
        striking[f"Worst {chosen} of those that completed, {value}"] = spread.worst_run
    for status in (FAULT, REFUSED, FAILED, DIED):
        own = [i for i in sorted(rows) if rows[i].status == status]
        for i in own[:most]:
            striking[f"Run {i}, {_SINGLE[status]}: {rows[i].reason}"] = i
    return striking


def table_columns(samples: Sequence[Sample], rows: Mapping[int, RunRow]) -> Columns:
    """Return the columns of the table, in the order of the samples.

    Args:
        samples: All samples of the sweep; those without row are skipped.
        rows: Rows by number of the sample.

    Returns:
        Varied values, outcome of the run (``status``, ``reason``, number of ``warnings``,
        ``simulated_time`` [s], ``seconds`` of wall clock time, ``host``, ``revision``) and every
        metric in SI units; None where a run has no value.
    """
    done = [sample for sample in samples if sample.index in rows]
    own = [rows[sample.index] for sample in done]
    columns: Columns = {"run": [sample.index for sample in done]}
    for name in dict.fromkeys(name for sample in done for name in sample.varied):
        values = [sample.varied.get(name) for sample in done]
        columns[_free(name, columns)] = values if _is_numeric(values) else [str(v) for v in values]
    columns |= {
        "status": [row.status for row in own],
        "reason": [row.reason for row in own],
        "warnings": [len(row.warnings) for row in own],
        "simulated_time": [_finite(row.end) for row in own],
        "seconds": [_finite(row.seconds) for row in own],
        "host": [row.host for row in own],
        "revision": [row.revision for row in own],
    }
    for name in dict.fromkeys(name for row in own for name in row.metrics):
        metrics = (row.metrics.get(name) for row in own)
        values = [None if metric is None else _finite(metric.value) for metric in metrics]
        columns[_free(name, columns)] = values
    return columns


def units_of(rows: Mapping[int, RunRow]) -> dict[str, str]:
    """Return the unit of each metric, and of the times."""
    metrics = {name: metric.unit for row in rows.values() for name, metric in row.metrics.items()}
    return {"simulated_time": "s", "seconds": "s", **metrics}


def to_csv(columns: Columns) -> str:
    """Return the table as CSV with a line of names; numbers keep all their digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def to_parquet(columns: Columns, units: Mapping[str, str]) -> bytes:
    """Return the table as Parquet.

    Args:
        columns: The table.
        units: Units of its columns; stored as ``unit`` in the metadata of the column.
    """
    import pyarrow
    from pyarrow import parquet

    arrays = [pyarrow.array(_typed(values)) for values in columns.values()]
    fields = [
        pyarrow.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), sink)
    return bytes(sink.getvalue())


def _free(name: str, columns: Columns) -> str:
    """Return a unique name for a column."""
    while name in columns or name in _ABOUT:
        name += "_"
    return name


def _is_numeric(values: Sequence[Any]) -> bool:
    return all(isinstance(value, (int, float)) for value in values)


def _typed(values: list[Any]) -> list[Any]:
    """Return numbers of one type, otherwise unchanged values."""
    if any(isinstance(value, float) for value in values):
        return [None if value is None else float(value) for value in values]
    return values


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
