"""Path following station: robot, projector, law, drives and log in one diagram."""

from pathlib import Path as FilePath

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder

from diagrams.compliance import add_compliance, reference_order
from diagrams.drives import add_drives, add_friction
from diagrams.force_sensor import add_sensor, sensor_warnings
from diagrams.measurement import add_forces, add_joint_state
from diagrams.parts import make_law, make_path
from diagrams.robot import add_robot, tool_frame
from diagrams.scenario import ControllerParameters, PathFollowingScenario
from diagrams.signal_log import add_log
from diagrams.start import start_state
from diagrams.station import Station
from pfsc_drake.control.reference import rest_to_rest
from pfsc_drake.errors import InputError
from pfsc_drake.robot.chain_from_plant import chain_from_plant
from pfsc_drake.robot.resonance import joint_resonances
from pfsc_drake.robot.serial_chain import SerialChain
from pfsc_drake.systems.path_following_controller import PathFollowingController
from pfsc_drake.systems.path_projector import PathProjector
from pfsc_drake.systems.reference_generator import ReferenceGenerator
from pfsc_drake.systems.tool_kinematics import ToolKinematics
from pfsc_drake.systems.trajectory_point import TrajectoryPoint

# rad per sampling interval, up to which the exact elastic law keeps its accuracy
_FASTEST_RESONANCE = 1.0
# K_s epsilon D_b T_s / D_M, up to which the sampled damping (3.71) is stable with some margin
_FASTEST_DAMPING = 1.8


class PathFollowingStation(Station[MultibodyPlant, SerialChain]):
    """Station of a serial arm.

    Its log also holds, with forces ``wrench_ext``, ``tau_ext``, with compliance what
    :func:`add_compliance` returns, with servos ``drive_torque``, with friction
    ``friction_torque``.
    """

    def place_robot(self, context: Context) -> None:
        """See :meth:`Station.place_robot`."""
        self.plant.SetPositionsAndVelocities(context, self.initial_state)


def build_path_following(scenario: PathFollowingScenario, folder: FilePath) -> PathFollowingStation:
    """Build the station of a path following scenario.

    Args:
        scenario: The scenario.
        folder: Where the scenario's relative file names start.

    Returns:
        The station; everything in the scenario that can be wrong has been checked.

    Raises:
        InputError: If the scenario cannot be built.
    """
    builder = DiagramBuilder()
    plant = add_robot(builder, scenario.robot, folder)
    chain, coordinates = chain_from_plant(plant, tool_frame(plant, scenario.robot))
    undriven = [n for n, a in zip(chain.names, coordinates.actuators, strict=True) if a < 0]
    if undriven:
        raise InputError(
            f"robot.model: {', '.join(undriven)} without actuator; every joint needs one"
        )
    period, law_name = scenario.controller.sampling_time, scenario.controller.law
    path = make_path(scenario.path, law_name, folder)
    law = make_law(scenario.controller, chain, path.orientation is not None)
    initial_state, initial_theta = start_state(scenario, path, chain, coordinates)
    linearization = law.linearization
    relative_degree = linearization.relative_degree
    reference = scenario.reference
    eta_p = rest_to_rest(
        reference.points,
        velocity=reference.velocity,
        acceleration=reference.acceleration,
        dwell=reference.dwell,
    )

    joint_state = add_joint_state(
        builder, plant.get_state_output_port(), chain, coordinates, scenario
    )
    on_motors = law_name == "rigid" and chain.is_elastic
    kinematics = builder.AddNamedSystem("tool_kinematics", ToolKinematics(chain, on_motors))
    projector = builder.AddNamedSystem(
        "path_projector", PathProjector(path, relative_degree, period)
    )
    controller = builder.AddNamedSystem(
        "path_following_controller", PathFollowingController(law, period)
    )
    order = reference_order(scenario, linearization)
    generator = builder.AddNamedSystem(
        "reference_generator", ReferenceGenerator(eta_p, order, linearization.num_outputs)
    )

    tool_pose = kinematics.GetOutputPort("tool_pose")
    path_point = projector.GetOutputPort("path_point")
    desired = generator.GetOutputPort("reference")
    builder.Connect(joint_state, kinematics.GetInputPort("joint_state"))
    builder.Connect(tool_pose, projector.GetInputPort("tool_pose"))
    builder.Connect(joint_state, controller.GetInputPort("joint_state"))
    if linearization.time_driven:
        leader = builder.AddNamedSystem(
            "trajectory_point", TrajectoryPoint(path, relative_degree, linearization.num_outputs)
        )
        builder.Connect(desired, leader.GetInputPort("reference"))
        path_point = leader.GetOutputPort("path_point")
    builder.Connect(path_point, controller.GetInputPort("path_point"))
    signals = {
        "joint_state": joint_state,
        "tool_pose": tool_pose,
        "path_point": path_point,
        "reference": desired,
        "law": controller.GetOutputPort("law"),
    }
    if scenario.compliance.is_given:
        tool = tool_frame(plant, scenario.robot)
        signals |= add_sensor(builder, plant, chain, tool, scenario, joint_state)
        manifold_state = controller.GetOutputPort("manifold_state")
        inputs = signals | {"desired_reference": desired, "manifold_state": manifold_state}
        signals |= add_compliance(builder, scenario, linearization, inputs)
    builder.Connect(signals["reference"], controller.GetInputPort("reference"))
    drive = {"drive": controller.GetOutputPort(controller.drive_port)}
    signals |= add_drives(
        builder, plant, chain, coordinates, scenario, signals | drive, initial_state
    )
    signals |= add_friction(builder, plant, chain, coordinates, scenario, folder)
    signals |= add_forces(builder, plant, chain, scenario, linearization.layout, signals)
    log = add_log(builder, signals, period)
    diagram = builder.Build()
    diagram.set_name(scenario.name or "path_following")
    return PathFollowingStation(
        diagram,
        plant,
        chain,
        coordinates,
        path,
        law,
        projector,
        controller,
        log,
        eta_p.domain[1],
        initial_state,
        initial_theta,
        on_motors,
        _warnings(scenario.controller, chain, coordinates.link_rows @ initial_state)
        + sensor_warnings(scenario),
    )


def _warnings(
    parameters: ControllerParameters, chain: SerialChain, link_state: np.ndarray
) -> list[str]:
    """Return what a sampled controller will not do well on this robot."""
    period = parameters.sampling_time
    if parameters.law == "elastic":
        resonance = joint_resonances(chain, link_state[: chain.dimension])[-1]
        if resonance * period > _FASTEST_RESONANCE:
            return [
                f"the joints resonate at up to {resonance / (2.0 * np.pi):.0f} Hz, "
                f"{resonance * period:.2f} rad per sampling interval; above "
                f"{_FASTEST_RESONANCE:g} rad the law 'elastic' loses accuracy and then "
                "oscillates: sample faster or take the law 'singular_perturbation'"
            ]
    if parameters.law == "singular_perturbation":
        damping = np.array(parameters.boundary_layer_damping)
        rate = float(np.max(chain.K_s * damping * period / chain.D_M))
        if rate > _FASTEST_DAMPING:
            return [
                f"K_s epsilon D_b T_s / D_M is up to {rate:.2f}; above {_FASTEST_DAMPING:g} the "
                "sampled damping of the joint torques oscillates: lower "
                "controller.boundary_layer_damping or sample faster"
            ]
    return []
