"""A workpiece robot: a second robot, which holds the workpiece with the path of the first one."""

import dataclasses as dc
from typing import Annotated

from pydrake.multibody.tree import SpatialInertia, UnitInertia

from diagrams.scenario.manifolds import PathParameters
from diagrams.scenario.model_error import ModelErrorParameters
from diagrams.scenario.motion import ReferenceParameters, StartParameters
from diagrams.scenario.robot import PoseParameters, RobotParameters
from diagrams.scenario.simulation import SensorFailureParameters
from pfsc_drake.checks import require
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.controller.options.follower_options import FaultParameters
from pfsc_drake.controller.options.friction_parameters import JointFrictionParameters
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.yaml.rules import Numbers, OneOf, Parameters, Range

_SMALLEST, _LARGEST, _HEAVIEST = 1e-4, 10.0, 1e3  # m, m, kg
DERIVATIVES = ("known", "planned", "differenced", "none")


@dc.dataclass
class SolidParameters(Parameters):
    """A solid that a workpiece consists of: a box, or a cylinder.

    Attributes:
        box: Edges along x, y, z [m]; empty for a cylinder.
        cylinder: Radius, and length along z [m]; empty for a box.
        pose: Pose of its centre and axes in the workpiece's frame.
        mass: Its mass, evenly spread [kg].
    """

    box: Annotated[list[float], Numbers(3, Range(_SMALLEST, _LARGEST, "m"), empty=True)] = dc.field(
        default_factory=list
    )
    cylinder: Annotated[list[float], Numbers(2, Range(_SMALLEST, _LARGEST, "m"), empty=True)] = (
        dc.field(default_factory=list)
    )
    pose: PoseParameters = dc.field(default_factory=PoseParameters)
    mass: Annotated[float, Range(0.0, _HEAVIEST, "kg")] = 1.0

    @property
    def inertia(self) -> SpatialInertia:
        """Its inertia about the origin of the workpiece's frame, axes of that frame."""
        if self.box:
            unit = UnitInertia.SolidBox(*self.box)
        else:
            unit = UnitInertia.SolidCylinder(*self.cylinder, [0.0, 0.0, 1.0])
        X_CS = self.pose.transform()
        central = SpatialInertia(self.mass, [0.0, 0.0, 0.0], unit)
        return central.ReExpress(X_CS.rotation()).Shift(-X_CS.translation())


@dc.dataclass
class HolderWorkpiece:
    """The workpiece that a robot holds.

    Attributes:
        pose: Pose of its frame in the ``tool_frame`` of the robot that holds it.
        solids: Solids that it consists of, one or more with mass.
    """

    pose: PoseParameters = dc.field(default_factory=PoseParameters)
    solids: list[SolidParameters] = dc.field(default_factory=list)

    @property
    def inertia(self) -> SpatialInertia:
        """Its inertia about the origin of its frame, axes of the frame."""
        total = SpatialInertia.Zero()
        for solid in self.solids:
            total += solid.inertia
        return total

    def check(self) -> None:
        """Refuse invalid solids.

        Raises:
            InputError: If a solid is neither a box nor a cylinder, or there is no mass.
        """
        for i, solid in enumerate(self.solids):
            one = bool(solid.box) != bool(solid.cylinder)
            allowed = "given where there is no box, and only there"
            require(one, f"workpiece.solids[{i}].cylinder", solid.cylinder, allowed)
        mass = sum(solid.mass for solid in self.solids)
        found = f"{len(self.solids)} given, {mass:g} kg"
        require(mass > 0.0, "workpiece.solids", found, "one or more, with mass")


@dc.dataclass
class HolderParameters(Parameters):
    """A robot that holds the workpiece and moves it along a path of its own.

    The scenario's ``path`` or ``surface`` is then fixed to the workpiece, in the workpiece's frame,
    and the scenario's robot follows it while the workpiece moves.

    Attributes:
        robot: The robot; its ``tool_frame`` holds the workpiece.
        workpiece: The workpiece.
        path: Path of the workpiece's frame in the world.
        controller: Its controller, with the sampling time of the other one.
        model_error: Errors of its nominal model: of the robot and, as its tool, of the workpiece.
        placement_error: Pose of its base in the controllers' model relative to the actual one, axes
            of the base: an error of calibration that no controller measures.
        reference: Motion along its path.
        start: Start on its path.
        friction: Friction of its joints.
        encoders: Encoders of its joints.
        faults: Fault detection and stops. A fault of one robot stops both.
        sensor_failure: Failure of one of its sensors during the run.
        derivatives: Derivatives of the workpiece's motion in the other robot's controller:
            ``known``: all that its law needs; for comparison ``planned``, those of the reference;
            ``differenced``, from the poses of the last ticks; or ``none``, the pose alone.
        highest: Highest derivative that is known, planned or differenced, 0 to 4.
    """

    robot: RobotParameters = dc.field(default_factory=RobotParameters)
    workpiece: HolderWorkpiece = dc.field(default_factory=HolderWorkpiece)
    path: PathParameters = dc.field(default_factory=PathParameters)
    controller: ControllerParameters = dc.field(default_factory=ControllerParameters)
    model_error: ModelErrorParameters = dc.field(default_factory=ModelErrorParameters)
    placement_error: PoseParameters = dc.field(default_factory=PoseParameters)
    reference: ReferenceParameters = dc.field(default_factory=ReferenceParameters)
    start: StartParameters = dc.field(default_factory=StartParameters)
    friction: JointFrictionParameters = dc.field(default_factory=JointFrictionParameters)
    encoders: EncoderOptions = dc.field(default_factory=EncoderOptions)
    faults: FaultParameters = dc.field(default_factory=FaultParameters)
    sensor_failure: SensorFailureParameters = dc.field(default_factory=SensorFailureParameters)
    derivatives: Annotated[str, OneOf(DERIVATIVES)] = "known"
    highest: Annotated[int, Range(0, 4)] = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        manifold = self.controller.manifold
        require(manifold == "path", "controller.manifold", manifold, "path, for a workpiece robot")
        law = self.controller.law
        allowed = "a law of torques, for a workpiece robot"
        require(self.controller.law_record.commands_torque, "controller.law", law, allowed)
        delay = self.controller.delay
        require(delay is None, "controller.delay", delay, "null, for a workpiece robot")
