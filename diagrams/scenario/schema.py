"""What a path following scenario says: the schema of a scenario file.

Lengths in m, angles in rad unless a name ends in ``_deg``, times in s.
"""

import dataclasses as dc

import numpy as np
from pydrake.systems.analysis import GetIntegrationSchemes

from diagrams.scenario.checks import (
    require,
    require_not_negative,
    require_numbers,
    require_positive,
)
from diagrams.scenario.compliance import ComplianceParameters, SensorParameters
from diagrams.scenario.controller import ControllerParameters, GainParameters, LawGains
from diagrams.scenario.drives import JointFrictionParameters, ServoParameters
from diagrams.scenario.path import (
    BentLemniscate,
    Circle,
    Keyframe,
    Line,
    OrientationParameters,
    PathParameters,
    Waypoints,
)
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.physics.force_profile import ForcePulse
from pfsc_drake.physics.hand_model import HandParameters, HandWaypoint
from pfsc_drake.systems.physics.joint_encoders import EncoderOptions

__all__ = [
    "BentLemniscate",
    "Circle",
    "ComplianceParameters",
    "ControllerParameters",
    "EncoderOptions",
    "ForcePulse",
    "GainParameters",
    "HandParameters",
    "HandWaypoint",
    "HoldBackParameters",
    "JointFrictionParameters",
    "Keyframe",
    "LawGains",
    "Line",
    "OrientationParameters",
    "PathFollowingScenario",
    "PathParameters",
    "ReferenceParameters",
    "RobotParameters",
    "SensorFailureParameters",
    "SensorParameters",
    "ServoParameters",
    "SimulationParameters",
    "StartParameters",
    "Target",
    "Waypoints",
]


@dc.dataclass
class RobotParameters:
    """Which robot.

    Attributes:
        model: Name of a shipped model, a ``package://`` URI, or an SDF/URDF file.
        tool_frame: Frame of the model whose origin follows the path.
        joint_damping: ``K_d`` of its elastic joints, base first [Nm s/rad or N s/m]; empty for
            the model's.
        rotor_coupling: Name of a shipped robot, or YAML file with robot parameters, that says
            where the rotors of its drives sit. The robot then obeys the full elastic model
            (2.64), with the inertia coupling of spinning rotors and moving links that the
            laws neglect; empty for the simplified model (2.65).
    """

    model: str = "comau_racer_1_4"
    tool_frame: str = "tool_point"
    joint_damping: list[float] = dc.field(default_factory=list)
    rotor_coupling: str = ""

    def __post_init__(self) -> None:
        damping = self.joint_damping
        valid = all(np.isfinite(K_d) and K_d >= 0.0 for K_d in damping)
        require(valid, "joint_damping", damping, "finite numbers, none negative")


@dc.dataclass
class ReferenceParameters:
    """Motion along the path, resting at every point.

    Attributes:
        points: Arc lengths to visit [m]; the first is the start.
        velocity: Largest velocity [m/s].
        acceleration: Largest acceleration [m/s^2].
        dwell: Rest before, between and after the moves [s].
    """

    points: list[float] = dc.field(default_factory=lambda: [0.0, 0.1])
    velocity: float = 0.1
    acceleration: float = 1.0
    dwell: float = 0.3

    def __post_init__(self) -> None:
        enough = len(self.points) >= 2 and bool(np.isfinite(self.points).all())
        require(enough, "points", self.points, "two or more finite numbers")
        require_positive("velocity", self.velocity)
        require_positive("acceleration", self.acceleration)
        require_not_negative("dwell", self.dwell)


@dc.dataclass
class StartParameters:
    """Where the tool is at the start, at rest.

    Attributes:
        offset: Transversal coordinates [m] beside the first point of the reference.
        rotation_deg: ZYX angles [deg] away from the path's orientation.
        posture_deg: Joint angles [deg] near the start pose (m for prismatic joints); they
            choose the branch of the inverse kinematics.
    """

    offset: list[float] = dc.field(default_factory=lambda: [0.0, 0.0])
    rotation_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    posture_deg: list[float] = dc.field(default_factory=list)

    def __post_init__(self) -> None:
        require_numbers("offset", self.offset, 2)
        require_numbers("rotation_deg", self.rotation_deg, 3)
        finite = bool(np.isfinite(self.posture_deg).all())
        require(finite, "posture_deg", self.posture_deg, "finite numbers")


@dc.dataclass
class HoldBackParameters:
    """A wrench that holds the robot back along its path and has no other effect (Sec. 3.8.4).

    Attributes:
        begin: When it leaves zero [s].
        end: When it is zero again [s].
        force: Along the tangent [N], negative against growing ``eta``; 0 for none.
        ramp: Time from zero to full and back [s].
    """

    begin: float = 0.0
    end: float = 1.0
    force: float = 0.0
    ramp: float = 0.05

    def __post_init__(self) -> None:
        require(np.isfinite(self.force), "force", self.force, "a finite number")
        require_positive("ramp", self.ramp)
        long_enough = 2.0 * self.ramp <= (self.end - self.begin) * (1.0 + 1e-9)
        require(long_enough, "end", self.end, "begin + 2 ramp or later")


