"""Paths that attract: metrics and the audit of their energy."""

import math

import numpy as np
import pytest

from experiments.results.guidance_audit import GuidanceRules, audit
from experiments.results.guides_feature import guide_metrics
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.guides import GuideRecord
from tests.control.fixtures.guided_point import GUIDES, START, TABLE, guidance, wandering_hand
from tests.control.fixtures.point_robot import DAMPING, MASS, PERIOD, lead

NUMBERS = tuple((guide.stiffness, guide.reach) for guide in GUIDES)


PROMISE = GuidanceRules(MASS, DAMPING, 0.6, 1.0, NUMBERS)


@pytest.fixture(scope="module", name="record")
def fixture_record():
    """Two seconds, in which a hand changes from one path to another."""
    record = lead(guidance(), START, wandering_hand(2), 2.0)
    active = {step.guides[0] for step in record.steps}
    assert len(active - {-1.0}) > 1
    return record


def make_log(record, **changed):
    fields = guidance().layout.fields
    values = np.array([step.record for step in record.steps])
    guides = np.array([step.guides for step in record.steps])
    log = RunLog(PERIOD * np.arange(len(values)))
    of = {name: values[:, part].copy() for name, part in fields.items()}
    told = {name: guides[:, part].copy() for name, part in GuideRecord(3).fields.items()}
    of, told = of | changed, told | changed
    log.add("velocity_command", of["velocity"], "m/s")
    log.add("guiding_force", of["force"], "N")
    log.add("rest_point", of["point"], "m")
    log.add("near_regions", of["near"], "")
    log.add("tank", of["tank"], "J")
    log.add("free_damping", of["damping"], "N s/m")
    log.add("speed_limit", of["limit"], "m/s")
    log.add("y_t", np.array(record.y), "m")
    log.add("region_distance", np.array([[TABLE(y, 0.0)[0]] for y in record.y]), "m")
    names = ["none", "circle_1", "line_2", "waypoints_3"]
    log.add("guide", told["active"].astype(int) + 1, "1", names)
    log.add("guide_share", told["share"], "1")
    log.add("guide_foot", told["foot"], "m")
    force = told["kappa"] * (told["foot"] - of["point"])
    log.add("guide_force", force, "N")
    log.add("guide_distance", told["distance"], "m")
    return log


def worst(log, promise=PROMISE):
    return {name: metric.value for name, metric in audit(log, promise).items()}


def test_what_is_kept_passes(record):
    found = worst(make_log(record))
    for name in ("stationarity", "allowance", "energy", "tank"):
        assert found[f"audit_{name}"] < 1e-9, name
    assert found["audit_bound"] > 0.0


def test_a_pull_that_is_another_is_seen(record):
    stiffer = GuidanceRules(MASS, DAMPING, 0.6, 1.0, ((2100.0, 0.06), *NUMBERS[1:]))
    assert worst(make_log(record), stiffer)["audit_stationarity"] > 1e-5


def test_energy_that_a_change_of_path_gives_is_seen(record):
    """The tool is said to have been pulled to the last path's foot a tick longer."""
    foot = np.array([step.guides[GuideRecord(3).fields["foot"]] for step in record.steps])
    shifted = foot + [0.0, 0.0, 2e-3] * (np.arange(len(foot)) > 1000)[:, None]
    found = worst(make_log(record, foot=shifted))
    assert found["audit_tank"] > 1e-6 or found["audit_stationarity"] > 1e-5


def test_a_run_tells_which_paths_were_followed_and_what_a_change_took(record):
    log = make_log(record)
    found = {name: metric.value for name, metric in guide_metrics(log).items()}
    active = np.array([step.guides[0] for step in record.steps])
    assert found["guide_changes"] == np.count_nonzero(np.diff(active))
    assert found["time_without_guide"] == pytest.approx(PERIOD * np.count_nonzero(active < 0))
    steps = np.linalg.norm(np.diff(record.commands, axis=0), axis=1)
    assert found["step_at_guide_change"] == pytest.approx(steps[np.diff(active) != 0].max())
    assert found["largest_guide_force"] <= max(guide.largest_force for guide in GUIDES) + 1e-9
    assert not math.isnan(found["guide_rest_distance"])
