"""Physical parameters of a serial robot, as in ``models/<robot>/parameters.yaml``.

The dataclasses mirror the file, describe each key and refuse values out of range;
``source`` always names the origin of the numbers. :func:`load_parameters` reads the file.
"""

import copy
import functools
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from pfsc_drake.checks import require, require_numbers
from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.serial.denavit_hartenberg import DenavitHartenberg
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.reading import read_text
from pfsc_drake.yaml.rules import Name, Numbers, Parameters, Positive, Range
from pfsc_drake.yaml.typed import load_file

# Defaults of required keys make a robot with one joint, which is valid.
_PLACEHOLDER_NAME = "unnamed"

_Positives = Annotated[np.ndarray, Numbers(each=Range(0.0, open=True))]
_NotNegatives = Annotated[np.ndarray, Numbers(each=Range(0.0))]

# by which the length of a unit vector may be off
_UNIT_LENGTH = 1e-6


def _zero() -> np.ndarray:
    return np.zeros(1)


def _one() -> np.ndarray:
    return np.ones(1)


def _origin() -> np.ndarray:
    return np.zeros(3)


@dataclass
class DhParameters:
    """The DH table of N revolute joints (Tab. 2.1), with one entry per joint.

    Attributes:
        d: offsets along z_{i-1} [m].
        a: lengths along x_i [m].
        alpha_deg: twists about x_i [deg].
    """

    d: np.ndarray = field(default_factory=_zero, metadata=REQUIRED)
    a: np.ndarray = field(default_factory=_zero, metadata=REQUIRED)
    alpha_deg: np.ndarray = field(default_factory=_zero, metadata=REQUIRED)
    source: str = ""

    def __post_init__(self) -> None:
        _check_entries(self, axes=self.d.size)

    def table(self) -> DenavitHartenberg:
        """Return the table with its direct kinematics."""
        return DenavitHartenberg(self.d, self.a, np.deg2rad(self.alpha_deg))


