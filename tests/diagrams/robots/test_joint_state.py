"""Elastic laws without encoders on the links."""

import numpy as np
import pytest

from diagrams.builder import build_station
from experiments.results.found_links_feature import found_links_metrics
from experiments.results.run_signals import collect_log
from experiments.scenario_file import find_scenario
from experiments.simulation import simulate
from pfsc_drake.errors import InputError

FOLDER = find_scenario("pfc_elastic_6r").parent


@pytest.fixture
def deviation(load_scenario):
    """Return how far the tool leaves its path, once on it, in 0.9 s at up to 1.1 m/s."""

    def run(sides, state, **torque):
        settings = load_scenario("pfc_elastic_6r")
        settings.encoders.sides, settings.controller.state = sides, state
        for name, value in torque.items():
            setattr(settings.encoders.torque, name, value)
        for kind in ("eta", "xi", "phi"):
            getattr(settings.controller.gains["elastic"], kind).poles = [-40, -40, -250, -350]
        settings.simulation.fused = True
        settings.simulation.integrator = "runge_kutta3"
        station = build_station(settings, FOLDER)
        result = simulate(station, settings.simulation, 0.9, lambda *_: None)
        assert result.fault is None
        log = collect_log(station, result.root)
        return np.abs(log["xi"].values[log.time > 0.4]).max()

    return run


@pytest.mark.slow
def test_torque_sensors_stand_for_encoders_on_the_links(deviation):
    assert deviation("motor_and_torque", "from_torque") < 2e-5


@pytest.mark.slow
def test_sensors_that_are_not_exact(deviation):
    off = deviation("motor_and_torque", "from_torque", scale=0.01, noise=0.001)
    assert 1e-5 < off < 5e-4


@pytest.mark.slow
def test_motors_alone_tell_of_the_springs(deviation):
    assert 1e-5 < deviation("motor", "observed") < 4e-4


@pytest.mark.parametrize(
    ("sides", "state", "said"),
    [
        ("motor", "measured", "sides = motor; allowed: both where controller.state is measured"),
        ("motor", "from_torque", "allowed: motor_and_torque where controller.state is from_torq"),
        ("both", "observed", "allowed: motor or motor_and_torque where controller.state is obse"),
    ],
)
def test_what_a_controller_wants_must_be_measured(load_scenario, sides, state, said):
    settings = load_scenario("pfc_elastic_6r")
    settings.encoders.sides, settings.controller.state = sides, state
    with pytest.raises(InputError, match=said):
        build_station(settings, FOLDER)


def test_a_law_on_the_motors_wants_no_links(load_scenario):
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law, settings.encoders.sides = "rigid", "motor"
    assert build_station(settings, FOLDER).on_motors


def drawn(load_scenario, sides, state, seed, errors=1.0):
    """Return the log of 0.4 s with random errors of the controller's error model.

    Args:
        load_scenario: Loads a shipped scenario.
        sides: What is measured.
        state: Where the links are found by.
        seed: Seed of the errors.
        errors: What they are multiplied by.
    """
    settings, rng = load_scenario("pfc_elastic_6r"), np.random.default_rng(seed)
    settings.encoders.sides, settings.controller.state = sides, state
    known, torque = settings.controller.state_uncertainty, settings.encoders.torque
    for kind in ("eta", "xi", "phi"):
        getattr(settings.controller.gains["elastic"], kind).poles = [-40, -40, -250, -350]
    settings.reference.dwell, settings.start.transition = 0.1, 0.1

    def factors(sigma):
        return (1.0 + errors * sigma * rng.standard_normal(6)).tolist()

    settings.model_error.stiffness = factors(known.stiffness)
    if state == "from_torque":
        torque.scale = errors * known.torque_scale * rng.standard_normal()
        torque.noise, torque.seed = errors * known.torque_noise, seed
    else:
        settings.friction.file = "comau_racer_1_4"
        settings.model_error.friction = factors(known.friction)
    settings.simulation.fused, settings.simulation.integrator = True, "runge_kutta3"
    station = build_station(settings, FOLDER)
    result = simulate(station, settings.simulation, 0.4, lambda *_: None)
    assert result.fault is None
    return collect_log(station, result.root)


def within(log):
    """Return the share of positions within two standard deviations, and error by deviation."""
    off = np.abs(log["q_J_found"].values - log["q_J"].values)
    ratio = off / log["q_J_deviation"].values
    share = found_links_metrics(log)["links_within_two_sigma"].value
    assert share == pytest.approx(np.mean(ratio <= 2.0))
    return share, np.mean(ratio**2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sides", "state"), [("motor_and_torque", "from_torque"), ("motor", "observed")]
)
def test_deviations_promise_what_is_kept(load_scenario, sides, state):
    """Over draws of all that is said to be uncertain; of errors three times as large it is not."""
    logs = [drawn(load_scenario, sides, state, seed) for seed in (1, 2, 3)]
    shares, squares = np.array([within(log) for log in logs]).T
    assert 0.9 < shares.mean() < 0.99
    assert 0.5 < squares.mean() < 1.6
    log = logs[0]
    off = np.abs(log["y_t_found"].values - log["y_t"].values)
    assert 0.8 < np.mean(off <= 2.0 * log["y_t_deviation"].values) <= 1.0
    assert 1e-5 < found_links_metrics(log)["largest_tool_deviation"].value < 1e-3
    assert within(drawn(load_scenario, sides, state, 0, errors=3.0))[0] < 0.8


def test_measured_links_have_no_deviation(load_scenario):
    station = build_station(load_scenario("pfc_elastic_3r"), FOLDER)
    assert not [name for name in station.log.rows if "deviation" in name or "found" in name]