@dc.dataclass
class SensorFailureParameters:
    """A component of the measured joint state that becomes NaN.

    Attributes:
        time: When [s]; negative for never.
        component: Index in ``[q_J, v_J, q_M, v_M]``.
    """

    time: float = -1.0
    component: int = 0


@dc.dataclass
class SimulationParameters:
    """How the plant is integrated.

    Attributes:
        integrator: Drake's name of the integration scheme.
        max_step: Largest step [s].
        accuracy: Accuracy of error control; 0 for fixed steps.
        frame_period: Time between the frames of the recording [s].
        sensor_failure: A sensor that fails on the way.
    """

    integrator: str = "runge_kutta5"
    max_step: float = 1e-3
    accuracy: float = 0.0
    frame_period: float = 0.032
    sensor_failure: SensorFailureParameters = dc.field(default_factory=SensorFailureParameters)

    def __post_init__(self) -> None:
        schemes = GetIntegrationSchemes()
        require(self.integrator in schemes, "integrator", self.integrator, ", ".join(schemes))
        require(1e-6 <= self.max_step <= 0.1, "max_step", self.max_step, "1e-6 to 0.1 s")
        require_positive("frame_period", self.frame_period)
        require_not_negative("accuracy", self.accuracy)
        # their error control works on stale values after a rejected step
        stale = ("runge_kutta5", "bogacki_shampine3")
        require(
            self.accuracy == 0.0 or self.integrator not in stale,
            "accuracy",
            self.accuracy,
            f"0 (fixed steps) with {' and '.join(stale)}; runge_kutta3 has error control",
        )


@dc.dataclass
class Target:
    """What a metric should be.

    Attributes:
        bound: Comparison and number in SI units, e.g. ``< 5e-5``.
        source: Where it comes from.
    """

    bound: str = ""
    source: str = ""


@dc.dataclass
class PathFollowingScenario:
    """A path following run.

    Attributes:
        name: Name of the scenario.
        section: Section of the dissertation.
        description: One line.
        robot: Which robot.
        path: Which path.
        controller: The controller.
        reference: Motion along the path.
        start: Where it starts.
        simulation: How it is integrated.
        forces: Wrenches on the tool over time.
        hand: An operator's hand on the tool, in addition to the forces; none without the block.
        hold_back: A wrench that only slows the robot down.
        servo: Velocity controllers of the joints, for the law ``velocity_servo``.
        friction: Friction of the joints.
        encoders: What the encoders do to the joint state.
        compliance: How the tool yields to measured forces.
        sensor: The force/torque sensor that measures them.
        duration: Simulated time [s]; 0 for the length of the reference.
        settling_tolerance: Distance from the path that counts as converged [m].
        targets: What metrics should be, by metric; under a law's name for that law only.
    """

    name: str = ""
    section: str = ""
    description: str = ""
    robot: RobotParameters = dc.field(default_factory=RobotParameters)
    path: PathParameters = dc.field(default_factory=PathParameters)
    controller: ControllerParameters = dc.field(default_factory=ControllerParameters)
    reference: ReferenceParameters = dc.field(default_factory=ReferenceParameters)
    start: StartParameters = dc.field(default_factory=StartParameters)
    simulation: SimulationParameters = dc.field(default_factory=SimulationParameters)
    forces: list[ForcePulse] = dc.field(default_factory=list)
    hand: HandParameters | None = None
    hold_back: HoldBackParameters = dc.field(default_factory=HoldBackParameters)
    servo: ServoParameters = dc.field(default_factory=ServoParameters)
    friction: JointFrictionParameters = dc.field(default_factory=JointFrictionParameters)
    encoders: EncoderOptions = dc.field(default_factory=EncoderOptions)
    compliance: ComplianceParameters = dc.field(default_factory=ComplianceParameters)
    sensor: SensorParameters = dc.field(default_factory=SensorParameters)
    duration: float = 0.0
    settling_tolerance: float = 1e-4
    targets: dict[str, dict[str, Target]] = dc.field(default_factory=dict)

    def __post_init__(self) -> None:
        plain = not set(self.name) & set("/\\:") and self.name not in (".", "..")
        require(plain, "name", self.name, "a name without slashes and colons")
        require_not_negative("duration", self.duration)
        require_positive("settling_tolerance", self.settling_tolerance)
        for law in self.targets:
            require(law in RELATIVE_DEGREE, "targets", law, ", ".join(RELATIVE_DEGREE))
