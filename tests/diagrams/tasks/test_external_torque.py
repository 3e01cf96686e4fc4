"""External torques in the law of a station with forces on the tool."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse

BEGIN, RAMP = 0.05, 0.1
FORCE = np.array([0.0, 40.0, -20.0])


def filtered_rate(bandwidth):
    """Return what two poles at ``-bandwidth`` make of the swelling, as a part of it."""
    t = np.linspace(0.0, RAMP / 2, 100_001)
    age, x = RAMP / 2 - t, t / RAMP
    weight = bandwidth**2 * age * np.exp(-bandwidth * age)
    return np.trapezoid(weight * 16.0 * (x * (1.0 - x)) ** 2, t)


@pytest.mark.slow(but=["20.0", "0.0"])
@pytest.mark.parametrize("bandwidth", [200.0, 20.0, 0.0])
def test_the_rate_of_the_torques_is_as_fast_as_the_bandwidth(load_scenario, bandwidth):
    """In the middle of a force that swells; a slow estimator lags behind, 0 asks for none."""
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law = "visco_elastic"
    settings.controller.gains["visco_elastic"] = settings.controller.gains["elastic"]
    for kind in ("eta", "xi"):
        getattr(settings.controller.gains["visco_elastic"], kind).poles = [-30.0] * 3
    settings.controller.external_torque.source = "known"
    settings.controller.external_torque.bandwidth = bandwidth
    settings.start.offset, settings.reference.dwell = [0.0, 0.0], 1.0
    settings.forces = [ForcePulse(BEGIN, 1.0, FORCE, ramp=RAMP)]
    station = build_station(settings, Path())
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(BEGIN + RAMP / 2)
    system = station.diagram.GetSubsystemByName("controller").GetSubsystemByName("external_torque")
    _, rate = system.GetOutputPort("tau_ext").Eval(system.GetMyContextFromRoot(root)).reshape(2, 3)
    # the smooth step is steepest there, 15/8 of a linear one
    swelling = 15.0 / 8.0 * FORCE / RAMP
    joints = station.log.read(root)[1]["joint_state"][-1, :3]
    expected = jacobian(station, joints).T @ swelling
    share = rate @ expected / (expected @ expected)
    assert share == pytest.approx(filtered_rate(bandwidth), abs=0.01)


def jacobian(station, q_J):
    """Return ``d y_t / dq`` by differences, from the plant's own kinematics."""
    model, tool = station.part.model, station.part.tool
    context, columns = model.CreateDefaultContext(), []
    for step in 1e-6 * np.eye(3):
        ends = []
        for q in (q_J + step, q_J - step):
            state = station.part.coordinates.plant_state(
                np.concatenate([q, np.zeros(3), q, np.zeros(3)])
            )
            model.SetPositionsAndVelocities(context, state)
            ends.append(tool.CalcPoseInWorld(context).translation())
        columns.append((ends[0] - ends[1]) / 2e-6)
    return np.array(columns).T
