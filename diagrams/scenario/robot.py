"""The robot of a scenario, with its drives and its force sensor."""

import dataclasses as dc
from pathlib import Path
from typing import Annotated

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from pfsc_drake.checks import LARGEST_ANGLE, require, require_whole_ticks
from pfsc_drake.control.compliance.measured_wrench import STILL_TIME
from pfsc_drake.control.compliance.tool_compensation import ToolCompensationParameters
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.physics.force_torque_sensor import ForceTorqueParameters
from pfsc_drake.robot.models.elastic_joints import ElasticJoints
from pfsc_drake.robot.models.reading import ModelOptions
from pfsc_drake.yaml.fields import FILE, NAME_OR_FILE, ONE_FOR_ALL, ONE_OR_MANY, equal
from pfsc_drake.yaml.rules import (
    Finite,
    NotNegative,
    NotNegatives,
    Numbers,
    OneOf,
    Parameters,
    Positive,
    Range,
)

# plants of a DELTA robot
MULTIBODY, ANALYTIC = "multibody", "analytic"
_FARTHEST = 1e6  # m
_STRONGEST = 1e6  # m/s^2


@dc.dataclass
class PoseParameters(Parameters):
    """A pose in the world.

    Attributes:
        position: Origin [m].
        zyx_deg: Angles about z, then the new y, then the new x [deg],
            ``R = Rz(a) Ry(b) Rx(c)``. Upside down is ``[0, 0, 180]``.
    """

    position: Annotated[list[float], Numbers(3, Range(-_FARTHEST, _FARTHEST, "m"))] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    zyx_deg: Annotated[list[float], Numbers(3, Range(-LARGEST_ANGLE, LARGEST_ANGLE, "deg"))] = (
        dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    )

    def transform(self) -> RigidTransform:
        """Return the pose."""
        rotation = RotationMatrix(zyx_to_matrix(np.deg2rad(self.zyx_deg)))
        return RigidTransform(rotation, self.position)


@dc.dataclass
class ElasticParameters:
    """Elastic joints of a rigid model: one number for all joints, or a list, base first.

    Attributes:
        stiffness: ``K_s`` [Nm/rad or N/m]; ``.inf`` for joints that stay rigid.
        damping: ``K_d`` [Nm s/rad or N s/m]; none by default.
        rotor_inertia: Rotor inertia of the drives, at the motor side [kg m^2], for rigid joints
            too; by default the model's.
        gear_ratio: Motor revolutions per joint revolution; by default the model's.
    """

    stiffness: list[float] = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    damping: list[float] = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    rotor_inertia: list[float] = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    gear_ratio: list[float] = dc.field(default_factory=list, metadata=ONE_OR_MANY)

    def __post_init__(self) -> None:
        self.joints()

    def joints(self) -> ElasticJoints:
        """Return the joints as arrays."""
        return ElasticJoints(
            *(np.array(getattr(self, f.name), dtype=float) for f in dc.fields(self))
        )


@dc.dataclass
class RobotParameters(Parameters):
    """The robot.

    Attributes:
        model: Name of a shipped model, a ``package://`` URI, or an SDF, URDF or MJCF file.
            Joints that the model does not drive (a URDF without ``<transmission>``) are driven
            up to their effort limit.
        tool_frame: Frame of the model whose origin follows the path.
        base: Frame of the model that is welded to the world; by default the root link, if the
            model leaves it floating.
        base_pose: Pose of that frame in the world.
        gravity: Gravitational acceleration [m/s^2].
        fixed_joints: Joints that do not move, with their positions [rad or m].
        packages: Folders of packages that the model refers to (``package://name/``). Packages
            above the model's folder and in ROS_PACKAGE_PATH are found without this key.
        elastic: Elastic joints and rotors in a model without.
        joint_damping: ``K_d`` of its elastic joints, base first, or one number for all
            [Nm s/rad or N s/m]; empty for the model's.
        rotor_coupling: Name of a shipped robot, or YAML file with robot parameters, with the
            mounting of the drives' rotors. The robot then obeys the full elastic model
            (2.64), with the inertia coupling of spinning rotors and moving links that the
            laws neglect; empty for the simplified model (2.65).
        plant: Plant of a DELTA robot: ``multibody`` for bodies coupled by rods, (2.71), discrete,
            with steps of at most ``simulation.max_step`` without contact; ``analytic`` for (2.72)
            in continuous time, without contact, where only the integration has an error.
    """

    model: str = dc.field(default="comau_racer_1_4", metadata=NAME_OR_FILE)
    tool_frame: str = "tool_point"
    base: str = ""
    base_pose: PoseParameters = dc.field(default_factory=PoseParameters)
    gravity: Annotated[list[float], Numbers(3, Range(-_STRONGEST, _STRONGEST, "m/s^2"))] = dc.field(
        default_factory=lambda: [0.0, 0.0, -9.81]
    )
    fixed_joints: dict[str, Finite] = dc.field(default_factory=dict)
    packages: dict[str, str] = dc.field(default_factory=dict, metadata=FILE)
    elastic: ElasticParameters = dc.field(default_factory=ElasticParameters)
    joint_damping: NotNegatives = dc.field(default_factory=list, metadata=ONE_FOR_ALL)
    rotor_coupling: str = dc.field(default="", metadata=NAME_OR_FILE)
    plant: Annotated[str, OneOf((MULTIBODY, ANALYTIC))] = MULTIBODY

    def options(self, folder: Path) -> ModelOptions:
        """Return the options for reading the model.

        Args:
            folder: Base folder of relative folder names.
        """
        return ModelOptions(
            self.base,
            self.base_pose.transform(),
            np.array(self.gravity, dtype=float),
            self.fixed_joints,
            {name: folder / path for name, path in self.packages.items()},
            self.elastic.joints(),
            self.joint_damping,
        )


