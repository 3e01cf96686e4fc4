"""Reading of a robot's model file into a finalized plant, with warnings about the model."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Joint,
    JointActuator,
    PrismaticSpring,
    RevoluteSpring,
    UniformGravityFieldElement,
)

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.elastic_joints import (
    ElasticJoints,
    add_springs,
    make_elastic,
    set_joint_damping,
)
from pfsc_drake.robot.models.files import packages_for, read_with_inclusions
from pfsc_drake.robot.models.inspection import ModelFacts, inspect_model
from pfsc_drake.robot.models.joint_edits import (
    actuator_of,
    drivable_joints,
    force_elements,
    idealize_drives,
    inboard_joints,
    moving_joints,
    sprung_joints,
)
from pfsc_drake.robot.models.masses import require_inertia, require_regular_mass_matrix
from pfsc_drake.robot.models.mjcf_sites import add_sites
from pfsc_drake.robot.models.model_text import (
    DrakeMessages,
    collected_messages,
    one_line,
    usable_text,
)
from pfsc_drake.robot.models.model_xml import ModelXml, read_model_xml
from pfsc_drake.robot.models.placement import fix_joints, weld_base

_ROOTS = {".urdf": "robot", ".sdf": "sdf", ".xml": "mujoco"}
# in an MJCF model
_OF_NO_ACCOUNT = ("site", "light", "camera", "keyframe", "sensor", "visual", "statistic")
# Drake's messages when it replaces an inertia of the model
_REPLACED = ("While re-expressing as central inertia", "While parsing inertia", "invalid inertia")


@dataclass(frozen=True)
class ModelOptions:
    """Options for reading a model.

    Attributes:
        base: Frame of the model that is welded to the world; empty for the root link of a floating
            model, else for the model's own world frame.
        base_pose: Pose of that frame in the world.
        gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        fixed_joints: Joints that do not move, with their positions [rad or m].
        packages: Folders of packages, in addition to those found above the model and in
            ``ROS_PACKAGE_PATH``.
        elastic: Elasticity of the joints.
        joint_damping: ``K_d`` of the elastic joints, base first; empty for the model's.
        by_velocity: Whether velocity servos move the joints. Kinematics suffice then: effort
            limits of 0 in a URDF are ignored, and if one of its links moves without mass
            all masses and damping are ignored, see :func:`idealize_drives`.
    """

    base: str = ""
    base_pose: RigidTransform = field(default_factory=RigidTransform)
    gravity: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    fixed_joints: Mapping[str, float] = field(default_factory=dict)
    packages: Mapping[str, Path] = field(default_factory=dict)
    elastic: ElasticJoints = field(default_factory=ElasticJoints)
    joint_damping: list[float] = field(default_factory=list)
    by_velocity: bool = False

    @property
    def moves_joints(self) -> bool:
        """Whether joints of the model are fixed or moved."""
        placed = bool(self.base) or not self.base_pose.IsExactlyIdentity()
        return placed or bool(self.fixed_joints)


def read_model(
    plant: MultibodyPlant,
    file: Path,
    options: ModelOptions | None = None,
    before_finalizing: Callable[[MultibodyPlant], None] | None = None,
) -> list[str]:
    """Add a robot to an empty plant and finalize it.

    Joints without an actuator get one, up to the effort limit of a URDF. Geometry is read only if
    the plant is registered with a scene graph.

    Args:
        plant: An empty plant.
        file: The model, URDF, SDF or MJCF.
        options: Options for reading.
        before_finalizing: Function that adds further elements to the plant.

    Returns:
        Warnings about the model, one sentence each: Drake's own, and features of the model that are
        not simulated.

    Raises:
        InputError: If the model cannot be read, is not physical, or the options do not suit it.
            One line, which starts with the file, or with the name of the option.
    """
    options = options or ModelOptions()
    model = read_model_xml(file)
    _check_kind(model)
    packages = packages_for(file, model.content, options.packages)
    models = read_with_inclusions(file, packages)
    facts = inspect_model(models, frozenset(options.fixed_joints))
    options = replace(options, fixed_joints=facts.with_followers(options.fixed_joints))
    sprung = [name for name in options.fixed_joints if name in facts.springs]
    if sprung:
        raise InputError(f"fixed_joints: '{sprung[0]}' carries a spring; allowed: other joints")
    with collected_messages() as messages:
        massless = options.by_velocity and _moves_without_mass(model, options, facts, packages)
        _parse(plant, model, options, packages, without_masses=massless)
        _refuse_replaced_inertia(file, messages)
        with _name_file(file, "cannot be simulated"):
            add_sites(plant, models)
            _take_constraints(plant, file, facts)
            fix_joints(plant, options.fixed_joints)
            weld_base(plant, options.base, options.base_pose)
            if options.moves_joints or facts.drives:  # Drake reads no springs of MJCF
                springs = facts.springs.items()
                add_springs(plant, [(plant.GetJointByName(j), K_s) for j, K_s in springs])
            if not massless:
                require_inertia(plant, model, facts)
            _take_actuators(plant, facts)
            limits, weak = _drive_limits(plant, facts, options, massless=massless)
            driven = drive_joints(plant, drivable_joints(plant), file, limits)
            for drive in (d for d in driven if d.joint().name() in facts.drives):
                drive.set_default_rotor_inertia(facts.drives[drive.joint().name()].armature)
            unlimited = _release_velocities(plant)
            if massless:
                _require_no_dynamics(options)
                idealize_drives(plant)
            make_elastic(plant, options.elastic)
            set_joint_damping(plant, options.joint_damping)
            _require_rotors(plant, file)
            gravity = np.zeros(3) if massless else options.gravity
            plant.mutable_gravity_field().set_gravity_vector(gravity)
            if before_finalizing is not None:
                before_finalizing(plant)
            plant.Finalize()
            require_regular_mass_matrix(plant, file)
    rubbing = [name for name in facts.friction if name not in options.fixed_joints]
    # or irrelevant, since all followers are fixed
    covered = ["joint friction", "mimic", "equality"]
    if facts.drives:
        covered += ["actuatorfrcrange", "frictionloss", "child of 'actuator'", "'stiffness'"]
        covered += ["'springref'", *(f"'{tag}'" for tag in _OF_NO_ACCOUNT)]
    warnings = [m for m in messages.warnings if not any(text in m for text in covered)]
    if rubbing and not massless:
        warnings.append(
            f"{file}: dry friction in the model ({', '.join(rubbing)}) is not simulated; "
            "give it as friction of the joints"
        )
    if facts.assumed_inertia:
        named = ", ".join(facts.assumed_inertia)
        warnings.append(f"{file}: without <inertia> SDF takes 1 kg m^2 for moments of {named}")
    if facts.drives:
        known = [
            f"{name} {drive.effort_limit:g} ({drive.source})"
            for name, drive in facts.drives.items()
            if name not in options.fixed_joints
        ]
        warnings.append(f"{file}: torque limits [Nm or N]: {', '.join(known)}")
    if massless:
        warnings.append(
            f"{file}: links move without mass: kinematics alone are simulated, without torques, "
            "weight, damping and friction"
        )
    elif weak:
        named = ", ".join(weak)
        warnings.append(f"{file}: effort limits of 0 ({named}) are taken for none")
    if unlimited:
        named = ", ".join(unlimited)
        warnings.append(f"{file}: velocity limits of 0 ({named}) are taken for none")
    return warnings


def _check_kind(model: ModelXml) -> None:
    expected = _ROOTS.get(model.file.suffix.lower())
    if expected is None:
        raise InputError(
            f"{model.file}: cannot be read: '{model.file.suffix}'; allowed: {', '.join(_ROOTS)}"
        )
    if model.root.name != expected:
        raise InputError(
            f"{model.location(model.root)}: cannot be read: <{model.root.name}>; allowed in a "
            f"file *{model.file.suffix}: <{expected}>"
        )


@contextmanager
def _name_file(file: Path, trouble: str) -> Iterator[None]:
    """Re-raise Drake's exceptions with the name of the file; some of them would end the program."""
    try:
        yield
    except InputError:
        raise
    except (RuntimeError, ValueError, SystemExit) as error:
        raise InputError(f"{file}: {trouble}: {one_line(error)}") from None


