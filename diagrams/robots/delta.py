"""The DELTA robot in a diagram, with any plant."""

import math
from abc import abstractmethod
from dataclasses import asdict, dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, RigidBody, SpatialInertia, WeldJoint
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain

from diagrams.robots.model import is_delta, load_delta_robot
from diagrams.robots.nominal_model import NominalModel, NominalModelSource, naming_model_error
from diagrams.robots.part import Drives, Ports, RobotPart, SensorMount
from diagrams.robots.plant_wiring import (
    add_external_wrench,
    add_scene,
    add_tool_reaction,
    connect_actuation,
    connect_push,
    connect_resistance,
    connect_scene,
    joint_state_of,
)
from diagrams.robots.workpiece import Workpiece, upwards
from diagrams.scenario import (
    RobotParameters,
    StartParameters,
)
from diagrams.scenario.robot import ANALYTIC, MULTIBODY
from pfsc_drake.checks import require
from pfsc_drake.robot.delta.delta_parameters import SHIPPED_ROBOTS
from pfsc_drake.robot.delta.delta_robot import DeltaRobot, nominal_delta
from pfsc_drake.robot.delta.multibody import (
    DeltaModel,
    add_delta_plant,
    set_delta_positions,
    slide_state_rows,
)
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.delta_plant import DeltaPlant
from pfsc_drake.systems.plants.reactions import ContactWrench, reaction_index, tool_load_from_plant

TOOL, SENSOR_JOINT, TOOL_POINT = "tool", "weld_tool", "tool_point"
_ROUNDING = 1e-9
_LOAD_RADIUS = 0.05  # m, of a load without a shape, which does not turn


