"""Elastic laws without encoders on the links."""

import numpy as np
import pytest

from diagrams.builder import build_station
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


def test_torque_sensors_stand_for_encoders_on_the_links(deviation):
    assert deviation("motor_and_torque", "from_torque") < 2e-5


def test_sensors_that_are_not_exact(deviation):
    off = deviation("motor_and_torque", "from_torque", scale=0.01, noise=0.001)
    assert 1e-5 < off < 5e-4


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
