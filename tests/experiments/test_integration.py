"""Which integration is chosen for which robot."""

import h5py
import numpy as np
import pytest
import yaml

from diagrams.builder import build_station
from diagrams.integration import is_stable
from diagrams.scenario import Scenario, SimulationParameters
from experiments import integration
from experiments.integration import choose_integration
from experiments.results.run_signals import collect_log
from experiments.scenario_file import read_scenario
from experiments.simulation import simulate
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.robot.robot_model import joint_resonances
from pfsc_drake.yaml.typed import load_typed
from reporting.progress import NoProgress

STEPS, TICKS = integration._STEPS, integration._TICKS
RIGID = (
    "robot.model=comau_racer_1_4",
    "controller.law=rigid",
    "controller.gains.rigid="
    "{eta: {poles: [-20, -20]}, xi: {poles: [-30, -30]}, phi: {poles: [-30, -30]}}",
)


def build(name, *changes):
    scenario = read_scenario(name, ["simulation.integrator=auto", *changes])
    settings = load_typed(Scenario, scenario.data, name)
    return settings, build_station(settings, scenario.path.parent)


def choose(name, *changes):
    settings, station = build(name, *changes)
    return choose_integration(station, settings.simulation, settings.reference.dwell)


def motion(station, settings, parameters):
    """Positions in the first 0.2 s of a run, shape (201, n)."""
    result = simulate(station, parameters, 0.2, NoProgress())
    log = collect_log(station, result.root)
    return np.hstack([log["q_J"].values, log["y_t"].values])


@pytest.fixture(autouse=True)
def whole_trials(monkeypatch):
    """Try integrations as long as a run does."""
    monkeypatch.setattr(integration, "_STEPS", STEPS)
    monkeypatch.setattr(integration, "_TICKS", TICKS)


@pytest.mark.slow(but="pfc_elastic_3r-changes1-runge_kutta3-runge_kutta2")
@pytest.mark.parametrize(
    ("name", "changes", "scheme", "without"),
    [
        ("pfc_elastic_6r", RIGID, "runge_kutta2", None),
        ("pfc_elastic_3r", (), "runge_kutta3", "runge_kutta2"),
        ("pfc_elastic_6r", ("start.transition=0",), "runge_kutta5", "runge_kutta3"),
    ],
)
def test_the_cheapest_that_is_accurate(name, changes, scheme, without):
    """Against error control four orders tighter than what is asked for."""
    settings, station = build(name, *changes)
    chosen = choose_integration(station, settings.simulation, settings.reference.dwell)
    assert (chosen.scheme, chosen.step) == (scheme, 1e-3)
    assert "the cheapest with an error below 1e-06" in chosen.reason
    tight = SimulationParameters("runge_kutta3", 1e-3, accuracy=1e-10)
    truth = motion(station, settings, tight)
    assert np.ptp(truth, axis=0).max() > 5e-3  # it did move
    tried = motion(station, settings, chosen.applied_to(settings.simulation))
    assert np.abs(tried - truth).max() < 1e-6
    if without:
        cheaper = motion(station, settings, SimulationParameters(without, 1e-3))
        assert np.abs(cheaper - truth).max() > 1e-6


def test_it_is_the_same_every_time():
    settings, station = build("pfc_elastic_3r")
    choices = [choose_integration(station, settings.simulation, 0.3) for _ in range(2)]
    assert choices[0] == choices[1]


@pytest.mark.slow
def test_an_unstable_scheme_is_not_chosen_whatever_its_error(monkeypatch):
    """Second order makes undamped joints oscillate ever more, in the end."""
    monkeypatch.setattr(integration, "_TOLERANCE", 1.0)
    assert choose("pfc_elastic_6r").scheme == "runge_kutta3"
    assert choose("pfc_elastic_6r", *RIGID).scheme == "runge_kutta2"


@pytest.fixture
def stiff(tmp_path):
    """Changes that make the joints of three axes 3000 times stiffer."""
    parameters = load_parameters("comau_racer_1_4")
    variant = next(v for v in parameters.variants if v.name == "comau_racer_1_4_elastic_3r")
    elasticity = parameters.elasticities[variant.elasticity]
    elasticity.stiffness = 3e3 * elasticity.stiffness
    (tmp_path / "stiff.sdf").write_text(write_sdf(parameters, variant), encoding="utf-8")
    return (
        f"robot.model={tmp_path / 'stiff.sdf'}",
        "controller.law=singular_perturbation",
        "controller.boundary_layer_damping=[1e-6, 1e-6, 1e-6]",
    )


