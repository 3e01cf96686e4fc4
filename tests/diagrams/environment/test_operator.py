"""A person in a station: forces on the tool, compliance, switches for regions."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.environment import operator as operator_module
from diagrams.environment.operator import columns, controls_text
from diagrams.scenario.simulation import OperatorParameters
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from pfsc_drake.errors import InputError

SCENARIOS = Path(__file__).parents[3] / "experiments" / "scenarios"


@pytest.fixture
def settings(load_exact_scenario):
    """A circle, guided by a person, with exact sensors and model."""
    settings = load_exact_scenario("vf_soft_circle")
    settings.hand, settings.sensor.noise = None, np.zeros(6)
    settings.operator = OperatorParameters()
    return settings


def write(folder, settings, *rows, regions=()):
    """Let a person do something: ticks with what differs from doing nothing, by column."""
    names, ticks, controls = columns(regions), [0], [operator_module.idle_controls(regions)]
    for tick, changes in rows:
        now = controls[-1].copy()
        for name, value in changes.items():
            now[names.index(name)] = value
        ticks.append(tick)
        controls.append(now)
    file = folder / "operator.csv"
    file.write_text(controls_text(ticks, controls, regions, 1e-3), encoding="utf-8")
    settings.operator.inputs = str(file)


@pytest.mark.slow
def test_a_push_leads_the_tool_and_stiffness_decides_how_far(tmp_path, settings):
    """In the plane's normal, which is e_perp; 5,000 N/m, then 2,000 N/m."""
    write(
        tmp_path,
        settings,
        (400, {"push_z": -20.0}),
        (1200, {"transversal_stiffness": 2000.0}),
    )
    settings.simulation.fused = True
    station = build_station(settings, SCENARIOS)
    result = simulate(station, settings.simulation, 2.4, lambda *_: None)
    assert result.fault is None
    log = collect_log(station, result.root)
    depth = 0.9 - log["y_t"].values[:, 2]
    assert np.abs(depth[:400]).max() < 1e-4
    assert depth[1190] == pytest.approx(20.0 / 5000.0, rel=0.03)
    assert depth[-1] == pytest.approx(20.0 / 2000.0, rel=0.03)
    assert log["wrench_ext"].values[-1, 2] == pytest.approx(-20.0, rel=1e-6)
    stiffness = log["stiffness"].values[-1]
    assert stiffness[1:3] == pytest.approx(2000.0, rel=1e-3)
    assert log["stiffness"].values[1000].tolist()[:3] == [0.0, 5000.0, 5000.0]
    assert log["tank"].values.min() >= 0.0


@pytest.mark.slow
def test_a_person_who_is_not_there_does_nothing(settings):
    station = build_station(settings, SCENARIOS)
    result = simulate(station, settings.simulation, 0.1, lambda *_: None)
    raw = station.log.read(result.root)[1]
    assert not raw["wrench_ext"].any()


def test_regions_get_switches(tmp_path, settings, monkeypatch):
    """The hook for guidance with regions."""
    regions = ["wall", "floor"]
    monkeypatch.setattr(type(settings), "switched_regions", regions)
    write(tmp_path, settings, (50, {"region_wall": 0.0}), regions=regions)
    operator = build_station(settings, SCENARIOS).operator
    assert operator.columns[-2:] == ["region_wall", "region_floor"]
    port = operator.requests["regions_on"]
    panel = port.get_system()
    context = panel.CreateDefaultContext()
    assert port.Eval(context).tolist() == [1.0, 1.0]


def test_a_file_that_is_not_there_is_named(settings):
    settings.operator.inputs = "nowhere.csv"
    with pytest.raises(InputError, match=r"operator\.inputs: .*nowhere\.csv"):
        build_station(settings, SCENARIOS)
