"""From a robot's model file to a finalized plant, with what there is to say about the model."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    Joint,
    JointActuator,
    PrismaticSpring,
    RevoluteSpring,
    RigidBody,
    UniformGravityFieldElement,
    WeldJoint,
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
    inboard_joints,
    joints_of,
    moving_joints,
    sprung_joints,
    with_followers,
)
from pfsc_drake.robot.models.model_text import (
    DrakeMessages,
    collected_messages,
    one_line,
    usable_text,
)
from pfsc_drake.robot.models.model_xml import ModelXml, read_model_xml
from pfsc_drake.robot.models.placement import fix_joints, place_base

_ROOTS = {".urdf": "robot", ".sdf": "sdf", ".xml": "mujoco"}
# Drake says so when it takes another inertia than the model's
_REPLACED = ("While re-expressing as central inertia", "While parsing inertia", "invalid inertia")
# of a mass matrix scaled to ones on its diagonal; below, accelerations are rounding
_SMALLEST_EIGENVALUE = 1e-12


@dataclass(frozen=True)
class ModelOptions:
    """What is to be made of a model.

    Attributes:
        base: Frame of the model that is welded to the world; empty for the root link if the
            model leaves it floating, else for the model's own world frame.
        base_pose: Pose of that frame in the world.
        gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        fixed_joints: Joints that do not move, with their positions [rad or m].
        packages: Folders of packages, beside those found above the model and in
            ``ROS_PACKAGE_PATH``.
        elastic: What the joints become.
        joint_damping: ``K_d`` of the elastic joints, base first; empty for the model's.
    """

    base: str = ""
    base_pose: RigidTransform = field(default_factory=RigidTransform)
    gravity: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    fixed_joints: Mapping[str, float] = field(default_factory=dict)
    packages: Mapping[str, Path] = field(default_factory=dict)
    elastic: ElasticJoints = field(default_factory=ElasticJoints)
    joint_damping: list[float] = field(default_factory=list)

    @property
    def moves_joints(self) -> bool:
        """Whether joints of the model are fixed or stand elsewhere."""
        placed = bool(self.base) or not self.base_pose.IsExactlyIdentity()
        return placed or bool(self.fixed_joints)


def read_model(
    plant: MultibodyPlant,
    file: Path,
    options: ModelOptions | None = None,
    before_finalizing: Callable[[MultibodyPlant], None] | None = None,
) -> list[str]:
    """Add a robot to an empty plant and finalize it.

    Joints that the model does not drive are driven at their joint, up to the effort limit that a
    URDF gives. Geometry is read only if the plant is registered with a scene graph.

    Args:
        plant: An empty plant.
        file: The model, URDF, SDF or MJCF.
        options: What is to be made of it.
        before_finalizing: What else is to be added to the plant.

    Returns:
        What there is to say about the model, one sentence each: Drake's own warnings, and what
        of the model is not simulated.

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
    followers = with_followers(facts.mimics, options.fixed_joints, facts.still)
    options = replace(options, fixed_joints=followers)
    sprung = [name for name in options.fixed_joints if name in facts.springs]
    if sprung:
        raise InputError(f"fixed_joints: '{sprung[0]}' carries a spring; allowed: other joints")
    with collected_messages() as messages:
        parser = Parser(plant)
        parser.package_map().AddMap(packages)
        with _named(file, "cannot be read"):
            _parse(parser, model, without_springs=options.moves_joints)
        _refuse_replaced_inertia(file, messages)
        with _named(file, "cannot be simulated"):
            _take_constraints(plant, file, facts)
            fix_joints(plant, options.fixed_joints)
            place_base(plant, options.base, options.base_pose)
            if options.moves_joints:
                springs = facts.springs.items()
                add_springs(plant, [(plant.GetJointByName(j), K_s) for j, K_s in springs])
            _require_inertia(plant, model, facts)
            drive_joints(plant, drivable_joints(plant), file, facts.effort_limits)
            unlimited = _release_velocities(plant)
            make_elastic(plant, options.elastic)
            set_joint_damping(plant, options.joint_damping)
            _require_rotors(plant, file)
            plant.mutable_gravity_field().set_gravity_vector(options.gravity)
            if before_finalizing is not None:
                before_finalizing(plant)
            plant.Finalize()
            _require_regular_mass_matrix(plant, file)
    rubbing = [name for name in facts.friction if name not in options.fixed_joints]
    # or of no account, since all that follows others is fixed
    said_below = ("joint friction", "mimic", "equality")
    warnings = [m for m in messages.warnings if not any(text in m for text in said_below)]
    if rubbing:
        warnings.append(
            f"{file}: dry friction in the model ({', '.join(rubbing)}) is not simulated; "
            "give it as friction of the joints"
        )
    if facts.assumed_inertia:
        named = ", ".join(facts.assumed_inertia)
        warnings.append(f"{file}: without <inertia> SDF takes 1 kg m^2 for moments of {named}")
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
            f"{model.place(model.root)}: cannot be read: <{model.root.name}>; allowed in a "
            f"file *{model.file.suffix}: <{expected}>"
        )


