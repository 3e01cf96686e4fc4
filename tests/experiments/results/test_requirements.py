"""What was promised and not kept: in the page's words, the last line and the status."""

import math

import pytest

from diagrams.scenario import Scenario, Target
from diagrams.scenario.virtual_fixtures import FixtureParameters
from experiments.cli import main
from experiments.results.requirements import leave_unjudged, missed_targets, set_targets
from reporting.metrics import Metrics


def metrics(**values):
    made = Metrics()
    for name, value in values.items():
        made.add(name, value, "m")
    return made


def test_a_scenario_may_promise_more_than_every_run_does():
    scenario = Scenario(fixtures=FixtureParameters(bound=1e-3))
    found = metrics(deepest_violation=0.3e-3)
    set_targets(found, scenario)
    assert found["deepest_violation"].passed
    law = scenario.controller.law
    scenario.targets = {law: {"deepest_violation": Target("< 0.2e-3", "stricter")}}
    set_targets(found, scenario)
    assert found["deepest_violation"].passed is False


def test_a_force_that_nobody_answers_is_a_promise_broken():
    """What is smaller is what taring may take for a bias."""
    scenario, found = Scenario(), Metrics()
    scenario.compliance.transversal.stiffness.value = 2000.0
    found.add("max_unanswered_force", 60.0, "N")
    set_targets(found, scenario)
    (broken,) = missed_targets(found)
    assert broken.startswith("max_unanswered_force = 60")
    scenario.compliance.source = "observed"
    free = Metrics()
    free.add("max_unanswered_force", 60.0, "N")
    set_targets(free, scenario)
    assert not missed_targets(free)


def test_a_run_cut_short_is_judged_by_extremes_that_have_passed_their_bound():
    found = metrics(
        deepest_violation=0.3e-3,
        least_distance_while_moving=math.nan,
        max_path_deviation=2e-3,
        max_orientation_error=0.5e-3,
        max_coulomb_error=2e-3,
        least_tank=2.0,
        least_distance=0.1,
        joint_limit_margin=math.nan,
        settling_time=math.nan,
        led_distance_end=2e-3,
    )
    for name in found:
        at_least = name.startswith(("least", "joint"))
        found.set_target(name, "> 1" if at_least else "< 1e-3")
    assert [phrase.split()[0] for phrase in missed_targets(found)] == [
        *("least_distance_while_moving", "max_path_deviation", "max_coulomb_error"),
        *("least_distance", "joint_limit_margin", "settling_time", "led_distance_end"),
    ]
    leave_unjudged(found, fault=False)
    broken = [phrase.split()[0] for phrase in missed_targets(found)]
    assert broken == ["max_path_deviation", "least_distance"]
    judged = {name for name, metric in found.items() if metric.judged}
    assert judged == {"deepest_violation", *broken}
    assert found["deepest_violation"].verdict == "met"
    assert found["settling_time"].verdict == "not judged"
    leave_unjudged(found, fault=True)
    assert not missed_targets(found)


@pytest.mark.slow(but=["< 1e-12-duration1-3", "> 1-duration3-0"])
@pytest.mark.parametrize(
    ("bound", "duration", "status"),
    [
        ("< 1e-3", [], 0),
        ("< 1e-12", [], 3),
        ("< 1e-12", ["--duration", "0.2"], 3),
        ("> 1", ["--duration", "0.2"], 0),
    ],
)
def test_the_last_line_and_the_status_tell(tmp_path, capfd, bound, duration, status):
    changes = [
        f"targets.elastic.max_path_deviation={{bound: '{bound}'}}",
        "reference={points: [0.96, 0.97], dwell: 0.1}",
        "start.offset=[0, 0]",
        "settling_tolerance=1e-2",
    ]
    overrides = [word for change in changes for word in ("--set", change)]
    out = tmp_path / "out"
    bare = ["--no-figures", "--no-recording", *duration]
    assert main(["run", "pfc_elastic_3r", "--out", str(out), *bare, *overrides]) == status
    last = capfd.readouterr().err
    page = (out / "report.html").read_text(encoding="utf-8")
    if status == 0:
        assert last == ""
        assert "requirements violated" not in page
    else:
        assert last.startswith("missed: max_path_deviation = ")
        assert f"log written to {out}" in last
        assert last.count("\n") == 1
        assert "requirements violated" in page
