"""A serial arm in a diagram, whichever model moves it."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.geometry import GeometryId, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from diagrams.robots.arm_model import ArmModel, believe_arm, read_arm
from diagrams.robots.belief import Belief, BeliefSource
from diagrams.robots.model import tool_frame
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
# times the reach: as far away as a number in mm, read in m
_IN_MM = 50.0


@dataclass(frozen=True)
class Arm(RobotPart):
    """A serial arm in a diagram.

    Attributes:
        true: The arm as it is.
        belief: The arm as whatever controls it believes it to be.
        believed: The model that the belief starts from, ``true`` unless it is another one.
    """

    true: ArmModel
    belief: Belief
    believed: ArmModel

    @property
    def model(self) -> MultibodyPlant:
        """The arm as Drake knows it, finalized."""
        return self.true.plant

    @property
    def robot(self) -> SerialChain:  # type: ignore[override]
        """The arm as it is, N joints."""
        return self.true.chain

    @property
    def coordinates(self) -> PlantCoordinates:  # type: ignore[override]
        """Where its coordinates stand in the state of ``model``."""
        return self.true.coordinates

    @property
    def tool(self) -> Frame:
        """Frame whose origin follows the manifold."""
        return self.true.tool

    @property
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration in the world [m/s^2], shape (3,)."""
        return self.robot.gravity

    @property
    def drives(self) -> Drives:
        """What friction acts on."""
        return Drives(self.robot.D_M, step=self.model.time_step() or None)

    def posture(self, target: ToolTarget, start: StartParameters) -> np.ndarray:
        """Return joint coordinates that put the tool where it starts, shape (N,)."""
        self.check_reach(target.y_t, "start")
        return start_posture(start.posture_deg, self.robot, target)

    def check_reach(self, position: np.ndarray, where: str) -> None:
        """Refuse a position on the way that the robot is known not to reach.

        What is out of reach for other reasons has to be tried.
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
        """Return what there is to say about the robot and its start, one sentence each."""
        found = posture_warnings(start.posture_deg, self.robot, q_J, target)
        return self.true.warnings + found + tilt_warnings(self.robot, q_J, target)

    def state_at_rest(self, q_J: np.ndarray) -> np.ndarray:
        """Return the state of the model at rest, elastic joints carrying the links' weight."""
        return state_at_rest(self.robot, self.coordinates, q_J)

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Let a wrench act at the tool point, world axes, shape (6,)."""
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
        """Let forces act on links, and a wrench at the tool point if there is one.

        Args:
            builder: Builder of the diagram.
            pushes: What acts on links.
            wrench: At the tool point, world axes, shape (6,) [N, Nm].
            joint_state: The true ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        """
        forces: list[LeafSystem] = [pushes]
        if wrench is not None:
            forces.append(add_external_wrench(builder, self.tool, self.robot, wrench, joint_state))
        self._apply(builder, forces)

    @abstractmethod
    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        """Let everything from outside act.

        Args:
            builder: Builder of the diagram.
            forces: One system or more with the ports ``applied_spatial_force`` and ``tau_ext``.
        """

    def check_belief(self, source: BeliefSource, sensor_joint: str | None) -> None:
        """Refuse what no controller could believe of this robot; nothing is built."""
        belief, model = believe_arm(self.true, source)
        if sensor_joint is not None:
            belief.tool_load(model.tool_load(sensor_joint))

    def believed_load(self, joint: str) -> ToolLoad:
        """Return what is believed to be behind a sensor."""
        return self.belief.tool_load(self.believed.tool_load(joint))


@dataclass(frozen=True)
class MultibodyArm(Arm):
    """An arm that Drake's MultibodyPlant moves: (2.42) rigid, (2.65) elastic.

    Attributes:
        contact: What the environment does to its tool, if it can touch them.
    """

    contact: ContactWrench | None = None

    @property
    def plant(self) -> MultibodyPlant:
        """The system in the diagram that moves."""
        return self.model

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the true ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        return joint_state_of(builder, self.model.get_state_output_port(), self.coordinates)

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Let drive torques ``tau_d`` act, shape (N,)."""
        connect_actuation(builder, self.model, self.coordinates, torque)

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Let the friction torques ``-tau_fM`` act on the motors, shape (N,)."""
        rows = self.coordinates.motor_rows[self.robot.dimension :]
        connect_resistance(builder, self.model, rows, resistance)

    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        """Let everything from outside act."""
        connect_push(builder, self.model, forces)

    def place(self, context: Context, state: np.ndarray) -> None:
        """Put the plant into a state of its model, ``[q, v]``."""
        self.model.SetPositionsAndVelocities(context, state)

    def hang(self, context: Context, joint: str, mass: float) -> None:
        """Let more hang below a force sensor than is believed, where the load's centre is."""
        mount, load = self.true.sensor_joint(joint), self.true.tool_load(joint)
        body = mount.child_body()
        p_BC = mount.frame_on_child().GetFixedPoseInBodyFrame() @ load.p_SC
        M_B = body.CalcSpatialInertiaInBodyFrame(context)
        M_B += SpatialInertia(mass, p_BC, UnitInertia.PointMass(p_BC))
        body.SetSpatialInertiaInBodyFrame(context, M_B)

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return where a force/torque sensor sits."""
        return SensorMount(
            self.true.tool_load(joint),
            self.believed_load(joint),
            self.model.get_reaction_forces_output_port(),
            reaction_index(self.model, self.true.sensor_joint(joint)),
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
        """The system in the diagram that moves."""
        return self.full

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the true ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        return self.full.GetOutputPort("joint_state")

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Let drive torques ``tau_d`` act, shape (N,)."""
        builder.Connect(torque, self.full.GetInputPort("drive_torque"))

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Let the friction torques ``-tau_fM`` act on the motors, shape (N,)."""
        builder.Connect(resistance, self.full.GetInputPort("resistance"))

    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        """Let everything from outside act."""
        connect_torques(builder, self.full.GetInputPort("external_torque"), forces)

    def place(self, context: Context, state: np.ndarray) -> None:
        """Put the plant into a state of its model, ``[q, v]``."""
        self.full.set_joint_state(context, self.coordinates.rows @ state)

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return where a force/torque sensor sits."""
        load = self.true.tool_load(joint)
        acceleration = self.full.GetOutputPort("link_acceleration")
        reaction = add_tool_reaction(builder, self.robot, load, acceleration, ports)
        return SensorMount(load, self.believed_load(joint), reaction)


