"""The table as CSV and Parquet."""

import csv
import io

import pytest
from pyarrow import BufferReader, parquet

from experiments.sweep.samples import draw_samples, parse_variations
from experiments.sweep.table import table_columns, to_csv, to_parquet, units_of


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
