"""What a path following scenario says: the schema of a scenario file.

Lengths in m, angles in rad unless a name ends in ``_deg``, times in s.
"""

import dataclasses as dc
from typing import Union

import numpy as np

from pfsc_drake.control.linearization import RELATIVE_DEGREE
from pfsc_drake.errors import InputError


def _require(condition: bool, key: str, value: object, allowed: str) -> None:
    if not condition:
        raise InputError(f"{key} = {value}; allowed: {allowed}")


@dc.dataclass
class RobotParameters:
    """Which robot.

    Attributes:
        model: Name of a shipped model, a ``package://`` URI, or an SDF/URDF file.
        tool_frame: Frame of the model whose origin follows the path.
    """

    model: str = "comau_racer_1_4"
    tool_frame: str = "tool_point"


@dc.dataclass
class Line:
    """A straight path.

    Attributes:
        start: First point [m].
        end: Last point [m].
    """

    start: list[float] = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    end: list[float] = dc.field(default_factory=lambda: [0.8, 0.3, 1.0])


@dc.dataclass
class Circle:
    """A circular path ``center + radius (u cos theta + v sin theta)``.

    Attributes:
        center: Center [m].
        radius: Radius [m].
        axis_u: Direction of ``u``.
        axis_v: Direction of ``v``.
    """

    center: list[float] = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    radius: float = 0.15
    axis_u: list[float] = dc.field(default_factory=lambda: [0.0, 1.0, 0.0])
    axis_v: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])


@dc.dataclass
class BentLemniscate:
    """The vertically bent lemniscate (3.87)."""


@dc.dataclass
class Waypoints:
    """A spline through the waypoints of a CSV file, orientation included if it has one.

    Attributes:
        file: CSV file, relative to the scenario's folder.
        closed: Whether the path is closed.
        parametrization: ``chord`` or ``centripetal``.
        smoothness: Class C^k of the spline; 0 chooses what the law needs.
    """

    file: str = ""
    closed: bool = False
    parametrization: str = "chord"
    smoothness: int = 0

    def __post_init__(self) -> None:
        allowed = ("chord", "centripetal")
        _require(
            self.parametrization in allowed,
            "parametrization",
            self.parametrization,
            ", ".join(allowed),
        )
        _require(0 <= self.smoothness <= 6, "smoothness", self.smoothness, "0 to 6")


PathShape = Union[BentLemniscate, Circle, Line, Waypoints]  # noqa: UP007 (Drake's YAML needs it)


@dc.dataclass
class Keyframe:
    """Orientation of the tool at one point of the path.

    Attributes:
        theta: Path parameter, as a fraction of the path's domain (0..1).
        angles_deg: Euler angles [deg], in the order of the convention's name.
    """

    theta: float = 0.0
    angles_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])


@dc.dataclass
class OrientationParameters:
    """Orientation along the path.

    Attributes:
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).
        keyframes: Orientations to interpolate; one alone is kept everywhere; on a
            closed path the first is repeated at the end.
    """

    convention: str = "zyx"
    keyframes: list[Keyframe] = dc.field(default_factory=list)

    def __post_init__(self) -> None:
        _require(self.convention in ("zyx", "zyz"), "convention", self.convention, "zyx, zyz")
        for i, keyframe in enumerate(self.keyframes):
            angles = keyframe.angles_deg
            _require(len(angles) == 3, f"keyframes[{i}].angles_deg", angles, "3 angles")


@dc.dataclass
class PathParameters:
    """The path.

    Attributes:
        shape: Position, one of ``!BentLemniscate``, ``!Circle``, ``!Line``, ``!Waypoints``.
        orientation: Orientation; without keyframes the waypoint file's, or none.
    """

    shape: PathShape = dc.field(default_factory=BentLemniscate)
    orientation: OrientationParameters = dc.field(default_factory=OrientationParameters)


@dc.dataclass
class GainParameters:
    """Gains of one kind of coordinate, by poles or by the dissertation's coefficients.

    Attributes:
        poles: Real poles [1/s], r of them.
        coefficients: ``a_1 .. a_r``, alternatively.
        integral: ``a_0``; needs coefficients.
    """

    poles: list[float] = dc.field(default_factory=list)
    coefficients: list[float] = dc.field(default_factory=list)
    integral: float = 0.0

    def __post_init__(self) -> None:
        _require(
            not (self.poles and (self.coefficients or self.integral)),
            "poles",
            self.poles,
            "either poles, or coefficients with or without integral",
        )


@dc.dataclass
class LawGains:
    """Gains of all coordinates for one law.

    Attributes:
        eta: Tangential.
        xi: Both transversal.
        phi: Rotational; unused by arms that only position.
    """

    eta: GainParameters = dc.field(default_factory=GainParameters)
    xi: GainParameters = dc.field(default_factory=GainParameters)
    phi: GainParameters = dc.field(default_factory=GainParameters)


@dc.dataclass
class ControllerParameters:
    """The path following controller.

    Attributes:
        law: Actuation model that the law is made for.
        gains: Gains by law.
        sampling_time: Sampling time ``T_s`` [s].
        boundary_layer_damping: Diagonal of ``epsilon D_b`` [s], for ``singular_perturbation``.
        min_rcond: Smallest reciprocal condition number of the decoupling matrix.
        max_alpha: End of the feasible neighbourhood for the controller, below 1.
        brake_damping: Damping of the safe state on every drive, as a fraction of its
            effort limit per rad/s.
        effort_scale: Fraction of the model's effort limits that the law may use.
    """

    law: str = "elastic"
    gains: dict[str, LawGains] = dc.field(default_factory=dict)
    sampling_time: float = 1e-3
    boundary_layer_damping: list[float] = dc.field(default_factory=list)
    min_rcond: float = 1e-3
    max_alpha: float = 0.95
    brake_damping: float = 0.1
    effort_scale: float = 1.0

    def __post_init__(self) -> None:
        _require(self.law in RELATIVE_DEGREE, "law", self.law, ", ".join(RELATIVE_DEGREE))
        for law in self.gains:
            _require(law in RELATIVE_DEGREE, "gains", law, ", ".join(RELATIVE_DEGREE))
        for key in ("sampling_time", "effort_scale"):
            value = getattr(self, key)
            _require(np.isfinite(value) and value > 0.0, key, value, "a positive number")
        _require(self.brake_damping >= 0.0, "brake_damping", self.brake_damping, "zero or more")


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
        _require(len(self.offset) == 2, "offset", self.offset, "2 numbers, xi_1 and xi_2")
        _require(len(self.rotation_deg) == 3, "rotation_deg", self.rotation_deg, "3 angles")


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
    duration: float = 0.0
    settling_tolerance: float = 1e-4
    targets: dict[str, dict[str, Target]] = dc.field(default_factory=dict)
