"""Joint coordinates as a person reads them."""

import numpy as np

from diagrams.builder import build_station
from experiments.scenario_file import find_scenario
from pfsc_drake.robot.coordinate_text import coordinate_text, enumeration, eta_text, posture_text


def test_coordinates_with_units():
    assert coordinate_text(np.deg2rad(-32.26), revolute=True) == "-32.3 deg"
    assert coordinate_text(np.deg2rad(0.0123), revolute=True) == "0.012 deg"
    assert coordinate_text(0.0, revolute=True) == "0 deg"
    assert coordinate_text(0.12345, revolute=False) == "0.1235 m"


def test_rounding_errors_read_zero():
    assert coordinate_text(-1.3e-17, revolute=False) == "0 m"
    assert coordinate_text(2e-16, revolute=True) == "0 deg"
    assert coordinate_text(-3e-9, revolute=False) == "-3e-09 m"
    assert eta_text(np.array([0.43214, -1.919e-16])) == "eta = 0.4321, 0 m"
    assert eta_text([0.43214], digits=3) == "eta = 0.432 m"


def test_lists():
    assert enumeration(["a"]) == "a"
    assert enumeration(["a", "b"]) == "a and b"
    assert enumeration(["a", "b", "c"]) == "a, b and c"


def test_postures_of_arms_and_slides(load_scenario):
    arm = build_station(load_scenario("pfc_elastic_3r"), None).robot
    q = np.deg2rad([10.0, -20.0, 30.0])
    assert posture_text(arm, q) == "q_1 = 10.0 deg, q_2 = -20.0 deg, q_3 = 30.0 deg"
    assert posture_text(arm, q, [2]) == "q_3 = 30.0 deg"
    folder = find_scenario("pfc_delta").parent
    station = build_station(load_scenario("pfc_delta"), folder)
    assert posture_text(station.robot, np.array([0.1, 0.2, 0.3]), [0, 1]) == (
        "q_1 = 0.1 m, q_2 = 0.2 m"
    )
    np.testing.assert_array_equal(station.start_posture, station.initial_state[:3])
