"""What the controller measures, and what disturbs the robot."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain, ZeroOrderHold

from diagrams.robot import tool_frame
from diagrams.scenario import PathFollowingScenario
from pfsc_drake.control.force_profile import ForceProfile
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.robot.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial_chain import SerialChain
from pfsc_drake.systems.decoupled_force import DecoupledForce
from pfsc_drake.systems.external_wrench import ExternalWrench
from pfsc_drake.systems.joint_encoders import EncoderOptions, JointEncoders
from pfsc_drake.systems.scripted_force import ScriptedForce
from pfsc_drake.systems.sensor_failure import SensorFailure


def add_joint_state(
    builder: DiagramBuilder,
    plant_state: OutputPort,
    robot: RobotModel,
    coordinates: PlantCoordinates,
    scenario: PathFollowingScenario,
) -> OutputPort:
    """Add the encoders, and return ``[q_J, v_J, q_M, v_M]`` as measured.

    Args:
        builder: Builder of the diagram.
        plant_state: State of the plant.
        robot: The robot.
        coordinates: Where its coordinates stand in the plant's state.
        scenario: The scenario.

    Raises:
        InputError: If the encoders do not suit the robot, or a sensor is to fail that does
            not exist.
    """
    rows = np.vstack([coordinates.link_rows, coordinates.motor_rows])
    encoders = builder.AddNamedSystem("joint_encoders", MatrixGain(rows))
    builder.Connect(plant_state, encoders.get_input_port())
    measured = _add_imperfection(builder, encoders.get_output_port(), robot, scenario)
    failure = scenario.simulation.sensor_failure
    if failure.time < 0.0:
        return measured
    size = 4 * robot.dimension
    if not 0 <= failure.component < size:
        raise InputError(
            f"simulation.sensor_failure.component: {failure.component}; allowed: 0 to {size - 1}"
        )
    broken = builder.AddNamedSystem(
        "sensor_failure", SensorFailure(size, failure.component, failure.time)
    )
    builder.Connect(measured, broken.GetInputPort("measured"))
    return broken.GetOutputPort("delivered")


def _add_imperfection(
    builder: DiagramBuilder,
    joint_state: OutputPort,
    robot: RobotModel,
    scenario: PathFollowingScenario,
) -> OutputPort:
    """Add increments and difference quotients, if there are any."""
    options = scenario.encoders
    if options == EncoderOptions():
        return joint_state
    period = scenario.controller.sampling_time
    if scenario.controller.law == "velocity_servo":
        period = scenario.servo.period or period
    real = builder.AddNamedSystem("encoder_increments", JointEncoders(robot, options, period))
    builder.Connect(joint_state, real.GetInputPort("joint_state"))
    return real.GetOutputPort("joint_state")


def add_forces(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    chain: SerialChain,
    scenario: PathFollowingScenario,
    layout: PathPointLayout,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add the scenario's forces on the tool, and return their signals for the log.

    Args:
        builder: Builder of the diagram.
        plant: Plant with the robot.
        chain: The robot.
        scenario: The scenario.
        layout: Layout of the path point.
        ports: ``joint_state`` and ``path_point``.

    Raises:
        InputError: If a force does not suit the robot.
    """
    period, sources = scenario.controller.sampling_time, []
    if scenario.forces:
        profile = ForceProfile(scenario.forces)
        operator = builder.AddNamedSystem("operator", ScriptedForce(profile, layout, period))
        if profile.needs_path:
            builder.Connect(ports["path_point"], operator.GetInputPort("path_point"))
        sources.append(operator.GetOutputPort("wrench"))
    pulse = scenario.hold_back
    if pulse.force != 0.0:
        if not layout.oriented:
            raise InputError("hold_back.force: needs a path with orientation and six axes")
        shape = (pulse.begin, pulse.end, pulse.ramp, pulse.force)
        brake = builder.AddNamedSystem("hold_back", DecoupledForce(chain, layout, shape, period))
        for name in ("joint_state", "path_point"):
            builder.Connect(ports[name], brake.GetInputPort(name))
        sources.append(brake.GetOutputPort("wrench"))
    if not sources:
        return {}
    total = builder.AddNamedSystem("wrench", Adder(len(sources), 6))
    for i, source in enumerate(sources):
        builder.Connect(source, total.get_input_port(i))
    # held over a tick, so that it is computed once and not in every stage of the integrator
    hold = builder.AddNamedSystem("wrench_hold", ZeroOrderHold(period, 6))
    builder.Connect(total.get_output_port(), hold.get_input_port())
    wrench = hold.get_output_port()
    contact = builder.AddNamedSystem(
        "external_wrench", ExternalWrench(tool_frame(plant, scenario.robot), chain)
    )
    builder.Connect(wrench, contact.GetInputPort("wrench"))
    builder.Connect(ports["joint_state"], contact.GetInputPort("joint_state"))
    builder.Connect(
        contact.GetOutputPort("applied_spatial_force"),
        plant.get_applied_spatial_force_input_port(),
    )
    return {"wrench_ext": wrench, "tau_ext": contact.GetOutputPort("tau_ext")}
