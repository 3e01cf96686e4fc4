"""Physical parameters of a serial robot, as held by ``models/<robot>/parameters.yaml``.

The dataclasses mirror the file and say what each key means; ``source`` always says where the
numbers are from. :func:`load_parameters` reads and checks the file.
"""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.denavit_hartenberg import DenavitHartenberg
from pfsc_drake.robot.model_files import load_yaml, models_directory

_POSITIVE, _NOT_NEGATIVE = {"sign": "positive"}, {"sign": "not negative"}


def _empty() -> np.ndarray:
    return np.zeros(0)


@dataclass
class DhParameters:
    """The DH table of N revolute joints (Tab. 2.1), with one entry per joint.

    Attributes:
        d: offsets along z_{i-1} [m].
        a: lengths along x_i [m].
        alpha_deg: twists about x_i [deg].
    """

    d: np.ndarray = field(default_factory=_empty)
    a: np.ndarray = field(default_factory=_empty)
    alpha_deg: np.ndarray = field(default_factory=_empty)
    source: str = ""

    def table(self) -> DenavitHartenberg:
        """Returns the table with its direct kinematics."""
        return DenavitHartenberg(self.d, self.a, np.deg2rad(self.alpha_deg))


@dataclass
class JointLimitParameters:
    """Limits of the N joints (Tab. C.1), at the joint side.

    Attributes:
        position_lower_deg: smallest DH angles [deg].
        position_upper_deg: largest DH angles [deg].
        velocity_deg: largest absolute velocities [deg/s].
        acceleration_deg: largest absolute accelerations [deg/s^2].
        effort: largest absolute drive torques [Nm].
    """

    position_lower_deg: np.ndarray = field(default_factory=_empty)
    position_upper_deg: np.ndarray = field(default_factory=_empty)
    velocity_deg: np.ndarray = field(default_factory=_empty, metadata=_POSITIVE)
    acceleration_deg: np.ndarray = field(default_factory=_empty, metadata=_POSITIVE)
    effort: np.ndarray = field(default_factory=_empty, metadata=_POSITIVE)
    source: str = ""

    @property
    def position_lower(self) -> np.ndarray:
        """``[N]`` smallest DH angles [rad]."""
        return np.deg2rad(self.position_lower_deg)

    @property
    def position_upper(self) -> np.ndarray:
        """``[N]`` largest DH angles [rad]."""
        return np.deg2rad(self.position_upper_deg)

    @property
    def velocity(self) -> np.ndarray:
        """``[N]`` largest absolute velocities [rad/s]."""
        return np.deg2rad(self.velocity_deg)

    @property
    def acceleration(self) -> np.ndarray:
        """``[N]`` largest absolute accelerations [rad/s^2]."""
        return np.deg2rad(self.acceleration_deg)


