"""The DELTA robot in a diagram, whichever model moves it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import (
    ContactModel,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import MatrixGain

from diagrams.robots.drives import friction_bristles
from diagrams.robots.plant_wiring import (
    add_external_wrench,
    connect_actuation,
    connect_push,
    connect_resistance,
)
from diagrams.scenario.checks import require_whole_fraction
from diagrams.scenario.delta import DeltaFollowingScenario
from diagrams.scenario.notch import NotchParameters
from diagrams.surroundings.notch import TOOL_POINT, add_ball, add_notch
from pfsc_drake.geometry import Path
from pfsc_drake.physics.friction import BristleFriction, bristles_for_step
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.multibody import (
    DeltaModel,
    add_delta_plant,
    set_delta_positions,
    slide_state_rows,
)
from pfsc_drake.systems.physics.contact_wrench import ContactWrench
from pfsc_drake.systems.physics.delta_plant import DeltaPlant
from pfsc_drake.systems.physics.joint_friction import JointFriction

# omega h of stuck bristles whose force is read once per step, see bristles_for_step
_BRISTLES_PER_STEP = 0.5


class DeltaBody(ABC):
    """A DELTA robot in a diagram: where its signals come from and where they go.

    Attributes:
        chain: The robot as the laws know it.
    """

    chain: DeltaRobot

    @property
    @abstractmethod
    def plant(self) -> LeafSystem:
        """The system in the diagram that moves."""

    @abstractmethod
    def slide_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the true ``[q, v]`` of the slides, shape (6,)."""

    def _friction(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coulomb and viscous friction of the drives, and the slides' masses, each (3,)."""
        parameters = self.chain.parameters
        friction, mass = parameters.friction, parameters.masses.effective_slide
        return friction.coulomb, friction.viscous, np.full(self.chain.dimension, mass)

    @abstractmethod
    def bristles(self, scenario: DeltaFollowingScenario) -> BristleFriction:
        """Return the drives' friction, with bristles that suit how the plant is integrated.

        Raises:
            InputError: If there are none.
        """

    @abstractmethod
    def connect_drives(
        self, builder: DiagramBuilder, force: OutputPort, friction: JointFriction | None
    ) -> None:
        """Let drive forces act, shape (3,), less friction if there is any."""

    @abstractmethod
    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Let a wrench act at the end-effector's centre E, shape (6,); its torque has no effect."""

    @abstractmethod
    def place(self, context: Context, state: np.ndarray) -> None:
        """Put the plant into a state ``[q, v]`` of the slides, shape (6,)."""


@dataclass(frozen=True)
class FreeDelta(DeltaBody):
    """A DELTA robot that touches nothing: (2.72).

    Attributes:
        analytic: The plant.
    """

    chain: DeltaRobot
    analytic: DeltaPlant

    @property
    def plant(self) -> DeltaPlant:
        """See :class:`DeltaBody`."""
        return self.analytic

    def slide_state(self, builder: DiagramBuilder) -> OutputPort:
        """See :class:`DeltaBody`."""
        return self.analytic.GetOutputPort("state")

    def bristles(self, scenario: DeltaFollowingScenario) -> BristleFriction:
        """See :class:`DeltaBody`."""
        return friction_bristles(scenario, *self._friction(), "drive_friction")

    def connect_drives(
        self, builder: DiagramBuilder, force: OutputPort, friction: JointFriction | None
    ) -> None:
        """See :class:`DeltaBody`."""
        if friction is not None:
            builder.Connect(force, friction.GetInputPort("drive_torque"))
            force = friction.GetOutputPort("net_torque")
        builder.Connect(force, self.analytic.GetInputPort("actuation"))

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """See :class:`DeltaBody`."""
        force = builder.AddNamedSystem("external_force", MatrixGain(np.eye(3, 6)))
        builder.Connect(wrench, force.get_input_port())
        builder.Connect(force.get_output_port(), self.analytic.GetInputPort("external_force"))

    def place(self, context: Context, state: np.ndarray) -> None:
        """See :class:`DeltaBody`."""
        self.analytic.set_state(context, *np.split(state, 2))


@dataclass(frozen=True)
class TouchingDelta(DeltaBody):
    """A DELTA robot whose ball may touch a workpiece: (2.71), bodies tied by constraints.

    The plant samples its inputs and its reaction forces: drive forces act, and contact forces
    are felt, one of its time steps later.

    Attributes:
        multibody: The plant, discrete.
        model: The robot in it.
        tool: Frame in E, behind the sensor.
        contact: Wrench of the workpiece on the ball.
    """

    chain: DeltaRobot
    multibody: MultibodyPlant
    model: DeltaModel
    tool: Frame
    contact: ContactWrench

    @property
    def plant(self) -> MultibodyPlant:
        """See :class:`DeltaBody`."""
        return self.multibody

    def slide_state(self, builder: DiagramBuilder) -> OutputPort:
        """See :class:`DeltaBody`."""
        slides = builder.AddNamedSystem(
            "slides", MatrixGain(slide_state_rows(self.multibody, self.model))
        )
        builder.Connect(self.multibody.get_state_output_port(), slides.get_input_port())
        return slides.get_output_port()

    def bristles(self, scenario: DeltaFollowingScenario) -> BristleFriction:
        """See :class:`DeltaBody`."""
        step = self.multibody.time_step()
        return bristles_for_step(*self._friction(), step, frequency=_BRISTLES_PER_STEP)

    def connect_drives(
        self, builder: DiagramBuilder, force: OutputPort, friction: JointFriction | None
    ) -> None:
        """See :class:`DeltaBody`."""
        actuators = np.array([int(actuator) for actuator in self.model.actuators])
        connect_actuation(builder, self.multibody, actuators, force)
        if friction is not None:
            rows = slide_state_rows(self.multibody, self.model)[self.chain.dimension :]
            resistance = friction.GetOutputPort("resistance")
            connect_resistance(builder, self.multibody, rows, resistance)

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """See :class:`DeltaBody`."""
        push = add_external_wrench(builder, self.tool, self.chain, wrench, joint_state)
        connect_push(builder, self.multibody, push)

    def place(self, context: Context, state: np.ndarray) -> None:
        """See :class:`DeltaBody`."""
        set_delta_positions(self.multibody, context, self.model, *np.split(state, 2))


def add_free_delta(builder: DiagramBuilder, robot: DeltaRobot) -> FreeDelta:
    """Add a robot that touches nothing.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
    """
    return FreeDelta(robot, builder.AddNamedSystem("plant", DeltaPlant(robot)))


def add_touching_delta(
    builder: DiagramBuilder, robot: DeltaRobot, path: Path, notch: NotchParameters, period: float
) -> TouchingDelta:
    """Add a robot with a ball, and a workpiece with a notch.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        path: The path that was taught.
        notch: Ball and workpiece.
        period: Sampling time of the controller [s].

    Raises:
        InputError: If the plant's time step does not suit the controller's.
    """
    require_whole_fraction("notch.time_step", notch.time_step, period)
    plant = builder.AddNamedSystem("plant", MultibodyPlant(notch.time_step))
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.set_contact_model(ContactModel.kHydroelastic)
    model = add_delta_plant(plant, robot.parameters, with_load=False)
    ball = add_ball(plant, model.end_effector, robot.parameters.masses.load, notch.ball)
    add_notch(plant, path, notch)
    plant.Finalize()
    builder.Connect(
        plant.get_geometry_pose_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    contact = builder.AddNamedSystem("contact_wrench", ContactWrench([ball]))
    builder.Connect(
        plant.get_contact_results_output_port(), contact.GetInputPort("contact_results")
    )
    return TouchingDelta(robot, plant, model, plant.GetFrameByName(TOOL_POINT), contact)