def add_arm(
    builder: DiagramBuilder, source: BeliefSource, workpiece: Workpiece | None = None
) -> Arm:
    """Add the plant of a serial arm, continuous unless its tool may touch something.

    Args:
        builder: Builder of the diagram.
        source: Which arm, and where what is believed of it comes from.
        workpiece: What its tool may touch, if anything.

    Raises:
        InputError: If the model cannot be read, is no chain of joints, its rotors are not known,
            or what is to be believed of it makes no arm.
    """
    plant, allowed = source.robot.plant, f"{MULTIBODY}; only a DELTA robot has another"
    require(plant == MULTIBODY, "robot.plant", plant, allowed)
    if source.robot.rotor_coupling:
        return _add_coupled_arm(builder, source, workpiece)
    if workpiece is not None:
        return _add_touching_arm(builder, source, workpiece)
    true = read_arm(
        source.robot,
        source.folder,
        before_finalizing=source.carried,
        by_velocity=source.by_velocity,
    )
    builder.AddNamedSystem("plant", true.plant)
    return MultibodyArm(true, *believe_arm(true, source))


def _add_coupled_arm(
    builder: DiagramBuilder, source: BeliefSource, workpiece: Workpiece | None
) -> CoupledArm:
    coupled, folder = source.robot.rotor_coupling, source.folder
    allowed = "empty where the robot touches a workpiece; the full model has no contact"
    require(workpiece is None, "robot.rotor_coupling", coupled, allowed)
    true = read_arm(source.robot, folder, before_finalizing=source.carried)
    try:
        robot = load_parameters(folder / coupled if FilePath(coupled).suffix else coupled)
        plant = FullElasticPlant(true.chain, mounts_from_parameters(true.chain, robot))
    except InputError as error:
        raise InputError(f"robot.rotor_coupling: {error}") from None
    builder.AddNamedSystem("plant", plant)
    return CoupledArm(true, *believe_arm(true, source), plant)


def _add_touching_arm(
    builder: DiagramBuilder, source: BeliefSource, workpiece: Workpiece
) -> MultibodyArm:
    """Add a discrete plant; of the robot only what touches the workpiece has geometry in it."""
    allowed = "0 on a robot that turns its tool: the ball sits at the tool point"
    require(workpiece.reach == 0.0, "notch.ball.distance", workpiece.reach, allowed)
    scene_graph: list[SceneGraph] = []
    geometries: list[GeometryId] = []

    def add_workpiece(plant: MultibodyPlant) -> None:
        scene_graph.append(add_scene(builder, plant))
        geometries.extend(workpiece.add(plant, tool_frame(plant, source.robot)))

    true = read_arm(source.robot, source.folder, workpiece.time_step, add_workpiece)
    builder.AddNamedSystem("plant", true.plant)
    contact = connect_scene(builder, true.plant, scene_graph[0], geometries)
    return MultibodyArm(true, *believe_arm(true, source), contact)