@dataclass
class BodyParameters:
    """Mass properties of one rigid body, in its body frame (a link's DH frame).

    Attributes:
        name: of the body.
        mass: [kg].
        center_of_mass: ``[3]`` [m].
        inertia: ``[6]``, about the center of mass: xx, yy, zz, xy, xz, yz [kg m^2].
    """

    name: str = ""
    mass: float = 0.0
    center_of_mass: np.ndarray = field(default_factory=_empty)
    inertia: np.ndarray = field(default_factory=_empty)
    source: str = ""

    def inertia_matrix(self) -> np.ndarray:
        """Returns the inertia about the center of mass, ``[3, 3]`` [kg m^2]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass
class ToolParameters(BodyParameters):
    """The rigid body on the flange; its frame is DH frame N.

    Attributes:
        tool_point: ``[3]`` tool offset ``[x_NT, y_NT, z_NT]`` of (2.5) [m].
    """

    tool_point: np.ndarray = field(default_factory=_empty)


@dataclass
class RotorParameters:
    """The rotors of the N drives.

    Attributes:
        inertia: ``[N]`` I_M,zz about the spin axis, at the motor side [kg m^2].
        gear_ratio: ``[N]`` 1/k_r, motor revolutions per joint revolution.
        body_mass: of each rotor body in elastic models [kg]; a part of the carrying link's mass.
    """

    inertia: np.ndarray = field(default_factory=_empty, metadata=_POSITIVE)
    gear_ratio: np.ndarray = field(default_factory=_empty, metadata=_POSITIVE)
    body_mass: float = 0.0
    source: str = ""

    @property
    def reflected_inertia(self) -> np.ndarray:
        """``[N]`` diagonal of D_M, ``I_M,zz / k_r^2``, eq. (2.63), at the joint side [kg m^2]."""
        return self.inertia * self.gear_ratio**2


@dataclass
class ElasticityParameters:
    """Elasticity of the first joints of a robot, eq. (2.66).

    Attributes:
        stiffness: diagonal of K_s [Nm/rad].
        damping: diagonal of K_d [Nms/rad].
    """

    stiffness: np.ndarray = field(default_factory=_empty, metadata=_POSITIVE)
    damping: np.ndarray = field(default_factory=_empty, metadata=_NOT_NEGATIVE)
    source: str = ""


@dataclass
class FrictionParameters:
    """Joint friction ``f_c sign(q') + f_v q'``, eq. (2.41), at the joint side.

    Attributes:
        coulomb: ``[N]`` f_c [Nm].
        viscous: ``[N]`` f_v [Nms/rad].
    """

    coulomb: np.ndarray = field(default_factory=_empty, metadata=_NOT_NEGATIVE)
    viscous: np.ndarray = field(default_factory=_empty, metadata=_NOT_NEGATIVE)
    source: str = ""


@dataclass
class VariantParameters:
    """One model file that is written from the parameters.

    Attributes:
        name: of the model and of its file.
        elasticity: a key of :attr:`RobotParameters.elasticities`, or empty for rigid joints.
        fixed_deg: DH angles at which the last joints are welded [deg]; empty if all joints move.
    """

    name: str = ""
    elasticity: str = ""
    fixed_deg: np.ndarray = field(default_factory=_empty)


@dataclass
class RobotParameters:
    """All physical parameters of a serial robot with N revolute joints.

    Attributes:
        name: of the robot.
        denavit_hartenberg: kinematics.
        joint_limits: of the joints.
        links: the N moving links, from the base on.
        tool: the body on the flange, with the tool point.
        rotors: the drives.
        elasticities: named sets of joint elasticities.
        friction: joint friction.
        variants: the model files that are written from these parameters.
    """

    name: str = ""
    denavit_hartenberg: DhParameters = field(default_factory=DhParameters)
    joint_limits: JointLimitParameters = field(default_factory=JointLimitParameters)
    links: list[BodyParameters] = field(default_factory=list)
    tool: ToolParameters = field(default_factory=ToolParameters)
    rotors: RotorParameters = field(default_factory=RotorParameters)
    elasticities: dict[str, ElasticityParameters] = field(default_factory=dict)
    friction: FrictionParameters = field(default_factory=FrictionParameters)
    variants: list[VariantParameters] = field(default_factory=list)


def load_parameters(robot: str | Path) -> RobotParameters:
    """Reads the parameters of a robot and checks them.

    Args:
        robot: the name of a shipped robot (``"comau_racer_1_4"``) or the path of a YAML file.

    Raises:
        InputError: if the file cannot be read or a key is unknown, missing or out of range.
    """
    path = Path(robot)
    if not path.suffix:
        path = models_directory() / path / "parameters.yaml"
        if not path.is_file():
            known = sorted(
                file.parent.name for file in models_directory().glob("*/parameters.yaml")
            )
            raise InputError(f"robot {str(robot)!r}: must be a file or one of {', '.join(known)}")
    parameters = load_yaml(RobotParameters, path)
    _Checker(path).check(parameters)
    return parameters


@dataclass
class _Checker:
    """Raises InputError where the parameters of one file are missing or out of range."""

    path: Path

    def check(self, robot: RobotParameters) -> None:
        dh, limits, rotors = robot.denavit_hartenberg, robot.joint_limits, robot.rotors
        axes = dh.d.size
        self._require(bool(robot.name), "name", robot.name, "a name")
        self._require(axes > 0, "denavit_hartenberg.d", dh.d, "one number per joint")
        for key in ("denavit_hartenberg", "joint_limits", "rotors", "friction"):
            self._rows(key, getattr(robot, key), axes)
        lower, upper = limits.position_lower_deg, limits.position_upper_deg
        allowed = f"less than position_upper_deg = {upper.tolist()}"
        key = "joint_limits.position_lower_deg"
        self._require(bool(np.all(lower < upper)), key, lower, allowed)
        self._require(len(robot.links) == axes, "links", len(robot.links), f"{axes} links")
        for i, link in enumerate(robot.links):
            self._body(f"links[{i}]", link)
        self._body("tool", robot.tool)
        self._size("tool.tool_point", robot.tool.tool_point, 3)
        light = 0 <= rotors.body_mass < min(link.mass for link in robot.links)
        allowed = "at least 0 and below every link's mass"
        self._require(light, "rotors.body_mass", rotors.body_mass, allowed)
        for name, elasticity in robot.elasticities.items():
            self._rows(f"elasticities.{name}", elasticity, elasticity.stiffness.size)
        for i, variant in enumerate(robot.variants):
            self._variant(f"variants[{i}]", variant, robot)

    def _variant(self, key: str, variant: VariantParameters, robot: RobotParameters) -> None:
        axes = robot.denavit_hartenberg.d.size
        self._require(bool(variant.name), f"{key}.name", variant.name, "a name")
        moving = axes - variant.fixed_deg.size
        self._require(moving > 0, f"{key}.fixed_deg", variant.fixed_deg, f"less than {axes} angles")
        if variant.elasticity:
            sets = [n for n, e in robot.elasticities.items() if e.stiffness.size == moving]
            allowed = f"empty or a set for {moving} joints: {', '.join(sets) or 'none'}"
            key = f"{key}.elasticity"
            self._require(variant.elasticity in sets, key, variant.elasticity, allowed)

    def _body(self, key: str, body: BodyParameters) -> None:
        self._require(bool(body.name), f"{key}.name", body.name, "a name")
        self._require(0 < body.mass < np.inf, f"{key}.mass", body.mass, "positive")
        self._size(f"{key}.center_of_mass", body.center_of_mass, 3)
        self._size(f"{key}.inertia", body.inertia, 6)
        principal = np.linalg.eigvalsh(body.inertia_matrix())
        physical = principal[0] >= 0 and 2 * principal[2] <= principal.sum() * (1 + 1e-6)
        allowed = "physical (no principal moment negative or above the sum of the other two)"
        self._require(bool(physical), f"{key}.inertia", body.inertia, allowed)

    def _rows(self, group_key: str, group: Any, size: int) -> None:
        for entry in fields(group):
            key, value = f"{group_key}.{entry.name}", getattr(group, entry.name)
            if isinstance(value, np.ndarray):
                self._size(key, value, size)
                sign = entry.metadata.get("sign", "")
                fits = np.all(value > 0 if sign == "positive" else value >= 0) or not sign
                self._require(bool(fits), key, value, sign)

    def _size(self, key: str, value: np.ndarray, size: int) -> None:
        fits = value.shape == (size,) and bool(np.all(np.isfinite(value)))
        self._require(fits, key, value, f"{size} finite numbers")

    def _require(self, condition: bool, key: str, value: object, allowed: str) -> None:
        if not condition:
            shown = value.tolist() if isinstance(value, np.ndarray) else value
            raise InputError(f"{self.path}: {key} = {shown!r}: must be {allowed}")
