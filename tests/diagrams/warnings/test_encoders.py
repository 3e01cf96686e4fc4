"""Encoders that are too coarse for their law."""

import numpy as np
import pytest

from diagrams.builder import build_station
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.robot.robot_model import mass_function


@pytest.mark.parametrize("share", [0.29, 0.31, 2.0])
def test_an_increment_that_becomes_a_jump_of_the_torque(load_exact_scenario, share):
    """Increments by which the drive of the worst joint would be asked for a share of its torque."""
    settings = load_exact_scenario("pfc_comau_6r")
    station = build_station(settings, SCENARIO_DIRECTORY)
    robot, q_J = station.robot, station.start_posture
    inertia = np.diag(np.array(mass_function(robot)(q_J))) + robot.D_M
    gain = station.law.stabilization.proportional[1].max()
    worst = np.max(inertia / robot.gather("effort_limit"))
    increments = 2.0 * np.pi * worst * gain / (share * settings.controller.sampling_time)
    settings.encoders.link_increments = [float(increments)]
    settings.encoders.difference_quotient = True
    said = [
        s for s in build_station(settings, SCENARIO_DIRECTORY).warnings if s.startswith("encoders:")
    ]
    if share < 0.3:
        assert said == []
    else:
        (sentence,) = said
        assert f"answer with {100.0 * share:.0f} % of the torque" in sentence