@pytest.mark.slow(but="start.offset=[0.01, 0]")
@pytest.mark.parametrize("start", ["start.offset=[0, 0]", "start.offset=[0.01, 0]"])
def test_the_start_of_the_scenario_does_not_decide(start):
    """Without a way to the path, and the reference hardly moving yet, all else rests."""
    assert choose("pfc_elastic_3r", start).scheme == "runge_kutta3"


@pytest.mark.slow
def test_stiff_joints_get_shorter_steps(stiff):
    settings, station = build("pfc_elastic_3r", *stiff)
    chosen = choose_integration(station, settings.simulation, settings.reference.dwell)
    q_J = (station.part.coordinates.link_rows @ station.initial_state)[:3]
    modes = 1j * joint_resonances(station.robot, q_J)
    assert not any(is_stable(scheme, 1e-3, modes) for scheme in ("runge_kutta3", "runge_kutta5"))
    assert chosen.step < 1e-3
    assert is_stable(chosen.scheme, chosen.step, modes)


@pytest.mark.slow
def test_friction_has_its_schemes():
    chosen = choose("pfc_elastic_6r", *RIGID, "friction.file=comau_racer_1_4")
    assert chosen.scheme in ("runge_kutta3", "runge_kutta5")
    assert chosen.step == 1e-3


def test_a_step_is_never_longer_than_a_tick():
    assert choose("pfc_elastic_6r", *RIGID, "simulation.max_step=0.01").step == 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("step", [1e-5, 1e-6])
def test_steps_that_are_short_already_take_no_long_trial(step):
    chosen = choose("pfc_elastic_6r", *RIGID, f"simulation.max_step={step}")
    assert (chosen.scheme, chosen.step) == ("runge_kutta2", step)


@pytest.mark.slow
def test_a_discrete_plant_has_steps_of_its_own():
    chosen = choose("pfc_delta_notch")
    assert "time steps of its own, 0.5 ms" in chosen.reason


def test_error_control_gets_the_scheme_that_has_it():
    chosen = choose("pfc_elastic_3r", "simulation.accuracy=1e-6")
    assert chosen.scheme == "runge_kutta3"
    assert "accuracy 1e-06" in chosen.reason


def test_what_the_scenario_names_is_taken():
    chosen = choose("pfc_elastic_3r", "simulation.integrator=runge_kutta2")
    assert str(chosen) == "runge_kutta2 in steps of 1 ms: as the scenario says"


@pytest.mark.slow
def test_a_run_says_it_and_its_copy_gives_the_same(run_scenario, tmp_path):
    bare = ("--set", "simulation.integrator=auto", "--duration", "0.1")
    first = run_scenario(tmp_path / "first", "pfc_elastic_3r", *bare)
    resolved = tmp_path / "first" / "scenario.yaml"
    simulation = yaml.safe_load(resolved.read_text().replace("!", "#"))["simulation"]
    assert (simulation["integrator"], simulation["max_step"]) == ("runge_kutta3", 1e-3)
    assert "runge_kutta3 in steps of 1 ms: the cheapest" in first.attributes["integration"]
    assert first.attributes["integration"][:30] in (tmp_path / "first/report.html").read_text()
    second = run_scenario(tmp_path / "second", resolved)
    assert second.attributes["integration"].endswith("as the scenario says")
    with h5py.File(tmp_path / "first/log.h5") as one, h5py.File(tmp_path / "second/log.h5") as two:
        for name in one:
            np.testing.assert_array_equal(one[name][:], two[name][:])


@pytest.mark.slow
def test_friction_is_made_for_a_step_that_had_to_be_shorter(run_scenario, tmp_path, stiff):
    """The copy, which names the step, gives the same."""
    changes = ("simulation.integrator=auto", "friction.f_c=[20, 20, 10]", *stiff)
    flags = [argument for change in changes for argument in ("--set", change)]
    first = run_scenario(tmp_path / "first", "pfc_elastic_3r", *flags, "--duration", "0.02")
    assert first.status == 0
    resolved = tmp_path / "first" / "scenario.yaml"
    simulation = yaml.safe_load(resolved.read_text().replace("!", "#"))["simulation"]
    assert simulation["max_step"] < 1e-3
    second = run_scenario(tmp_path / "second", resolved)
    np.testing.assert_array_equal(first["tau_f"], second["tau_f"])
    assert np.ptp(first["tau_f"]) > 1.0
