"""The table of a sweep: one row per run, as CSV and as Parquet."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from experiments.sweep.rows import RunRow
from experiments.sweep.samples import Sample

Columns = dict[str, list[Any]]

_ABOUT = ("run", "status", "reason", "warnings", "simulated_time", "seconds", "host", "revision")


def table_columns(samples: Sequence[Sample], rows: Mapping[int, RunRow]) -> Columns:
    """Returns the columns of the table, in the order of the samples.

    Args:
        samples: All of the sweep; those without row are left out.
        rows: By number of the sample.

    Returns:
        What varied, how the run ended (``status``, ``reason``, number of ``warnings``,
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
    """Returns the unit of each metric, and of the times."""
    metrics = {name: metric.unit for row in rows.values() for name, metric in row.metrics.items()}
    return {"simulated_time": "s", "seconds": "s", **metrics}


def to_csv(columns: Columns) -> str:
    """Returns the table as CSV with a line of names; numbers keep all their digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def to_parquet(columns: Columns, units: Mapping[str, str]) -> bytes:
    """Returns the table as Parquet.

    Args:
        columns: The table.
        units: Of its columns; kept as ``unit`` in the metadata of the column.
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
    """A name that no other column has."""
    while name in columns or name in _ABOUT:
        name += "_"
    return name


def _is_numeric(values: Sequence[Any]) -> bool:
    return all(isinstance(value, (int, float)) for value in values)


def _typed(values: list[Any]) -> list[Any]:
    """Numbers of one type, nothing else changed."""
    if any(isinstance(value, float) for value in values):
        return [None if value is None else float(value) for value in values]
    return values


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
