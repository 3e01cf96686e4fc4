"""Drives that stick are as stiff as the plant that moves them allows, whichever it is."""

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, Keyframe, Line
from diagrams.scenario.workpiece import BallParameters, NotchParameters
from experiments.scenario_file import SCENARIO_DIRECTORY
from experiments.simulation import simulate

# omega h of stuck bristles: continuous plants, and those that read the friction at their ticks
CONTINUOUS, DISCRETE = 1.0, 0.5


def free_delta(settings):
    settings.start.offset = [0.0, 0.0]
    return settings.simulation.max_step, DISCRETE


def analytic_delta(settings):
    settings.robot.plant = "analytic"
    step, _ = free_delta(settings)
    return step, CONTINUOUS


def delta_in_a_notch(settings):
    return settings.notch.time_step, DISCRETE


def arm_in_a_notch(settings):
    settings.path.shape = Line([0.8, -0.15, 0.9], [0.8, 0.15, 0.9])
    settings.path.orientation.convention = "zyz"
    settings.path.orientation.keyframes = [Keyframe(0.0, [0.0, 150.0, 180.0])]
    settings.start.posture_deg = [0.0, 90.0, -30.0, 0.0, 60.0, 0.0]
    settings.reference.points = [0.0, 0.3]
    settings.notch = NotchParameters(BallParameters(distance=0.0), [0.0, 0.0, 0.0])
    settings.friction.f_c = [40.0] * 3 + [5.0] * 3
    return settings.notch.time_step, DISCRETE


@pytest.mark.slow(but="pfc_delta-analytic_delta")
@pytest.mark.parametrize(
    ("scenario", "change"),
    [
        ("pfc_delta", free_delta),
        ("pfc_delta", analytic_delta),
        ("pfc_delta_notch", delta_in_a_notch),
        ("pfc_compliant_6r", arm_in_a_notch),
    ],
)
def test_stuck_drives_bend_as_their_inertia_and_the_step_say(load_exact_scenario, scenario, change):
    """``force / bend = J (omega h)^2 / h^2``, from what a small push changes."""
    settings = load_exact_scenario(scenario)
    step, frequency = change(settings)
    settings.reference.dwell = 2.0
    # until then the reference rests where the tool is, in the middle of the notch
    settings.sensor.taring_time = 1.0
    settings.forces = [ForcePulse(0.04, 2.0, np.array([1.0, 1.5, 0.0]), ramp=0.05)]
    station = build_station(settings, SCENARIO_DIRECTORY)
    result = simulate(station, settings.simulation, 0.12, lambda *_: None)
    _, log = station.log.read(result.root)
    n = station.robot.dimension
    before_and_after = [39, -1]
    bend = np.diff(log["joint_state"][before_and_after, 2 * n : 3 * n], axis=0)[0]
    force = np.diff(log["friction_torque"][before_and_after], axis=0)[0]
    pushed = np.argmax(np.abs(force))
    assert abs(force[pushed]) > 0.2
    inertia = station.part.drives.inertia[pushed]
    if scenario != "pfc_compliant_6r":
        # a slide with its share of the rods
        assert inertia == pytest.approx(1.0 + 2.0 / 3.0 * 0.15)
    stiffness = inertia * (frequency / step) ** 2
    assert force[pushed] / bend[pushed] == pytest.approx(stiffness, rel=0.02)