def _parse(
    plant: MultibodyPlant,
    model: ModelXml,
    options: ModelOptions,
    packages: PackageMap,
    *,
    without_masses: bool = False,
) -> None:
    parser = Parser(plant)
    parser.package_map().AddMap(packages)
    edited = usable_text(model, without_springs=options.moves_joints, without_masses=without_masses)
    with _name_file(model.file, "cannot be read"):
        if edited is None:
            parser.AddModels(str(model.file))
        else:
            parser.AddModelsFromString(edited, model.file.suffix[1:].lower())


def _moves_without_mass(
    model: ModelXml, options: ModelOptions, facts: ModelFacts, packages: PackageMap
) -> bool:
    """Return whether a link of a URDF model moves without mass, with joints fixed and placed."""
    if model.root.name != "robot":
        return False
    plant = MultibodyPlant(0.0)
    _parse(plant, model, options, packages)
    with _name_file(model.file, "cannot be simulated"):
        fix_joints(plant, options.fixed_joints)
        weld_base(plant, options.base, options.base_pose)
    try:
        require_inertia(plant, model, facts)
    except InputError:
        return True
    return False


def _drive_limits(
    plant: MultibodyPlant, facts: ModelFacts, options: ModelOptions, *, massless: bool
) -> tuple[dict[str, float], list[str]]:
    """Return effort limits by joint, and the joints whose limits of 0 are ignored."""
    joints = [joint.name() for joint in drivable_joints(plant)]
    if massless:
        return dict.fromkeys(joints, np.inf), []
    limits = facts.effort_limits
    weak = [name for name in joints if options.by_velocity and limits.get(name) == 0.0]
    return {**limits, **dict.fromkeys(weak, np.inf)}, weak


