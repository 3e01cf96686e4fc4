"""Loops with drives that stick, against the growth of a simulated disturbance."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse
from experiments.scenario_file import SCENARIO_DIRECTORY
from experiments.simulation import simulate
from experiments.studies.margins.sticking import PRESLIDINGS, sticking_sentence, stuck_drives
from tests.scenarios import shipped_scenario

F_C = [110.0, 95.0, 70.0, 6.0, 7.0, 4.4]  # Nm
SOFT = PRESLIDINGS[-1]


def at_rest():
    """Six elastic axes at rest on friction."""
    settings = shipped_scenario("pfc_elastic_6r")
    settings.friction.f_c = F_C
    settings.friction.f_v = [90.0, 80.0, 30.0, 4.0, 5.0, 3.0]
    settings.controller.friction.source = "observer"
    settings.controller.friction.rate = 350.0
    settings.reference.dwell = 1.0
    settings.start.offset, settings.start.rotation_deg = [0.0, 0.0], [0.0, 0.0, 0.0]
    return settings


@pytest.fixture(scope="module")
def stuck():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.studies.margins.sticking.PRESLIDINGS", [SOFT])
        return stuck_drives(at_rest(), SCENARIO_DIRECTORY, 6, lambda _: None)


@pytest.mark.slow
def test_a_disturbance_grows_as_it_is_said(stuck):
    settings = at_rest()
    settings.controller.friction.hold_at_rest = False
    settings.friction.presliding = [SOFT] * 6
    settings.simulation.accuracy, settings.simulation.integrator = 1e-7, "runge_kutta3"
    settings.forces = [ForcePulse(0.01, 0.02, 1e-3 * np.array([1.0, 2.0, -3.0]), ramp=0.001)]
    station = build_station(settings, SCENARIO_DIRECTORY)
    result = simulate(station, settings.simulation, 0.26, lambda *_: None)
    times, log = station.log.read(result.root)
    torque = log["law"][:, station.law.layout.drive]
    grown = (torque - torque[5])[100:260]
    peaks = np.log(np.abs(grown).max(axis=1).reshape(4, 40).max(axis=1))
    assert np.diff(peaks)[1:] / 0.04 == pytest.approx(stuck.rate, rel=0.05)
    # the largest of the spectrum, to a quarter of its resolution
    spectrum = np.abs(np.fft.rfft(grown[:, 5] * np.exp(-stuck.rate * times[100:260])))
    assert np.argmax(spectrum) / 0.16 == pytest.approx(stuck.frequency / (2.0 * np.pi), abs=5.0)
    assert stuck.rate > 30.0


def test_the_hold_is_named_where_it_is_needed(stuck):
    said = sticking_sentence(stuck)
    assert "would be unstable: it grows with 40 1/s at 101 Hz; torques are held there" in said
    assert sticking_sentence(replace(stuck, held=False)).endswith("hold_at_rest = true.")
    assert "is stable: it decays with 3 1/s" in sticking_sentence(replace(stuck, rate=-3.0))


def test_nothing_is_said_where_nothing_is_compensated():
    settings = at_rest()
    settings.controller.friction.source = "none"
    assert stuck_drives(settings, SCENARIO_DIRECTORY, 6, lambda _: None) is None
