"""Compliance: force/torque sensor, tool compensation, manifold forces and impedance filter."""

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Demultiplexer

from diagrams.robot import tool_frame
from diagrams.scenario import PathFollowingScenario
from pfsc_drake.control.impedance import ImpedanceLaw
from pfsc_drake.control.linearization import Linearization
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial_chain import SerialChain
from pfsc_drake.systems.force_torque_sensor import ForceTorqueSensor
from pfsc_drake.systems.impedance_filter import ImpedanceFilter
from pfsc_drake.systems.manifold_force_transform import ManifoldForceTransform
from pfsc_drake.systems.tool_compensation import ToolCompensation, tool_load_from_plant

# up to which derivative the filter knows the external reference, see ImpedanceLaw
_DESIRED_ORDER = 4


def reference_order(scenario: PathFollowingScenario, linearization: Linearization) -> int:
    """Return the highest derivative of the external reference that is needed.

    Args:
        scenario: The scenario.
        linearization: Of the law.

    Raises:
        InputError: If there is compliance that the law cannot have.
    """
    if not scenario.compliance.is_given:
        return linearization.relative_degree
    if linearization.time_driven:
        raise InputError(
            "compliance: controller.manifold = trajectory has no path coordinates that could "
            "yield; must be path"
        )
    return max(linearization.relative_degree, _DESIRED_ORDER)


def add_compliance(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    chain: SerialChain,
    scenario: PathFollowingScenario,
    linearization: Linearization,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add everything between the forces on the tool and the reference of the law.

    Args:
        builder: Builder of the diagram.
        plant: Plant with the robot.
        chain: The robot.
        scenario: The scenario, with compliance.
        linearization: Of the law that follows the reference.
        ports: ``joint_state``, ``path_point``, ``manifold_state`` and ``desired_reference``
            with derivatives up to :func:`reference_order`.

    Returns:
        ``reference`` for the law, and for the log ``desired_reference``, ``manifold_force``,
        and of the sensor ``wrench_measured`` (at the tool point, world axes), ``tared``,
        ``sensor_fault``.

    Raises:
        InputError: If compliance or sensor do not suit the robot or the law.
    """
    layout, period = linearization.layout, scenario.controller.sampling_time
    sensor = _add_sensor(builder, plant, chain, scenario, ports["joint_state"])
    law = ImpedanceLaw(
        scenario.compliance.impedance(),
        linearization.num_outputs,
        linearization.relative_degree,
        period,
        desired_order=reference_order(scenario, linearization),
    )
    impedance = builder.AddNamedSystem("impedance_filter", ImpedanceFilter(law))
    transform = builder.AddNamedSystem(
        "manifold_force_transform",
        ManifoldForceTransform(layout, with_turning=scenario.compliance.with_turning),
    )
    reference = impedance.GetOutputPort("reference")
    force = transform.GetOutputPort("manifold_force")
    builder.Connect(sensor["wrench_measured"], transform.GetInputPort("wrench"))
    builder.Connect(ports["path_point"], transform.GetInputPort("path_point"))
    if layout.oriented:
        builder.Connect(reference, transform.GetInputPort("reference"))
    builder.Connect(force, impedance.GetInputPort("manifold_force"))
    for name in ("desired_reference", "manifold_state"):
        builder.Connect(ports[name], impedance.GetInputPort(name))
    desired = ports["desired_reference"]
    return {
        "reference": reference,
        "desired_reference": desired,
        "manifold_force": force,
        **sensor,
    }


def compliance_warnings(scenario: PathFollowingScenario) -> list[str]:
    """Return what may keep a scenario's sensor from being tared."""
    noisy = scenario.encoders.difference_quotient and scenario.sensor.inertia != "none"
    if not (scenario.compliance.is_given and noisy):
        return []
    return [
        "the tool's inertial load comes from the second difference of encoder positions; if that "
        "is noisier than sensor.taring_spread, the sensor is never tared and the tool does not "
        "yield: filter the velocities (encoders.filter_time) or take sensor.inertia 'none'"
    ]


def _add_sensor(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    chain: SerialChain,
    scenario: PathFollowingScenario,
    joint_state: OutputPort,
) -> dict[str, OutputPort]:
    """Add the sensor with taring and compensation of the tool, and return its signals."""
    parameters, period = scenario.sensor, scenario.controller.sampling_time
    if not plant.HasJointNamed(parameters.joint):
        raise InputError(
            f"sensor.joint: the model {scenario.robot.model} has no joint '{parameters.joint}'"
        )
    joint = plant.GetJointByName(parameters.joint)
    sensor = builder.AddNamedSystem(
        "force_torque_sensor", ForceTorqueSensor(plant, joint, parameters.transducer(), period)
    )
    load = tool_load_from_plant(plant, joint, tool_frame(plant, scenario.robot))
    compensation = builder.AddNamedSystem(
        "tool_compensation",
        ToolCompensation(
            chain, load, parameters.measurement_range, parameters.compensation(), period
        ),
    )
    builder.Connect(plant.get_reaction_forces_output_port(), sensor.GetInputPort("reaction_forces"))
    builder.Connect(
        sensor.GetOutputPort("measured_wrench"), compensation.GetInputPort("measured_wrench")
    )
    builder.Connect(joint_state, compensation.GetInputPort("joint_state"))
    # one port, split without Python, costs less time per tick than its parts one by one
    whole = compensation.GetOutputPort("compensation")
    sizes = [6, 1, 1, whole.size() - 8]
    split = builder.AddNamedSystem("sensor_signals", Demultiplexer(sizes))
    builder.Connect(whole, split.get_input_port())
    names = ("wrench_measured", "tared", "sensor_fault")
    return {name: split.get_output_port(i) for i, name in enumerate(names)}