def _require_no_dynamics(options: ModelOptions) -> None:
    for key, is_set in (
        ("elastic", options.elastic.is_given),
        ("joint_damping", bool(options.joint_damping)),
    ):
        if is_set:
            raise InputError(f"{key}: given; allowed: none where links move without mass")


def _refuse_replaced_inertia(file: Path, messages: DrakeMessages) -> None:
    replaced = [m for m in messages.warnings if any(text in m for text in _REPLACED)]
    for message in [*messages.errors, *replaced]:
        raise InputError(f"{file}: cannot be read: {message}")


def _take_constraints(plant: MultibodyPlant, file: Path, facts: ModelFacts) -> None:
    """Remove constraints of fixed joints; refuse other elements between bodies."""
    constraints = plant.GetConstraintIds()
    known = UniformGravityFieldElement, RevoluteSpring, PrismaticSpring
    others = [type(e).__name__ for e in force_elements(plant) if not isinstance(e, known)]
    if others or len(constraints) > len(facts.mimics):
        raise InputError(
            f"{file}: {', '.join(others) or 'constraints'} between bodies; allowed: an open chain "
            "of joints"
        )
    for constraint in constraints:
        plant.RemoveConstraint(constraint)


def _take_actuators(plant: MultibodyPlant, facts: ModelFacts) -> None:
    """Remove Drake's actuators of an MJCF model: limits of controls, and servos' own gains."""
    if facts.drives:
        for index in plant.GetJointActuatorIndices():
            plant.RemoveJointActuator(plant.get_joint_actuator(index))


def drive_joints(
    plant: MultibodyPlant, joints: Iterable[Joint], file: Path, effort_limits: Mapping[str, float]
) -> list[JointActuator]:
    """Add actuators to joints without, and return them.

    Args:
        plant: The plant, not finalized.
        joints: Joints of the plant, revolute or prismatic.
        file: The model that they are from.
        effort_limits: Effort limits by joint [Nm or N].

    Raises:
        InputError: If the effort limit of a joint is zero.
    """
    added = []
    for joint in joints:
        if actuator_of(plant, joint) is not None:
            continue
        # Drake drives every joint of an SDF model except those with an effort limit of 0
        is_sdf = file.suffix.lower() == ".sdf"
        effort_limit = effort_limits.get(joint.name(), 0.0 if is_sdf else np.inf)
        if effort_limit == 0.0:
            raise InputError(
                f"{file}: joint '{joint.name()}': has neither spring nor actuator (effort = 0); "
                "allowed: a positive effort limit"
            )
        added.append(plant.AddJointActuator(joint.name(), joint, effort_limit))
    return added


def _require_rotors(plant: MultibodyPlant, file: Path) -> None:
    """Refuse motors of elastic joints without inertia, which could not balance the spring."""
    inboard = inboard_joints(plant)
    for sprung in sprung_joints(plant):
        motor = inboard.get(sprung.parent_body().index())
        drive = None if motor is None else actuator_of(plant, motor)
        if drive is not None and not drive.default_reflected_inertia() > 0.0:
            raise InputError(
                f"{file}: joint '{drive.joint().name()}': rotor_inertia * gear_ratio^2 = "
                f"{drive.default_reflected_inertia():g}; allowed: a positive number in front of "
                "an elastic joint"
            )


def _release_velocities(plant: MultibodyPlant) -> list[str]:
    """Remove velocity limits of zero, which are unset; return the joints' names."""
    names = []
    for joint in moving_joints(plant):
        if np.any(joint.velocity_upper_limits() == 0.0):
            unlimited = np.full(joint.num_velocities(), np.inf)
            joint.set_velocity_limits(-unlimited, unlimited)
            names.append(joint.name())
    return names