@contextmanager
def _named(file: Path, trouble: str) -> Iterator[None]:
    """Let what Drake throws name the file; some of its checks end the program otherwise."""
    try:
        yield
    except InputError:
        raise
    except (RuntimeError, ValueError, SystemExit) as error:
        raise InputError(f"{file}: {trouble}: {one_line(error)}") from None


def _parse(parser: Parser, model: ModelXml, without_springs: bool) -> None:
    edited = usable_text(model, without_springs=without_springs)
    if edited is None:
        parser.AddModels(str(model.file))
    else:
        parser.AddModelsFromString(edited, model.file.suffix[1:].lower())


def _refuse_replaced_inertia(file: Path, messages: DrakeMessages) -> None:
    replaced = [m for m in messages.warnings if any(text in m for text in _REPLACED)]
    for message in [*messages.errors, *replaced]:
        raise InputError(f"{file}: cannot be read: {message}")


def _take_constraints(plant: MultibodyPlant, file: Path, facts: ModelFacts) -> None:
    """Take out what ties fixed joints to others; refuse what else acts between bodies."""
    constraints = plant.GetConstraintIds()
    known = UniformGravityFieldElement, RevoluteSpring, PrismaticSpring
    elements = (
        plant.get_force_element(ForceElementIndex(i)) for i in range(plant.num_force_elements())
    )
    others = [type(element).__name__ for element in elements if not isinstance(element, known)]
    if others or len(constraints) > len(facts.mimics):
        raise InputError(
            f"{file}: {', '.join(others) or 'constraints'} between bodies; allowed: an open chain "
            "of joints"
        )
    for constraint in constraints:
        plant.RemoveConstraint(constraint)


def _require_inertia(plant: MultibodyPlant, model: ModelXml, facts: ModelFacts) -> None:
    """Refuse what moves without mass, or with a mass that nobody wrote."""
    carriers = {joint.parent_body().index() for joint in moving_joints(plant)}
    for group in _moving_groups(plant):
        mass = sum(body.default_mass() for body in group)
        unsaid = [body.name() for body in group if body.name() in facts.without_inertia]
        # a body between two joints may be without mass if the model says so
        between = not unsaid and any(body.index() in carriers for body in group)
        if mass > 0.0 or between:
            if not (unsaid and model.root.name == "sdf"):
                continue
            hint = "; SDF takes 1 kg for it"
        else:
            hint = ""
        name = (unsaid or [group[0].name()])[0]
        place = facts.without_inertia.get(name, str(model.file))
        raise InputError(
            f"{place}: link '{name}': moves and has no {'<inertial>' if unsaid else 'mass'}{hint}; "
            "allowed: <inertial> with a positive mass, or a link fixed to one that has it"
        )


def _moving_groups(plant: MultibodyPlant) -> list[list[RigidBody]]:
    """Return what is welded together, for all that is not welded to the world, base first."""
    world = plant.world_body()
    group = {world.index(): [world]}
    for joint in joints_of(plant):
        carried = joint.child_body()
        welded = isinstance(joint, WeldJoint)
        group[carried.index()] = group[joint.parent_body().index()] if welded else []
        group[carried.index()].append(carried)
    groups = {id(bodies): bodies for bodies in group.values() if bodies[0] is not world}
    return list(groups.values())


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
        # Drake drives every joint of an SDF model but those with an effort limit of 0
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
    """Refuse motors of elastic joints without inertia; nothing would hold against the spring."""
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
    """Take velocity limits of zero, which nobody filled in, for none; return the joints' names."""
    names = []
    for joint in moving_joints(plant):
        if np.any(joint.velocity_upper_limits() == 0.0):
            unlimited = np.full(joint.num_velocities(), np.inf)
            joint.set_velocity_limits(-unlimited, unlimited)
            names.append(joint.name())
    return names


def _require_regular_mass_matrix(plant: MultibodyPlant, file: Path) -> None:
    """Refuse joints that move nothing that has inertia about them."""
    context = plant.CreateDefaultContext()
    if plant.num_velocities() == 0 or plant.num_positions() != plant.num_velocities():
        return
    plant.SetPositions(context, np.random.default_rng(0).uniform(0.1, 0.7, plant.num_positions()))
    mass_matrix = plant.CalcMassMatrix(context)
    scale = np.sqrt(np.maximum(np.diag(mass_matrix), 1e-300))
    eigenvalues, vectors = np.linalg.eigh(mass_matrix / np.outer(scale, scale))
    if eigenvalues[0] < _SMALLEST_EIGENVALUE or not np.isfinite(eigenvalues).all():
        worst = int(np.argmax(np.abs(vectors[:, 0])))
        name = plant.GetVelocityNames(add_model_instance_prefix=False)[worst].rsplit("_", 1)[0]
        raise InputError(
            f"{file}: joint '{name}': moves no inertia (singular mass matrix); allowed: links "
            "with mass, and moments of inertia about their joints"
        )
