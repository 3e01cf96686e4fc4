"""The table of the results of shipped scenarios, reduced to two of them."""

import pytest

import docs.results
from docs.results import BEGIN, END, Case, Outcome, cases, page, run_all, table
from experiments.scenario_file import scenario_names
from experiments.sweep.worker import COMPLETED, FAULT, RunRow
from reporting.metrics import Metrics

_TEXT = f"Before.\n\n{BEGIN}\nold\n{END}\n\nAfter.\n"


def _outcome(status: str = COMPLETED, reason: str = "", deviation: float = 7.04e-6) -> Outcome:
    metrics = Metrics()
    metrics.add("max_path_deviation", deviation, target="< 2e-5")
    metrics.add("max_orientation_error", 4e-5, target="< 1e-3")
    metrics.add("real_time_factor", 8.0)
    return Outcome(RunRow(status, reason, metrics, revision="a" * 40), 0.02)


@pytest.mark.slow
def test_every_scenario_has_its_laws():
    every = cases()
    assert {case.scenario for case in every} == set(scenario_names())
    laws = [case.law for case in cases(["pfc_elastic_3r"])]
    assert laws == ["elastic", "singular_perturbation", "rigid"]
    assert [case.read().data["controller"]["law"] for case in cases(["pfc_elastic_3r"])] == laws


def test_rows_of_the_table():
    passed, missed, stopped, left = cases(["pfc_elastic_3r", "pfc_comau_6r"])
    outcomes = {
        passed: _outcome(),
        missed: _outcome(deviation=3e-5),
        stopped: _outcome(FAULT, "singular at eta = 0.4 m"),
    }
    lines = table([passed, missed, stopped, left], outcomes).splitlines()[2:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert {len(row) for row in rows} == {8}
    assert rows[0][:2] == [f"`{passed.scenario}`", f"`{passed.law}`"]
    assert rows[0][3:] == [
        "7\u202fµm",
        "< 20\u202fµm",
        "`max_orientation_error` 40\u202fµrad (< 1\u202fmrad)",
        "160\u202fms",  # 8 times real time, in 20 ms
        "passed",
    ]
    assert rows[1][-1] == "missed: max_path_deviation"
    assert rows[2][-1] == "fault: singular at eta = 0.4 m"
    assert rows[3][3:] == [""] * 4 + ["not run"]


def test_the_rest_of_the_page_stays():
    case = cases(["pfc_comau_6r"])[0]
    text = page(_TEXT, [case], {case: _outcome()})
    assert text.startswith(f"Before.\n\n{BEGIN}\n") and text.endswith(f"{END}\n\nAfter.\n")
    assert "old" not in text and "1 of 1 runs; revision aaaaaaaaaaaa" in text
    assert page(text, [case], {case: _outcome()}) == text
    with pytest.raises(ValueError, match="no lines"):
        page("Before.\n", [case], {})


def test_outcomes_are_stored_for_their_revision(tmp_path, monkeypatch):
    monkeypatch.setattr(docs.results, "STORE", tmp_path)
    monkeypatch.setattr(docs.results, "git_revision", lambda: "a" * 40)
    case = cases(["pfc_comau_6r"])[0]
    docs.results._store(case, _outcome())
    outcome = run_all([case])[case]
    assert outcome.work == 0.02
    assert outcome.row.metrics["max_path_deviation"].value == 7.04e-6
    assert docs.results._stored(case, "b" * 40) is None
    assert docs.results._stored(case, "a" * 40 + "+dirty") is None


@pytest.mark.slow
def test_two_scenarios(tmp_path, monkeypatch):
    monkeypatch.setattr(docs.results, "STORE", tmp_path)
    monkeypatch.setattr(docs.results, "count_cores", lambda: 1)
    two: list[Case] = cases(["pfc_elastic_3r", "pfc_comau_6r"])[:2]
    outcomes = run_all(two, duration=0.1)
    assert list(tmp_path.iterdir()) == []  # cut short, so not stored
    for outcome in outcomes.values():
        assert outcome.row.status == COMPLETED
        assert 0.0 < outcome.work < 1.0 and outcome.speed > 0.0
    assert "not run" not in table(two, outcomes)