_SHORTEST_PERIOD = 1e-6  # s


@dc.dataclass
class LostFrames:
    """Interval in which a bus loses its frames.

    Attributes:
        begin: Begin [s].
        end: End [s]; not later than ``begin`` for never.
    """

    begin: float = 0.0
    end: float = 0.0

    def __post_init__(self) -> None:
        finite = bool(np.isfinite(self.begin)) and not np.isnan(self.end)
        require(finite, "begin", [self.begin, self.end], "numbers of seconds")


@dc.dataclass
class ServoParameters(Parameters):
    """Velocity controllers of the joints, behind the law ``velocity_servo``.

    Attributes:
        bandwidth: ``omega`` [rad/s], see :func:`~pfsc_drake.physics.velocity_servo.servo_gains`.
        integral_rate: Rate at which loads are removed [rad/s]; 0 for no integral part,
            negative for a quarter of the bandwidth.
        period: Sampling time [s], from 1e-6 on, a whole fraction of the controller's; 0 for the
            same.
        bus_delay: Delay between law and servo [s], a multiple of the controller's
            sampling time, at most 10,000 of it; 0 for none.
        lost: Interval in which the bus loses its frames; it needs a delay.
        watchdog: Time without a reference over the bus after which the servos stop by themselves
            [s]; 0 for never.
    """

    bandwidth: Positive = 200.0
    integral_rate: Finite = -1.0
    period: Annotated[float, Range(_SHORTEST_PERIOD, 0.1, "s, a positive number", besides=0.0)] = (
        0.0
    )
    bus_delay: NotNegative = 0.0
    lost: LostFrames = dc.field(default_factory=LostFrames)
    watchdog: NotNegative = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        loses = self.lost.end > self.lost.begin
        require(not loses or self.bus_delay > 0.0, "lost", self.lost, "only with a bus_delay")


_LONGEST_DELAY = 1000  # ticks


@dc.dataclass
class DriverParameters(Parameters):
    """Driver between a law that commands torques and the robot's drives.

    Attributes:
        delay: Delay from command to torque [s], a multiple of the controller's sampling time, at
            most 1,000 of it. A link to a robot takes one.
        low_pass: Cut-off frequency of the low pass of the torques [Hz]; 0 for none.
    """

    delay: NotNegative = 0.0
    low_pass: NotNegative = 0.0

    def ticks(self, period: float) -> int:
        """Return the delay in ticks.

        Args:
            period: Sampling time of the controller [s].

        Raises:
            InputError: If it is no multiple of the period.
        """
        return require_whole_ticks("driver.delay", self.delay, period, _LONGEST_DELAY)


@dc.dataclass
class SensorParameters(ForceTorqueParameters, ToolCompensationParameters):
    """The force/torque sensor and the processing of its signal; only built with compliance.

    In arrays of six, the first three entries are forces [N], the others torques [Nm]; two numbers
    stand for equal forces and equal torques, one for six equal entries. A sensor with noise that
    repeats a value exactly is detected as lost. Its bandwidth is also used for the compensation of
    the tool.

    Attributes:
        joint: Fixed joint of the model with the sensor in it; its child side is the tool. By
            default, of those between the last moving link and the tool frame, the nearest to the
            tool that has mass behind it.
        delay: Delay of the measurement [s], a multiple of the controller's sampling time, shorter
            than taring and than the time after which a constant signal is a fault.
        unknown_mass: Mass that may hang below the sensor in addition to the nominal load [kg]; only
            for warnings before a run, see
            :func:`~diagrams.warnings.sensed_load.sensed_load_warnings`, and for margins.
    """

    joint: str = ""
    delay: float = 0.0
    unknown_mass: NotNegative = 0.0
    # no component of the station measures accelerations
    inertia: Annotated[str, OneOf(("differentiated", "none"))] = "differentiated"

    def __post_init__(self) -> None:
        super().__post_init__()
        # taring needs measurements, and a sensor without them is lost
        longest = min(STILL_TIME, self.taring_time)
        allowed = f"at least 0 and below {longest:g} s"
        require(0.0 <= self.delay < longest, "delay", self.delay, allowed)
