"""What a sweep says as a whole."""

import csv
import io

import pytest
from pyarrow import BufferReader, parquet

from experiments.sweep.definition import draw_samples, parse_variations
from experiments.sweep.summary import (
    choose_metric,
    count_ends,
    key_metrics,
    measure_spreads,
    striking_runs,
    summary_metrics,
    table_columns,
    to_csv,
    to_parquet,
    units_of,
)

DEVIATION = "max_path_deviation"


def test_ends_are_counted(rows):
    assert count_ends(rows) == {
        "completed": 4,
        "stopped by a fault": 1,
        "died with their process": 1,
    }


def test_spreads_are_of_the_runs_that_completed(rows):
    spread = measure_spreads(rows)[DEVIATION]
    assert (spread.worst, spread.worst_run) == (7e-3, 2)
    assert spread.quantile(0.5) == pytest.approx(2.5e-3)  # halfway between 2 and 3
    assert spread.quantile(1.0) == 7e-3
    # of a margin the smallest is the worst
    margin = measure_spreads(rows)["joint_limit_margin"]
    assert (margin.worst, margin.worst_run) == (0.1, 0)
    assert margin.quantile(1.0) == 0.1
    assert measure_spreads(rows)["settling_time"].runs == (0, 1, 3)


def test_the_worst_value_is_held_against_the_target(rows):
    metrics = summary_metrics(rows, DEVIATION)
    worst = metrics[f"{DEVIATION}_worst"]
    assert (worst.value, worst.passed) == (7e-3, False)
    assert "run 2" in worst.source
    assert "Sec. 3.8.3" in worst.source
    assert metrics["runs"].value == 6
    assert metrics["runs_stopped_by_a_fault"].value == 1
    # what the machine did beside is no target of a sweep
    assert metrics["real_time_factor_worst"].target is None
    assert key_metrics(metrics, DEVIATION) == [
        "runs",
        "runs_completed",
        "runs_stopped_by_a_fault",
        "runs_died_with_their_process",
        f"{DEVIATION}_median",
        f"{DEVIATION}_quantile_99",
        f"{DEVIATION}_worst",
    ]


def test_the_metric_to_draw(rows):
    spreads = measure_spreads(rows)
    assert choose_metric(spreads, None) == DEVIATION
    assert choose_metric(spreads, "settling_time") == "settling_time"
    assert choose_metric(spreads, "none") == DEVIATION
    del spreads[DEVIATION]
    assert choose_metric(spreads, None) == "joint_limit_margin"
    assert choose_metric({}, None) is None


def test_runs_to_look_at(rows):
    striking = striking_runs(rows, DEVIATION, 3)
    assert list(striking.values()) == [2, 4, 5]
    worst, fault, died = striking
    assert "7\u202fmm" in worst
    assert fault == "Run 4, fault: singular"
    assert died == "Run 5, died: killed"
    assert list(striking_runs({4: rows[4]}, None, 3).values()) == [4]
    many = dict.fromkeys(range(9), rows[4])
    assert list(striking_runs(many, None, 3).values()) == [0, 1, 2]


@pytest.fixture
def samples():
    options = ["mass=0:1", "law=choice(elastic, 3)", "host=0:1"]
    return draw_samples(parse_variations(options), 7, 0)


def test_csv_reads_back_to_the_same_numbers(samples, rows):
    text = to_csv(table_columns(samples, rows))
    table = list(csv.DictReader(io.StringIO(text)))
    assert [int(row["run"]) for row in table] == list(range(6))
    assert [float(row["mass"]) for row in table] == [s.varied["mass"] for s in samples[:6]]
    assert {row["law"] for row in table} == {"elastic", "3"}
    assert [row["status"] for row in table] == 4 * ["completed"] + ["fault", "died"]
    assert [row["reason"] for row in table][4:] == ["singular", "killed"]
    assert [row["warnings"] for row in table] == list("010000")
    deviations = [float(row["max_path_deviation"]) for row in table[:5]]
    assert deviations == [3e-3, 1e-3, 7e-3, 2e-3, 9e-3]
    assert table[5]["max_path_deviation"] == table[2]["settling_time"] == ""
    # a key that is called like a column of the table's own
    assert [row["host"] for row in table] == ["a"] * 4 + ["b", ""]
    assert float(table[0]["host_"]) == samples[0].varied["host"]


def test_parquet_has_types_and_units(samples, rows):
    columns = table_columns(samples, rows)
    table = parquet.read_table(BufferReader(to_parquet(columns, units_of(rows))))
    assert table.column_names == list(columns)
    assert table.to_pydict() == columns
    assert table.schema.field("max_path_deviation").metadata == {b"unit": b"m"}
    assert str(table.schema.field("max_path_deviation").type) == "double"
    assert str(table.schema.field("run").type) == "int64"


def test_nothing_yet(samples):
    columns = table_columns(samples, {})
    assert to_csv(columns).startswith("run,")
    assert parquet.read_table(BufferReader(to_parquet(columns, {}))).num_rows == 0
