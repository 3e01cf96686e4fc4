"""Joints of a parsed model that become elastic, eq. (2.65), and rotors of rigid ones."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Joint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    SpatialInertia,
)

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.joint_edits import (
    actuator_of,
    moving_joints,
    remove_joint,
    sprung_joints,
)
from pfsc_drake.robot.models.model_parts import LARGEST
from pfsc_drake.yaml.fields import spread

# positive numbers below are slips of the pen
_SMALLEST = 1e-9


def _nothing() -> np.ndarray:
    return np.zeros(0)


@dataclass(frozen=True)
class ElasticJoints:
    """Elasticity of a model's joints; one value for all, or one for each, base first.

    Attributes:
        stiffness: Diagonal of ``K_s`` [Nm/rad or N/m]; infinite for a rigid joint; empty if all
            are.
        damping: Diagonal of ``K_d`` [Nm s/rad or N s/m]; empty for none.
        rotor_inertia: Rotor inertia of the drives, at the motor side [kg m^2; kg for slides];
            empty for the model's.
        gear_ratio: Motor revolutions per joint revolution; empty for the model's.
    """

    stiffness: np.ndarray = field(default_factory=_nothing)
    damping: np.ndarray = field(default_factory=_nothing)
    rotor_inertia: np.ndarray = field(default_factory=_nothing)
    gear_ratio: np.ndarray = field(default_factory=_nothing)

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InputError: If one is out of range.
        """
        positive = f"numbers from {_SMALLEST:g} to {LARGEST:g}"
        not_negative = f"finite numbers from 0 to {LARGEST:g}"
        for key, lower, allowed in (
            ("stiffness", _SMALLEST, f"{positive}, .inf for a rigid joint"),
            ("damping", 0.0, not_negative),
            ("rotor_inertia", 0.0, not_negative),
            ("gear_ratio", _SMALLEST, positive),
        ):
            values = np.atleast_1d(getattr(self, key))
            rigid = np.isposinf(values) & (key == "stiffness")
            if not np.all(rigid | ((values >= lower) & (values <= LARGEST))):
                raise InputError(f"elastic.{key} = {values.tolist()}; allowed: {allowed}")

    @property
    def is_given(self) -> bool:
        """Whether any parameter is set."""
        return any(np.size(getattr(self, f.name)) for f in fields(self))


def make_elastic(plant: MultibodyPlant, parameters: ElasticJoints) -> None:
    """Replace joints by motor joint, massless rotor body and coaxial sprung joint.

    The motor joint keeps name, limits, damping and drive; the sprung joint and the rotor body are
    named ``<joint>_flex`` and ``<joint>_rotor``. The position of the motor joint is ``q_M``, the
    position of the sprung joint ``q_J - q_M``.

    Args:
        plant: A plant that is not finalized, all of whose moving joints are driven.
        parameters: Elasticity of the joints.

    Raises:
        InputError: If the model is elastic already, or the numbers do not fit it.
    """
    if not parameters.is_given:
        return
    sprung = sprung_joints(plant)
    if sprung:
        raise InputError(
            f"elastic: the model is elastic already (joint '{sprung[0].name()}'); allowed: rigid"
        )
    joints = moving_joints(plant)
    names = [joint.name() for joint in joints]
    stiffness = _for_each(parameters.stiffness, "stiffness", names, np.inf)
    damping = _for_each(parameters.damping, "damping", names, 0.0)
    rotor_inertia = _for_each(parameters.rotor_inertia, "rotor_inertia", names, np.nan)
    gear_ratio = _for_each(parameters.gear_ratio, "gear_ratio", names, np.nan)
    springs = []
    for i, joint in enumerate(joints):
        drive = actuator_of(plant, joint)
        if drive is None:
            raise InputError(f"elastic: joint '{names[i]}' has no drive; allowed: driven joints")
        if np.isfinite(rotor_inertia[i]):
            drive.set_default_rotor_inertia(rotor_inertia[i])
        if np.isfinite(gear_ratio[i]):
            drive.set_default_gear_ratio(gear_ratio[i])
        if np.isinf(stiffness[i]):
            continue
        if not drive.default_reflected_inertia() > 0.0:
            raise InputError(
                f"elastic.rotor_inertia: joint '{names[i]}' has none; "
                "allowed: positive numbers for elastic joints"
            )
        record = remove_joint(plant, joint)
        rotor = plant.AddRigidBody(
            f"{names[i]}_rotor", record.frame_on_child.model_instance(), SpatialInertia.Zero()
        )
        record.add_to(plant, record.frame_on_parent, rotor.body_frame())
        flex = plant.AddJoint(
            record.kind(
                f"{names[i]}_flex",
                rotor.body_frame(),
                record.frame_on_child,
                record.axis,
                damping=damping[i],
            )
        )
        springs.append((flex, stiffness[i]))
    add_springs(plant, springs)


def add_springs(plant: MultibodyPlant, springs: Iterable[tuple[Joint, float]]) -> None:
    """Add springs, which rest at zero; joints cannot be removed from the plant afterwards.

    Args:
        plant: A plant that is not finalized.
        springs: Revolute or prismatic joints with their stiffness [Nm/rad or N/m].
    """
    for joint, stiffness in springs:
        spring = RevoluteSpring if isinstance(joint, RevoluteJoint) else PrismaticSpring
        plant.AddForceElement(spring(joint, 0.0, stiffness))


def set_joint_damping(plant: MultibodyPlant, damping: list[float]) -> None:
    """Set the damping of the sprung joints.

    Args:
        plant: A plant that is not finalized.
        damping: ``K_d``, base first [Nm s/rad or N s/m]; empty to leave it.

    Raises:
        InputError: If there are more or fewer sprung joints.
    """
    sprung = sprung_joints(plant)
    if not damping:
        return
    damping = spread(damping, len(sprung))
    if len(damping) != len(sprung):
        raise InputError(
            f"joint_damping: {len(damping)} values; the model has {len(sprung)} elastic joints"
        )
    for joint, K_d in zip(sprung, damping, strict=True):
        joint.set_default_damping_vector(np.array([K_d]))


def _for_each(values: np.ndarray, key: str, names: list[str], default: float) -> np.ndarray:
    """Return one value for each joint."""
    entries = np.atleast_1d(values)
    if entries.size == 0:
        return np.full(len(names), default)
    if entries.size == 1:
        return np.full(len(names), entries[0])
    if entries.size != len(names):
        raise InputError(
            f"elastic.{key}: {entries.size} values; allowed: one, or one for each of "
            f"{', '.join(names)}"
        )
    return entries
