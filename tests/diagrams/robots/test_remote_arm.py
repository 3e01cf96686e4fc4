"""Inputs of a controller whose robot is in another process, and its network."""

import pytest

from diagrams.builder import build_station
from diagrams.controller_part import controller_part
from diagrams.scenario.schema import driven
from experiments.scenario_file import find_scenario
from tests.scenarios import shipped_scenario


def elastic(state, sides):
    settings = shipped_scenario("pfc_elastic_6r")
    settings.controller.state, settings.encoders.sides = state, sides
    return settings


@pytest.mark.slow(but="motors")
@pytest.mark.parametrize(
    ("settings", "inputs"),
    [
        (shipped_scenario("pfc_panda_7r"), {"joint_state": 28, "stop_request": 1}),
        (
            elastic("from_torque", "motor_and_torque"),
            {"joint_state": 24, "stop_request": 1, "joint_torque": 6},
        ),
        # the observer of the springs is the controller's own
        (elastic("observed", "motor"), {"joint_state": 24, "stop_request": 1}),
        (
            shipped_scenario("pfc_compliant_6r"),
            {"joint_state": 24, "stop_request": 1, "measured_wrench": 6},
        ),
    ],
    ids=["rigid", "torques", "motors", "forces"],
)
def test_inputs_of_a_controller(settings, inputs):
    settings, folder = driven(settings)[0], find_scenario("pfc_panda_7r").parent
    settings.simulation.fused = False
    station = build_station(settings, folder, remote=True)
    part = controller_part(station)
    found = {name: port.size for name, port in part.network.inputs.items()}
    assert found == inputs | {"override": 1}
    sources = {
        (target.get_name(), target.get_input_port(i).get_name()): source
        for (target, i), (source, _) in station.diagram.connection_map().items()
    }
    assert sources["controller", "joint_state"] is station.part.measured
