"""The record of a sweep: rows are kept, other sweeps are refused."""

import dataclasses
import json
import shlex

import pytest

from experiments.scenario_file import read_scenario
from experiments.sweep.definition import RECORD, SweepDefinition, SweepRecord
from experiments.sweep.worker import FAILED, RunRow
from pfsc_drake import InputError
from reporting.folder import open_results

DEFINITION = SweepDefinition("arm", ("a=0:1", "b=[1, 2],x"), ("c=3",), 0.5, 7, 2, "0123")


@pytest.fixture
def kept(tmp_path, rows):
    """A folder with the rows of a sweep."""
    with open_results(tmp_path / "out", "sweep", resume=True) as results:
        record = SweepRecord(results, DEFINITION)
        for number, row in rows.items():
            record.take(number, row)
        record.save()
    return tmp_path / "out"


def test_rows_survive(kept, rows):
    with open_results(kept, "sweep", resume=True) as results:
        record = SweepRecord(results, DEFINITION)
        again = {number: row.to_data() for number, row in record.rows.items()}
        assert again == {number: row.to_data() for number, row in rows.items()}
        assert record.rows[2].metrics["max_path_deviation"].bound == ("<", 5e-3)
        # 5 has died and 6 was never run; what failed for the machine's sake is tried again too
        assert record.missing(7) == [5, 6]
        record.rows[3] = RunRow(FAILED, "disk full")
        assert record.missing(7) == [3, 5, 6]


def test_rows_survive_a_process_that_is_killed(tmp_path, rows):
    out = tmp_path / "out"
    with open_results(out, "sweep", resume=True) as results:
        record = SweepRecord(results, DEFINITION)
        record.take(0, rows[0])
        record.save()
        written = (out / RECORD).read_text()
        record.rows[1] = rows[1]
    # nothing was finished, and the folder can still be used
    with open_results(out, "sweep", resume=True) as results:
        assert (out / RECORD).read_text() == written
        assert list(SweepRecord(results, DEFINITION).rows) == [0]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"vary": ("a=0:2", "b=[1, 2],x")}, "--vary a=0:1 b=[1, 2],x"),
        ({"samples": 8}, "--samples 7"),
        ({"seed": 3}, "--seed 2"),
        ({"overrides": ()}, "--set c=3"),
        ({"duration": None}, "--duration 0.5"),
        ({"content": "4567"}, "another scenario, or one that has changed since"),
    ],
)
def test_another_sweep_is_refused_and_nothing_changes(kept, change, named):
    before = {path.name: path.read_bytes() for path in kept.iterdir()}
    other = dataclasses.replace(DEFINITION, **change)
    with (
        pytest.raises(InputError) as caught,
        open_results(kept, "sweep", resume=True) as results,
    ):
        SweepRecord(results, other)
    assert f"it holds another sweep ({named})" in str(caught.value)
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == before


def test_another_sweep_may_take_a_folder_without_rows(tmp_path):
    for definition in (DEFINITION, dataclasses.replace(DEFINITION, seed=9)):
        with open_results(tmp_path, "sweep", resume=True) as results:
            SweepRecord(results, definition).save()
    assert json.loads((tmp_path / RECORD).read_text())["sweep"]["seed"] == 9


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"sweep": {}, "rows": {"0": {"status": "odd"}}}']
)
def test_a_record_that_cannot_be_read(tmp_path, text):
    with open_results(tmp_path, "sweep", resume=True) as results:
        results.write(RECORD, text)
    with (
        pytest.raises(InputError, match="not a readable record of a sweep"),
        open_results(tmp_path, "sweep", resume=True) as results,
    ):
        SweepRecord(results, DEFINITION)


def test_commands_can_be_typed():
    words = shlex.split(DEFINITION.command())
    options = "--vary a=0:1 --vary 'b=[1, 2],x' --samples 7 --seed 2 --set c=3 --duration 0.5"
    assert words[3:] == ["sweep", "arm", *shlex.split(options)]
    words = shlex.split(DEFINITION.run_command(("b=[1, 2]",)))
    assert words[3:] == ["run", "arm", "--set", "c=3", "--set", "b=[1, 2]", "--duration", "0.5"]


def test_the_fingerprint_is_of_the_content():
    one, same = (read_scenario("pfc_elastic_3r", []).fingerprint for _ in range(2))
    assert one == same
    assert read_scenario("pfc_elastic_3r", ["reference.dwell=0.4"]).fingerprint != one
