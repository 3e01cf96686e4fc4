"""A serial arm in a diagram, with any plant."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.geometry import GeometryId, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from diagrams.robots.arm_model import ArmModel, nominal_arm, read_arm
from diagrams.robots.model import tool_frame
from diagrams.robots.nominal_model import NominalModel, NominalModelSource
from diagrams.robots.part import Drives, Ports, RobotPart, SensorMount
from diagrams.robots.plant_wiring import (
    add_external_wrench,
    add_scene,
    add_tool_reaction,
    connect_actuation,
    connect_push,
    connect_resistance,
    connect_scene,
    connect_torques,
    joint_state_of,
)
from diagrams.robots.start_posture import posture_warnings, start_posture, tilt_warnings
from diagrams.robots.workpiece import Workpiece
from diagrams.scenario import StartParameters
from diagrams.scenario.robot import MULTIBODY
from pfsc_drake.checks import require
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates, state_at_rest
from pfsc_drake.robot.serial.rotor_coupling import mounts_from_parameters
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.applied_wrenches import LinkPushes
from pfsc_drake.systems.plants.coupled_plants import FullElasticPlant
from pfsc_drake.systems.plants.reactions import ContactWrench, reaction_index

_ROUNDING = 1e-6  # m
# times the reach: a distance at which a number is probably in mm
_IN_MM = 50.0


@dataclass(frozen=True)
class Arm(RobotPart):
    """A serial arm in a diagram.

    Attributes:
        actual: The simulated arm.
        nominal_model: Nominal model of the arm, by which it is controlled.
        source_model: Model that the nominal model is derived from, by default ``actual``.
    """

    actual: ArmModel
    nominal_model: NominalModel
    source_model: ArmModel

    @property
    def model(self) -> MultibodyPlant:
        """Drake's model of the arm, finalized."""
        return self.actual.plant

    @property
    def robot(self) -> SerialChain:  # type: ignore[override]
        """The simulated arm, N joints."""
        return self.actual.chain

    @property
    def coordinates(self) -> PlantCoordinates:  # type: ignore[override]
        """Indices of its coordinates in the state of ``model``."""
        return self.actual.coordinates

    @property
    def tool(self) -> Frame:
        """Frame whose origin follows the manifold."""
        return self.actual.tool

    @property
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration in the world [m/s^2], shape (3,)."""
        return self.robot.gravity

    @property
    def drives(self) -> Drives:
        """Drives that friction acts on."""
        return Drives(self.robot.D_M, step=self.model.time_step() or None)

    def posture(self, target: ToolTarget, start: StartParameters) -> np.ndarray:
        """Return the joint coordinates at the start pose of the tool, shape (N,)."""
        self.check_reach(target.y_t, "start")
        return start_posture(start.posture_deg, self.robot, target)

    def check_reach(self, position: np.ndarray, where: str) -> None:
        """Refuse a position of the tool that the robot is known not to reach.

        Only the distance is checked, not the limits of the joints.
        """
        base, reach = self.robot.links[0].p_PF, self.robot.reach
        distance = float(np.linalg.norm(position - base))
        if distance > reach + _ROUNDING:
            hint = "; unit: mm reads a file in mm" if distance > _IN_MM * reach else ""
            raise InputError(
                f"{where}: tool point {np.round(position, 4).tolist()} m is unreachable, "
                f"{distance:.4g} m from the first joint at {np.round(base, 4).tolist()} m; the "
                f"robot reaches {reach:.4g} m at most{hint}"
            )

    def start_warnings(
        self, start: StartParameters, q_J: np.ndarray, target: ToolTarget
    ) -> list[str]:
        """Return warnings about the robot and its start, one sentence each."""
        found = posture_warnings(start.posture_deg, self.robot, q_J, target)
        return self.actual.warnings + found + tilt_warnings(self.robot, q_J, target)

    def state_at_rest(self, q_J: np.ndarray) -> np.ndarray:
        """Return the state of the model at rest, elastic joints deflected by the links' weight."""
        return state_at_rest(self.robot, self.coordinates, q_J)

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Apply a wrench at the tool point, world axes, shape (6,)."""
        self._apply(
            builder, [add_external_wrench(builder, self.tool, self.robot, wrench, joint_state)]
        )

    def connect_pushes(
        self,
        builder: DiagramBuilder,
        pushes: LinkPushes,
        wrench: OutputPort | None,
        joint_state: OutputPort,
    ) -> None:
        """Apply forces on links, and a wrench at the tool point if there is one.

        Args:
            builder: Builder of the diagram.
            pushes: Forces on links.
            wrench: Wrench at the tool point, world axes, shape (6,) [N, Nm].
            joint_state: Actual ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        """
        forces: list[LeafSystem] = [pushes]
        if wrench is not None:
            forces.append(add_external_wrench(builder, self.tool, self.robot, wrench, joint_state))
        self._apply(builder, forces)

    @abstractmethod
    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        """Apply all external forces.

        Args:
            builder: Builder of the diagram.
            forces: One system or more with the ports ``applied_spatial_force`` and ``tau_ext``.
        """

    def check_nominal_model(self, source: NominalModelSource, sensor_joint: str | None) -> None:
        """Refuse a nominal model that no controller of this robot could have; nothing is built."""
        nominal_model, model = nominal_arm(self.actual, source)
        if sensor_joint is not None:
            nominal_model.tool_load(model.tool_load(sensor_joint))

    def nominal_load(self, joint: str) -> ToolLoad:
        """Return the nominal load behind a sensor."""
        return self.nominal_model.tool_load(self.source_model.tool_load(joint))


@dataclass(frozen=True)
class MultibodyArm(Arm):
    """An arm that Drake's MultibodyPlant moves: (2.42) rigid, (2.65) elastic.

    Attributes:
        contact: Contact wrench on its tool, if the environment can touch it.
    """

    contact: ContactWrench | None = None

    @property
    def plant(self) -> MultibodyPlant:
        """The plant."""
        return self.model

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the actual ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        return joint_state_of(builder, self.model.get_state_output_port(), self.coordinates)

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Apply drive torques ``tau_d``, shape (N,)."""
        connect_actuation(builder, self.model, self.coordinates, torque)

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Apply the friction torques ``-tau_fM`` to the motors, shape (N,)."""
        rows = self.coordinates.motor_rows[self.robot.dimension :]
        connect_resistance(builder, self.model, rows, resistance)

    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        """Apply all external forces."""
        connect_push(builder, self.model, forces)

    def set_state(self, context: Context, state: np.ndarray) -> None:
        """Set the state ``[q, v]`` of the model in the plant."""
        self.model.SetPositionsAndVelocities(context, state)

    def hang(self, context: Context, joint: str, mass: float) -> None:
        """Add an unmodelled mass below a force sensor, at the centre of the load."""
        mount, load = self.actual.sensor_joint(joint), self.actual.tool_load(joint)
        body = mount.child_body()
        p_BC = mount.frame_on_child().GetFixedPoseInBodyFrame() @ load.p_SC
        M_B = body.CalcSpatialInertiaInBodyFrame(context)
        M_B += SpatialInertia(mass, p_BC, UnitInertia.PointMass(p_BC))
        body.SetSpatialInertiaInBodyFrame(context, M_B)

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return the mount of a force/torque sensor."""
        return SensorMount(
            self.actual.tool_load(joint),
            self.nominal_load(joint),
            self.model.get_reaction_forces_output_port(),
            reaction_index(self.model, self.actual.sensor_joint(joint)),
        )