@dataclass(frozen=True)
class DeltaPart(RobotPart):
    """A DELTA robot in a diagram; drives and slides coincide, ``joint_state = [q, v, q, v]``.

    Everything is in the axes of the inertial frame (z_0 down).

    Attributes:
        robot: The simulated robot.
        nominal_model: Nominal model of the robot, by which it is controlled.
    """

    robot: DeltaRobot
    nominal_model: NominalModel

    def check_nominal_model(self, source: NominalModelSource, sensor_joint: str | None) -> None:
        """Refuse a nominal model that no controller of this robot could have.

        Nothing is built; every load of the sensor is accepted.
        """
        del sensor_joint
        _nominal_model(self.robot, source)

    @property
    def coordinates(self) -> PlantCoordinates:  # type: ignore[override]
        """Indices of slides and drives, which coincide."""
        names = tuple(self.robot.names)
        size = 2 * len(names)
        return PlantCoordinates(size, np.eye(size), np.eye(size), names, tuple(range(len(names))))

    @property
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration in the world [m/s^2], shape (3,)."""
        return self.robot.gravity

    def _drives(self, step: float | None) -> Drives:
        parameters = self.robot.parameters
        friction, mass = parameters.friction, parameters.masses.effective_slide
        inertia = np.full(self.robot.dimension, mass)
        return Drives(inertia, (friction.coulomb, friction.viscous), step)

    def nominal_load(self, joint: str) -> ToolLoad:
        """Return the nominal load behind a sensor."""
        return self.nominal_model.tool_load(self._load(joint))

    @abstractmethod
    def _load(self, joint: str) -> ToolLoad:
        """Return the load behind a sensor."""

    def posture(self, target: ToolTarget, start: StartParameters) -> np.ndarray:
        """Return the joint coordinates at the start pose of the tool, shape (N,)."""
        return self.robot.joint_coordinates(target.y_t, "start")

    def state_at_rest(self, q_J: np.ndarray) -> np.ndarray:
        """Return the state of the model at rest."""
        return np.concatenate([q_J, np.zeros(self.robot.dimension)])

    def check_reach(self, position: np.ndarray, where: str) -> None:
        """Refuse a position of the tool that the robot is known not to reach."""
        self.robot.joint_coordinates(position, where)


@dataclass(frozen=True)
class AnalyticDelta(DeltaPart):
    """A DELTA robot without contact, (2.72), in continuous time.

    Attributes:
        analytic: The plant.
    """

    analytic: DeltaPlant

    @property
    def plant(self) -> DeltaPlant:
        """The plant."""
        return self.analytic

    @property
    def drives(self) -> Drives:
        """Drives that friction acts on."""
        return self._drives(None)

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the actual ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        return joint_state_of(builder, self.analytic.GetOutputPort("state"), self.coordinates)

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Apply drive torques ``tau_d``, shape (N,)."""
        builder.Connect(torque, self.analytic.GetInputPort("actuation"))

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Apply the friction torques ``-tau_fM`` to the motors, shape (N,)."""
        builder.Connect(resistance, self.analytic.GetInputPort("resistance"))

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Apply a wrench at the end-effector's centre E; its torque has no effect."""
        force = builder.AddNamedSystem("external_force", MatrixGain(np.eye(3, 6)))
        builder.Connect(wrench, force.get_input_port())
        builder.Connect(force.get_output_port(), self.analytic.GetInputPort("external_force"))

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return the sensor between end-effector and load, which is a point mass in E."""
        load, acceleration = self._load(joint), self.analytic.GetOutputPort("acceleration")
        reaction = add_tool_reaction(builder, self.robot, load, acceleration, ports)
        return SensorMount(load, self.nominal_load(joint), reaction)

    def _load(self, joint: str) -> ToolLoad:
        """Return the load behind a sensor; a point mass in E."""
        _require_joint(joint)
        mass, gravity = self.robot.parameters.masses.load, self.robot.gravity
        return ToolLoad(mass, np.zeros(3), np.zeros((3, 3)), np.eye(3), np.zeros(3), gravity)

    def set_state(self, context: Context, state: np.ndarray) -> None:
        """Set the state ``[q, v]`` of the model in the plant."""
        self.analytic.set_state(context, *np.split(state, 2))


@dataclass(frozen=True)
class ConstrainedDelta(DeltaPart):
    """A DELTA robot of bodies with constraints, (2.71), which may touch a workpiece.

    The plant samples its inputs and its reaction forces: drive forces act, and contact forces
    are measured, one of its time steps later.

    Attributes:
        multibody: The plant, discrete.
        model: The robot in it.
        tool: Frame in E, behind the sensor.
        contact: Wrench of the workpiece on the tool, if there is one.
    """

    multibody: MultibodyPlant
    model: DeltaModel
    tool: Frame
    contact: ContactWrench | None = None

    @property
    def plant(self) -> MultibodyPlant:
        """The plant."""
        return self.multibody

    @property
    def drives(self) -> Drives:
        """Drives that friction acts on."""
        return self._drives(self.multibody.time_step())

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the actual ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        rows = slide_state_rows(self.multibody, self.model)
        slides = builder.AddNamedSystem("slides", MatrixGain(rows))
        builder.Connect(self.multibody.get_state_output_port(), slides.get_input_port())
        return joint_state_of(builder, slides.get_output_port(), self.coordinates)

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Apply drive torques ``tau_d``, shape (N,)."""
        connect_actuation(builder, self.multibody, self.coordinates, torque)

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Apply the friction torques ``-tau_fM`` to the motors, shape (N,)."""
        rows = slide_state_rows(self.multibody, self.model)[self.robot.dimension :]
        connect_resistance(builder, self.multibody, rows, resistance)

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Apply a wrench at the tool point, world axes, shape (6,)."""
        push = add_external_wrench(builder, self.tool, self.robot, wrench, joint_state)
        connect_push(builder, self.multibody, [push])

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return the mount of a force/torque sensor."""
        load, plant = self._load(joint), self.multibody
        return SensorMount(
            load,
            self.nominal_load(joint),
            plant.get_reaction_forces_output_port(),
            reaction_index(plant, plant.GetJointByName(SENSOR_JOINT)),
        )

    def _load(self, joint: str) -> ToolLoad:
        """Return the load behind a sensor."""
        _require_joint(joint)
        mount = self.multibody.GetJointByName(SENSOR_JOINT)
        return tool_load_from_plant(self.multibody, mount, self.tool)

    def set_state(self, context: Context, state: np.ndarray) -> None:
        """Set the state ``[q, v]`` of the model in the plant."""
        set_delta_positions(self.multibody, context, self.model, *np.split(state, 2))


def _require_joint(joint: str) -> None:
    """Refuse any joint for the sensor but the one between end-effector and load."""
    require(joint in ("", SENSOR_JOINT), "sensor.joint", joint, f"{SENSOR_JOINT} on a DELTA robot")


def add_delta(
    builder: DiagramBuilder, source: NominalModelSource, step: float, workpiece: Workpiece | None
) -> DeltaPart:
    """Add a DELTA robot.

    Args:
        builder: Builder of the diagram.
        source: The robot, and the source of its nominal model.
        step: Longest time step without contact [s].
        workpiece: Workpiece that its tool may touch, if there is one.

    Raises:
        InputError: If it cannot be read, or an option does not suit a DELTA robot.
    """
    robot = load_delta_robot(source.robot.model, source.folder)
    for key, none in asdict(RobotParameters()).items():
        value = asdict(source.robot)[key]
        is_set = key not in ("model", "tool_frame", "plant") and value != none
        require(not is_set, f"robot.{key}", value, "none for a DELTA robot")
    nominal_model = _nominal_model(robot, source)
    if source.robot.plant == ANALYTIC:
        allowed = f"{MULTIBODY} where the robot touches a workpiece"
        require(workpiece is None, "robot.plant", ANALYTIC, allowed)
        return AnalyticDelta(
            robot, nominal_model, builder.AddNamedSystem("plant", DeltaPlant(robot))
        )
    step = workpiece.time_step if workpiece else step
    plant = builder.AddNamedSystem("plant", MultibodyPlant(step))
    scene_graph = add_scene(builder, plant) if workpiece else None
    model = add_delta_plant(plant, robot.parameters, with_load=False)
    reach, radius = (workpiece.reach, workpiece.radius) if workpiece else (0.0, _LOAD_RADIUS)
    tool = _weld_gripper(plant, model.end_effector, robot, reach, radius)
    geometries = workpiece.add(plant, tool) if workpiece else []
    plant.Finalize()
    contact = connect_scene(builder, plant, scene_graph, geometries) if scene_graph else None
    return ConstrainedDelta(robot, nominal_model, plant, model, tool, contact)


def free_step(period: float, longest: float) -> float:
    """Return the time step without contact: the largest whole fraction of the period [s].

    Args:
        period: Sampling time [s].
        longest: Upper limit of the step [s].
    """
    return period / math.ceil(period / longest - _ROUNDING)


def _nominal_model(robot: DeltaRobot, source: NominalModelSource) -> NominalModel:
    """Return the nominal model of a robot."""
    start, model = robot, source.model
    if model:
        allowed = f"parameters of a DELTA robot: a YAML file, {', '.join(SHIPPED_ROBOTS)}"
        require(is_delta(model), "controller.model", model, allowed)
        start = load_delta_robot(model, source.folder)
    error, nominal = source.error.error(robot.gather("is_revolute")), start
    if source.error.is_given:
        with naming_model_error():
            nominal = nominal_delta(start, error)
    same = nominal.parameters.geometry == robot.parameters.geometry
    return NominalModel(nominal, error, has_actual_kinematics=same)


def _weld_gripper(
    plant: MultibodyPlant, end_effector: RigidBody, robot: DeltaRobot, reach: float, radius: float
) -> Frame:
    """Weld the load to the end-effector, with a joint for the sensor in between.

    The load is a gripper that reaches down to the part that touches the workpiece. The returned
    frame is in E; the end-effector only translates, so that the inertia about the centre of mass
    has no effect.

    Args:
        plant: The plant.
        end_effector: Its end-effector.
        robot: The robot.
        reach: Reach of the gripper [m]; without one the load is a ball about E.
        radius: Size of the load [m].
    """
    middle = -0.5 * reach * upwards(robot.gravity, "robot") if reach else np.zeros(3)
    mass = robot.parameters.masses.load
    inertia = SpatialInertia.Zero()
    if mass > 0.0:
        inertia = SpatialInertia.SolidSphereWithMass(mass, radius).Shift(-middle)
    tool = plant.AddRigidBody(TOOL, end_effector.model_instance(), inertia)
    plant.AddJoint(
        WeldJoint(SENSOR_JOINT, end_effector.body_frame(), tool.body_frame(), RigidTransform())
    )
    return plant.AddFrame(FixedOffsetFrame(TOOL_POINT, tool.body_frame(), RigidTransform()))
