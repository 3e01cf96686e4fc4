"""Wiring for delayed torques: the state for the law, and its predictor."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.prediction import add_prediction, connect_predictor
from pfsc_drake.errors import InputError


@pytest.fixture(name="bench")
def fixture_bench(load_arm):
    """A builder, the nominal model of an arm, and ports of joint state, torques and friction."""
    builder, chain = DiagramBuilder(), load_arm("comau_racer_1_4_3r").chain
    sources = [builder.AddSystem(ConstantVectorSource(np.zeros(size))) for size in (12, 3, 3)]
    ports = [source.get_output_port() for source in sources]
    return SimpleNamespace(
        builder=builder, nominal=NominalRobot(chain, velocity_delay=5e-4), ports=ports
    )


def test_a_foretold_state_has_velocities_as_new_as_its_positions(bench):
    options = ControllerParameters("rigid", delay=2e-3)
    port, nominal, predictor = add_prediction(bench.builder, bench.nominal, options, bench.ports[0])
    assert port.get_system() is predictor
    assert (nominal.robot, nominal.velocity_delay) == (bench.nominal.robot, 0.0)
    assert predictor.block.states == {"sent": 9}


def test_without_a_delay_the_state_is_the_measured_one(bench):
    options = ControllerParameters("rigid")
    found = add_prediction(bench.builder, bench.nominal, options, bench.ports[0])
    assert found == (bench.ports[0], bench.nominal, None)


@pytest.mark.parametrize("rubs", [False, True])
def test_friction_that_is_overcome_moves_nothing(bench, rubs):
    options = ControllerParameters("rigid", delay=1e-3)
    *_, predictor = add_prediction(bench.builder, bench.nominal, options, bench.ports[0])
    _, drive, friction = bench.ports
    controller = SimpleNamespace(
        drive_port="drive_torque", GetOutputPort={"drive_torque": drive}.get
    )
    connect_predictor(bench.builder, predictor, controller, friction if rubs else None)
    fed = {}
    for (system, number), (source, _) in bench.builder.connection_map().items():
        fed[system.get_input_port(number).get_name()] = source
    expected = {"joint_state": bench.ports[0], "drive_torque": drive}
    expected |= {"friction_torque": friction} if rubs else {}
    assert fed == {name: port.get_system() for name, port in expected.items()}


def test_servos_know_of_no_late_torques(bench):
    options = ControllerParameters("velocity_servo", delay=1e-3)
    with pytest.raises(InputError, match=r"controller.delay = 0.001; allowed: null with the law"):
        add_prediction(bench.builder, bench.nominal, options, bench.ports[0])