@dataclass(frozen=True)
class CoupledArm(Arm):
    """An elastic arm whose rotors couple with the links by their spin: (2.64).

    Attributes:
        full: The plant.
    """

    full: FullElasticPlant

    @property
    def plant(self) -> FullElasticPlant:
        """The plant."""
        return self.full

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the actual ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        return self.full.GetOutputPort("joint_state")

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Apply drive torques ``tau_d``, shape (N,)."""
        builder.Connect(torque, self.full.GetInputPort("drive_torque"))

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Apply the friction torques ``-tau_fM`` to the motors, shape (N,)."""
        builder.Connect(resistance, self.full.GetInputPort("resistance"))

    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        """Apply all external forces."""
        connect_torques(builder, self.full.GetInputPort("external_torque"), forces)

    def set_state(self, context: Context, state: np.ndarray) -> None:
        """Set the state ``[q, v]`` of the model in the plant."""
        self.full.set_joint_state(context, self.coordinates.rows @ state)

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return the mount of a force/torque sensor."""
        load = self.actual.tool_load(joint)
        acceleration = self.full.GetOutputPort("link_acceleration")
        reaction = add_tool_reaction(builder, self.robot, load, acceleration, ports)
        return SensorMount(load, self.nominal_load(joint), reaction)


def add_arm(
    builder: DiagramBuilder, source: NominalModelSource, workpiece: Workpiece | None = None
) -> Arm:
    """Add the plant of a serial arm, continuous unless its tool may touch something.

    Args:
        builder: Builder of the diagram.
        source: The arm, and the source of its nominal model.
        workpiece: Workpiece that its tool may touch, if there is one.

    Raises:
        InputError: If the model cannot be read, is no chain of joints, its rotors are not known,
            or the nominal model is invalid.
    """
    plant, allowed = source.robot.plant, f"{MULTIBODY}; only a DELTA robot has another"
    require(plant == MULTIBODY, "robot.plant", plant, allowed)
    if source.robot.rotor_coupling:
        return _add_coupled_arm(builder, source, workpiece)
    if workpiece is not None:
        return _add_touching_arm(builder, source, workpiece)
    actual = read_arm(
        source.robot,
        source.folder,
        before_finalizing=source.add_payload,
        by_velocity=source.by_velocity,
    )
    builder.AddNamedSystem("plant", actual.plant)
    return MultibodyArm(actual, *nominal_arm(actual, source))


def _add_coupled_arm(
    builder: DiagramBuilder, source: NominalModelSource, workpiece: Workpiece | None
) -> CoupledArm:
    coupled, folder = source.robot.rotor_coupling, source.folder
    allowed = "empty where the robot touches a workpiece; the full model has no contact"
    require(workpiece is None, "robot.rotor_coupling", coupled, allowed)
    actual = read_arm(source.robot, folder, before_finalizing=source.add_payload)
    try:
        robot = load_parameters(folder / coupled if FilePath(coupled).suffix else coupled)
        plant = FullElasticPlant(actual.chain, mounts_from_parameters(actual.chain, robot))
    except InputError as error:
        raise InputError(f"robot.rotor_coupling: {error}") from None
    builder.AddNamedSystem("plant", plant)
    return CoupledArm(actual, *nominal_arm(actual, source), plant)


def _add_touching_arm(
    builder: DiagramBuilder, source: NominalModelSource, workpiece: Workpiece
) -> MultibodyArm:
    """Add a discrete plant; of the robot only the part that touches the workpiece has geometry."""
    allowed = "0 on a robot that turns its tool: the ball sits at the tool point"
    require(workpiece.reach == 0.0, "notch.ball.distance", workpiece.reach, allowed)
    scene_graph: list[SceneGraph] = []
    geometries: list[GeometryId] = []

    def add_workpiece(plant: MultibodyPlant) -> None:
        scene_graph.append(add_scene(builder, plant))
        geometries.extend(workpiece.add(plant, tool_frame(plant, source.robot)))

    actual = read_arm(source.robot, source.folder, workpiece.time_step, add_workpiece)
    builder.AddNamedSystem("plant", actual.plant)
    contact = connect_scene(builder, actual.plant, scene_graph[0], geometries)
    return MultibodyArm(actual, *nominal_arm(actual, source), contact)