@dataclass
class JointLimitParameters(Parameters):
    """Limits of the N joints (Tab. C.1), at the joint side.

    Attributes:
        position_lower_deg: smallest DH angles [deg].
        position_upper_deg: largest DH angles [deg].
        velocity_deg: largest absolute velocities [deg/s].
        acceleration_deg: largest absolute accelerations [deg/s^2].
        effort: largest absolute drive torques [Nm].
    """

    position_lower_deg: np.ndarray = field(default_factory=_zero, metadata=REQUIRED)
    position_upper_deg: np.ndarray = field(default_factory=_one, metadata=REQUIRED)
    velocity_deg: _Positives = field(default_factory=_one, metadata=REQUIRED)
    acceleration_deg: _Positives = field(default_factory=_one, metadata=REQUIRED)
    effort: _Positives = field(default_factory=_one, metadata=REQUIRED)
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        lower, upper = self.position_lower_deg, self.position_upper_deg
        _check_entries(self, axes=lower.size)
        allowed = f"less than position_upper_deg = {upper.tolist()}"
        require(bool(np.all(lower < upper)), "position_lower_deg", lower, allowed)

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
class BodyParameters(Parameters):
    """Mass properties of one rigid body, in its body frame (a link's DH frame).

    Attributes:
        name: of the body.
        mass: [kg].
        center_of_mass: ``[3]`` [m].
        inertia: ``[6]``, about the center of mass: xx, yy, zz, xy, xz, yz [kg m^2].
    """

    name: Name = field(default=_PLACEHOLDER_NAME, metadata=REQUIRED)
    mass: Positive = field(default=1.0, metadata=REQUIRED)
    center_of_mass: Annotated[np.ndarray, Numbers(3)] = field(
        default_factory=_origin, metadata=REQUIRED
    )
    inertia: Annotated[np.ndarray, Numbers(6)] = field(
        default_factory=lambda: np.zeros(6), metadata=REQUIRED
    )
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        principal = np.linalg.eigvalsh(self.inertia_matrix())
        physical = principal[0] >= 0 and 2 * principal[2] <= principal.sum() * (1 + 1e-6)
        allowed = "physical (no principal moment negative or above the sum of the other two)"
        require(bool(physical), "inertia", self.inertia, allowed)

    def inertia_matrix(self) -> np.ndarray:
        """Return the inertia about the center of mass, ``[3, 3]`` [kg m^2]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass
class ToolParameters(BodyParameters):
    """The rigid body on the flange; its frame is DH frame N.

    Attributes:
        tool_point: ``[3]`` tool offset ``[x_NT, y_NT, z_NT]`` of (2.5) [m].
    """

    tool_point: Annotated[np.ndarray, Numbers(3)] = field(
        default_factory=_origin, metadata=REQUIRED
    )


@dataclass
class RotorParameters(Parameters):
    """The rotors of the N drives.

    Attributes:
        inertia: ``[N]`` I_M,zz about the spin axis, at the motor side [kg m^2].
        gear_ratio: ``[N]`` 1/k_r, motor revolutions per joint revolution.
        body_mass: of each rotor body in elastic models [kg]; a part of the carrying link's mass.
        fixed_to_link: link that carries each rotor, 0 for the base (Tab. 2.3); or empty.
        spin_axes: unit vector of each rotor's spin axis in the DH frame of that link, the last
            column of R_i^{M,j} (Tab. 2.3); or empty.
    """

    inertia: _Positives = field(default_factory=_one, metadata=REQUIRED)
    gear_ratio: _Positives = field(default_factory=_one, metadata=REQUIRED)
    body_mass: Annotated[float, Range(0, words="at least 0 and finite")] = 0.0
    fixed_to_link: list[int] = field(default_factory=list)
    spin_axes: list[list[float]] = field(default_factory=list)
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        axes = self.inertia.size
        _check_entries(self, axes)
        links, spin_axes = self.fixed_to_link, self.spin_axes
        for key, value in (("fixed_to_link", links), ("spin_axes", spin_axes)):
            fits = len(value) == (axes if links or spin_axes else 0)
            require(fits, key, value, f"one per rotor, {axes}, or both keys empty")
        in_range = all(0 <= link <= axes for link in links)
        require(in_range, "fixed_to_link", links, f"numbers from 0 (base) to {axes}")
        for axis in spin_axes:
            is_unit = len(axis) == 3 and abs(np.linalg.norm(axis) - 1.0) < _UNIT_LENGTH
            require(bool(is_unit), "spin_axes", axis, "unit vectors, 3 numbers each")

    @property
    def reflected_inertia(self) -> np.ndarray:
        """``[N]`` diagonal of D_M, ``I_M,zz / k_r^2``, eq. (2.63), at the joint side [kg m^2]."""
        return self.inertia * self.gear_ratio**2


@dataclass
class ElasticityParameters(Parameters):
    """Elasticity of the first joints of a robot, eq. (2.66).

    Attributes:
        stiffness: diagonal of K_s [Nm/rad].
        damping: diagonal of K_d [Nms/rad].
    """

    stiffness: _Positives = field(default_factory=_one, metadata=REQUIRED)
    damping: _NotNegatives = field(default_factory=_zero, metadata=REQUIRED)
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_entries(self, axes=self.stiffness.size)


@dataclass
class FrictionParameters(Parameters):
    """Joint friction ``f_c sign(q') + f_v q'``, eq. (2.41), at the joint side.

    Attributes:
        coulomb: ``[N]`` f_c [Nm].
        viscous: ``[N]`` f_v [Nms/rad].
    """

    coulomb: _NotNegatives = field(default_factory=_zero, metadata=REQUIRED)
    viscous: _NotNegatives = field(default_factory=_zero, metadata=REQUIRED)
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_entries(self, axes=self.coulomb.size)


@dataclass
class VariantParameters(Parameters):
    """One model file that is written from the parameters.

    Attributes:
        name: of the model and of its file.
        elasticity: a key of :attr:`ArmParameters.elasticities`, or empty for rigid joints.
        fixed_deg: DH angles at which the last joints are welded [deg]; empty if all joints move.
    """

    name: Name = field(default=_PLACEHOLDER_NAME, metadata=REQUIRED)
    elasticity: str = ""
    fixed_deg: Annotated[np.ndarray, Numbers()] = field(default_factory=lambda: np.zeros(0))


@dataclass
class ArmParameters(Parameters):
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

    name: Name = field(default=_PLACEHOLDER_NAME, metadata=REQUIRED)
    denavit_hartenberg: DhParameters = field(default_factory=DhParameters, metadata=REQUIRED)
    joint_limits: JointLimitParameters = field(
        default_factory=JointLimitParameters, metadata=REQUIRED
    )
    links: list[BodyParameters] = field(
        default_factory=lambda: [BodyParameters()], metadata=REQUIRED
    )
    tool: ToolParameters = field(default_factory=ToolParameters, metadata=REQUIRED)
    rotors: RotorParameters = field(default_factory=RotorParameters, metadata=REQUIRED)
    elasticities: dict[str, ElasticityParameters] = field(default_factory=dict)
    friction: FrictionParameters = field(default_factory=FrictionParameters, metadata=REQUIRED)
    variants: list[VariantParameters] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        axes = self.denavit_hartenberg.d.size
        for key in ("joint_limits", "rotors", "friction"):
            _check_entries(getattr(self, key), axes, prefix=f"{key}.")
        require(len(self.links) == axes, "links", len(self.links), f"{axes} links")
        light = self.rotors.body_mass < min(link.mass for link in self.links)
        require(light, "rotors.body_mass", self.rotors.body_mass, "below every link's mass")
        for i, variant in enumerate(self.variants):
            self._check_variant(f"variants[{i}]", variant, axes)

    def _check_variant(self, key: str, variant: VariantParameters, axes: int) -> None:
        moving = axes - variant.fixed_deg.size
        require(moving > 0, f"{key}.fixed_deg", variant.fixed_deg, f"less than {axes} angles")
        if variant.elasticity:
            sets = [n for n, e in self.elasticities.items() if e.stiffness.size == moving]
            allowed = f"empty or a set for {moving} joints: {', '.join(sets) or 'none'}"
            require(variant.elasticity in sets, f"{key}.elasticity", variant.elasticity, allowed)


def load_parameters(robot: str | Path) -> ArmParameters:
    """Return the parameters of a robot.

    Args:
        robot: the name of a shipped serial robot (``"comau_racer_1_4"``,
            ``"franka_emika_panda"``) or the path of a YAML file.

    Raises:
        InputError: if the file cannot be read or a key is unknown, missing or out of range.
    """
    path = Path(robot)
    if not path.suffix:
        files = models_directory().glob("*/parameters.yaml")
        known = sorted(file.parent.name for file in files if any(file.parent.glob("*.sdf")))
        path = models_directory() / path / "parameters.yaml"
        if str(robot) not in known:
            allowed = f"{', '.join(known)}{suggestion(robot, known)}"
            raise InputError(f"robot {str(robot)!r}: must be a file or one of {allowed}")
    return copy.deepcopy(_parameters(path, read_text(path)))


@functools.lru_cache(maxsize=16)
def _parameters(path: Path, content: str) -> ArmParameters:
    """Return the parameters in a file with the text ``content``; not to be changed."""
    return load_file(ArmParameters, path)


def _check_entries(group: Any, axes: int, prefix: str = "") -> None:
    """Check that every vector of a group has one entry per axis."""
    for entry in fields(group):
        key, value = prefix + entry.name, getattr(group, entry.name)
        if isinstance(value, np.ndarray):
            require(axes > 0, key, value, "one number per joint")
            require_numbers(key, value, axes)
