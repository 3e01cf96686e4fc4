"""Path following station: robot, projector, law, drives and log in one diagram."""

from pathlib import Path as FilePath

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder

from diagrams.drives import add_drives, add_friction
from diagrams.external_torque import needs_sensor
from diagrams.following import Task, add_law, add_place_on_path, reference_progress
from diagrams.force_sensor import add_sensor, sensor_warnings
from diagrams.law_warnings import law_warnings
from diagrams.measurement import add_forces, add_joint_state
from diagrams.parts import make_law, make_path
from diagrams.robot import add_robot, tool_frame
from diagrams.scenario import PathFollowingScenario
from diagrams.signal_log import add_log
from diagrams.start import start_state
from diagrams.station import Station
from pfsc_drake.errors import InputError
from pfsc_drake.robot.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial_chain import SerialChain


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
    on_motors = law_name == "rigid" and chain.is_elastic
    task = Task(scenario, chain, path, law, reference_progress(scenario), on_motors)

    joint_state = add_joint_state(
        builder, plant.get_state_output_port(), chain, coordinates, scenario
    )
    place = add_place_on_path(builder, task, joint_state)
    signals = dict(place.signals)
    forces = add_forces(builder, plant, chain, scenario, law.linearization.layout, signals)
    if needs_sensor(scenario):
        tool = tool_frame(plant, scenario.robot)
        forces |= add_sensor(builder, plant, chain, tool, scenario, joint_state)
    controller, made = add_law(builder, task, place, forces)
    signals |= forces | made
    drive = {"drive": controller.GetOutputPort(controller.drive_port)}
    signals |= add_drives(
        builder, plant, chain, coordinates, scenario, signals | drive, initial_state
    )
    signals |= add_friction(builder, plant, chain, coordinates, scenario, folder)
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
        place.projector,
        controller,
        log,
        task.progress.domain[1],
        initial_state,
        initial_theta,
        on_motors,
        law_warnings(scenario, chain, coordinates.link_rows @ initial_state)
        + sensor_warnings(scenario),
    )
