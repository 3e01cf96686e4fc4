"""Extraction of a serial chain from a finalized MultibodyPlant."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Frame,
    Joint,
    JointActuator,
    JointIndex,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import Context

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.joint_edits import all_joints, force_elements
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink

# entries of rotations and axes below this are rounding of the model file's angles
_ROUNDING = 1e-12
# a rotor body between a motor joint and a flex joint carries no mass of its own
_ROTOR_MASS_LIMIT = 1e-3


@dataclass(frozen=True)
class PlantCoordinates:
    """Positions of a chain's coordinates in the plant's state ``x = [q, v]``.

    Attributes:
        num_states: Size of the plant's state.
        link_rows: Matrix with ``[q_J, v_J] = link_rows x``, shape (2N, num_states).
        motor_rows: Matrix with ``[q_M, v_M] = motor_rows x``, shape (2N, num_states);
            equal to ``link_rows`` for rigid joints.
        joints: Names of the joints that drives move, base first.
        inputs: Index of each joint's actuator in the plant's actuation; None without an actuator.
        others: Default state of all other coordinates of the plant, zero at the chain's own
            coordinates, shape (num_states,); 0 if there are none.
    """

    num_states: int
    link_rows: np.ndarray
    motor_rows: np.ndarray
    joints: tuple[str, ...]
    inputs: tuple[int | None, ...]
    others: np.ndarray | float = 0.0

    @property
    def undriven(self) -> list[str]:
        """Names of the joints without an actuator, base first."""
        return [joint for joint, i in zip(self.joints, self.inputs, strict=True) if i is None]

    @property
    def actuators(self) -> np.ndarray:
        """Index of each joint's actuator in the plant's actuation, shape (N,).

        Raises:
            InputError: If a joint has none.
        """
        if self.undriven:
            names = ", ".join(f"'{joint}'" for joint in self.undriven)
            raise InputError(
                f"plant: joints without actuator: {names}; add actuators "
                "before Finalize(): pfsc_drake.add_actuators(plant, model), or for each "
                "plant.AddJointActuator(name, joint, effort_limit)"
            )
        return np.array(self.inputs)

    def plant_state(self, joint_state: np.ndarray) -> np.ndarray:
        """Return the plant's state ``[q, v]``, all but the chain as by default.

        Args:
            joint_state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).

        Returns:
            The state, shape (num_states,).
        """
        return self._inverse @ joint_state + self.others

    @cached_property
    def rows(self) -> np.ndarray:
        """Matrix with ``[q_J, v_J, q_M, v_M] = rows x``, shape (4N, num_states)."""
        return np.vstack([self.link_rows, self.motor_rows])

    def actuation_rows(self, num_actuators: int) -> np.ndarray:
        """Return the matrix from drives to the plant's actuation, shape (num_actuators, N).

        Args:
            num_actuators: Number of actuators of the plant, which may have others, too.

        Raises:
            InputError: If a joint has no actuator.
        """
        rows = np.zeros((num_actuators, len(self.joints)))
        rows[self.actuators, np.arange(len(self.joints))] = 1.0
        return rows

    @cached_property
    def _inverse(self) -> np.ndarray:
        return np.linalg.pinv(self.rows)


def state_at_rest(chain: SerialChain, coordinates: PlantCoordinates, q_J: np.ndarray) -> np.ndarray:
    """Return the plant's state ``[q, v]`` at rest, elastic joints carrying the links' weight.

    Args:
        chain: The chain.
        coordinates: Its coordinates in the plant's state.
        q_J: Joint coordinates, shape (N,) [rad or m].
    """
    weight, rest = np.array(gravity_function(chain)(q_J)).ravel(), np.zeros(chain.dimension)
    return coordinates.plant_state(np.concatenate([q_J, rest, q_J + weight / chain.K_s, rest]))


def chain_from_plant(
    plant: MultibodyPlant, tool_frame: Frame
) -> tuple[SerialChain, PlantCoordinates]:
    """Extract the serial chain that carries a tool frame.

    Fixed joints are folded into the links. A motor joint followed by a flex joint
    (coaxial, with a joint spring, a body of negligible mass between them; see
    :class:`~pfsc_drake.robot.serial.chain.ChainLink`) becomes one elastic joint.

    Args:
        plant: A finalized plant; the base may be welded anywhere, gravity may
            point anywhere.
        tool_frame: Frame of the plant whose origin is the tool point.

    Returns:
        The chain, and its coordinates in the plant's state.

    Raises:
        InputError: If the plant is not finalized, or the tool is not at the end of
            an open chain of revolute and prismatic joints.
    """
    if not plant.is_finalized():
        raise InputError("plant: not finalized; call Finalize() before extracting a chain")
    context = plant.CreateDefaultContext()
    joints = _moving_joints_to(plant, tool_frame.body())
    if not joints:
        raise InputError(
            f"tool frame '{tool_frame.name()}': no moving joint between it and the world; "
            "a chain needs at least one revolute or prismatic joint"
        )
    _refuse_branches(plant, joints, tool_frame.name())
    springs = _joint_springs(plant, context)
    links: list[ChainLink] = []
    motors: list[Joint] = []
    flexes: list[Joint | None] = []
    parent: Frame = plant.world_frame()
    remaining = iter(joints)
    for joint in remaining:
        if joint.index() in springs:
            raise InputError(
                f"joint '{joint.name()}': has a spring but no coaxial motor joint with a rotor "
                f"of at most {_ROTOR_MASS_LIMIT} kg in front of it"
            )
        flex = None
        following = _next_joint(joints, joint)
        if following is not None and following.index() in springs:
            _check_elastic_pair(plant, context, joint, following)
            flex = next(remaining)
        next_motor = _next_motor(joints, flex or joint, springs)
        links.append(_link(plant, context, parent, joint, flex, next_motor, springs))
        motors.append(joint)
        flexes.append(flex)
        parent = (flex or joint).frame_on_child()
    X_LT = plant.CalcRelativeTransform(context, parent, tool_frame)
    gravity = plant.gravity_field().gravity_vector()
    chain = SerialChain(
        tuple(links), _clean(X_LT.rotation().matrix()), _clean(X_LT.translation()), gravity
    )
    return chain, _coordinates(plant, motors, flexes)


def _moving_joints_to(plant: MultibodyPlant, body: RigidBody) -> list[Joint]:
    """Return the moving joints from the world to a body, base first."""
    inboard = {
        joint.child_body().index(): joint
        for joint in all_joints(plant)
        if joint.num_velocities() > 0
    }
    path: list[Joint] = []
    while True:
        welded = plant.GetBodiesWeldedTo(body)
        if any(b.index() == plant.world_body().index() for b in welded):
            return path[::-1]
        carriers = [inboard[b.index()] for b in welded if b.index() in inboard]
        if len(carriers) != 1:
            names = ", ".join(f"'{j.name()}'" for j in carriers) or "none"
            raise InputError(
                f"body '{body.name()}': needs exactly one moving joint towards the world "
                f"whose child it is; found {names}"
            )
        joint = carriers[0]
        if not isinstance(joint, RevoluteJoint | PrismaticJoint):
            raise InputError(
                f"joint '{joint.name()}': type '{joint.type_name()}'; "
                "only revolute, prismatic and fixed joints are allowed"
            )
        path.append(joint)
        body = joint.parent_body()


def _refuse_branches(plant: MultibodyPlant, chain: list[Joint], tool: str) -> None:
    """Raise if something else moves on the chain's links; its dynamics would be missing."""
    own = {joint.index() for joint in chain}
    on_chain = {b.index() for joint in chain for b in plant.GetBodiesWeldedTo(joint.child_body())}
    for joint in all_joints(plant):
        if joint.num_velocities() == 0 or joint.index() in own:
            continue
        if {joint.parent_body().index(), joint.child_body().index()} & on_chain:
            raise InputError(
                f"joint '{joint.name()}': branches off the chain of the tool '{tool}'; "
                "list it in fixed_joints, name a tool frame behind it, or remove it from the model"
            )


def _joint_springs(plant: MultibodyPlant, context: Context) -> dict[JointIndex, float]:
    """Return the stiffness of every joint that carries a spring."""
    springs = {}
    for element in force_elements(plant):
        if isinstance(element, RevoluteSpring):
            rest, stiffness = element.GetNominalAngle(context), element.GetStiffness(context)
        elif isinstance(element, PrismaticSpring):
            rest, stiffness = element.nominal_position(), element.stiffness()
        else:
            continue
        joint = element.joint()
        if rest != 0.0:
            raise InputError(f"joint '{joint.name()}': spring rests at {rest}; must be 0")
        springs[joint.index()] = stiffness
    return springs


def _next_joint(joints: list[Joint], joint: Joint) -> Joint | None:
    position = joints.index(joint) + 1
    return joints[position] if position < len(joints) else None


def _next_motor(
    joints: list[Joint], joint: Joint, springs: dict[JointIndex, float]
) -> Joint | None:
    """Return the motor joint after a joint if it drives a sprung joint."""
    motor = _next_joint(joints, joint)
    flex = None if motor is None else _next_joint(joints, motor)
    return motor if flex is not None and flex.index() in springs else None


def _axis(joint: Joint) -> np.ndarray:
    revolute = isinstance(joint, RevoluteJoint)
    return joint.revolute_axis() if revolute else joint.translation_axis()


def _check_elastic_pair(plant: MultibodyPlant, context: Context, motor: Joint, flex: Joint) -> None:
    mass = sum(b.get_mass(context) for b in plant.GetBodiesWeldedTo(motor.child_body()))
    X_MF = plant.CalcRelativeTransform(context, motor.frame_on_child(), flex.frame_on_parent())
    off_axis = np.cross(X_MF.translation(), _axis(motor))
    aligned = np.allclose(X_MF.rotation().matrix(), np.eye(3), atol=1e-9)
    if (
        type(motor) is not type(flex)
        or not aligned
        or not np.allclose(_axis(motor), _axis(flex), atol=1e-9)
        or np.linalg.norm(off_axis) > 1e-9
        or mass > _ROTOR_MASS_LIMIT
    ):
        raise InputError(
            f"joints '{motor.name()}' and '{flex.name()}': a motor joint and the sprung joint "
            f"after it must be of one type, coaxial, of equal frames, with at most "
            f"{_ROTOR_MASS_LIMIT} kg between them (found {mass:g} kg)"
        )


def _link(
    plant: MultibodyPlant,
    context: Context,
    parent: Frame,
    motor: Joint,
    flex: Joint | None,
    next_motor: Joint | None,
    springs: dict[JointIndex, float],
) -> ChainLink:
    """Describe one joint, with all bodies welded to its child, in the joint's child frame.

    The body between the next motor joint and its flex joint belongs to this link too.
    """
    outer = flex or motor
    frame_L = outer.frame_on_child()
    X_PF = plant.CalcRelativeTransform(context, parent, motor.frame_on_parent())
    if flex is not None:
        offset = plant.CalcRelativeTransform(
            context, motor.frame_on_child(), flex.frame_on_parent()
        )
        X_PF = X_PF @ RigidTransform(offset.translation())
    M = SpatialInertia.Zero()
    bodies = plant.GetBodiesWeldedTo(outer.child_body())
    if next_motor is not None:
        bodies = [*bodies, *plant.GetBodiesWeldedTo(next_motor.child_body())]
    for body in bodies:
        M_B = body.CalcSpatialInertiaInBodyFrame(context)
        X_LB = plant.CalcRelativeTransform(context, frame_L, body.body_frame())
        M += M_B.ReExpress(X_LB.rotation()).Shift(-X_LB.translation())
    p_LC = M.get_com()
    I_C = M.Shift(p_LC).CalcRotationalInertia().CopyToFullMatrix3()
    drive = _actuator(plant, motor)
    limits = (float(motor.position_lower_limits()[0]), float(motor.position_upper_limits()[0]))
    return ChainLink(
        name=motor.name(),
        kind="revolute" if isinstance(motor, RevoluteJoint) else "prismatic",
        R_PF=_clean(X_PF.rotation().matrix()),
        p_PF=_clean(X_PF.translation()),
        axis=_clean(_axis(motor)),
        mass=M.get_mass(),
        p_LC=p_LC,
        I_C=I_C,
        reflected_inertia=0.0 if drive is None else drive.calc_reflected_inertia(context),
        stiffness=np.inf if flex is None else springs[flex.index()],
        damping=0.0 if flex is None else float(flex.default_damping_vector()[0]),
        viscous_damping=float(motor.default_damping_vector()[0]),
        effort_limit=np.inf if drive is None else drive.effort_limit(),
        position_limits=limits,
        velocity_limit=float(motor.velocity_upper_limits()[0]),
    )


def _actuator(plant: MultibodyPlant, joint: Joint) -> JointActuator | None:
    """Return the actuator of a joint, if it has one."""
    actuators = (plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices())
    found = [actuator for actuator in actuators if actuator.joint().index() == joint.index()]
    if len(found) > 1:
        names = ", ".join(f"'{actuator.name()}'" for actuator in found)
        raise InputError(f"joint '{joint.name()}': actuators {names}; allowed: one")
    return found[0] if found else None


def _coordinates(
    plant: MultibodyPlant, motors: list[Joint], flexes: list[Joint | None]
) -> PlantCoordinates:
    n, nq = len(motors), plant.num_positions()
    num_states = nq + plant.num_velocities()
    motor_rows = np.zeros((2 * n, num_states))
    flex_rows = np.zeros((2 * n, num_states))
    for i, (motor, flex) in enumerate(zip(motors, flexes, strict=True)):
        motor_rows[i, motor.position_start()] = 1.0
        motor_rows[n + i, nq + motor.velocity_start()] = 1.0
        if flex is not None:
            flex_rows[i, flex.position_start()] = 1.0
            flex_rows[n + i, nq + flex.velocity_start()] = 1.0
    others = plant.GetPositionsAndVelocities(plant.CreateDefaultContext())
    others[(motor_rows + flex_rows).any(axis=0)] = 0.0
    drives = [_actuator(plant, motor) for motor in motors]
    return PlantCoordinates(
        num_states,
        motor_rows + flex_rows,
        motor_rows,
        tuple(motor.name() for motor in motors),
        tuple(None if drive is None else drive.input_start() for drive in drives),
        others,
    )


def _clean(array: np.ndarray) -> np.ndarray:
    """Round entries next to -1, 0 and 1, so that their products vanish from the expressions."""
    nearest = np.round(array)
    return np.where(np.abs(array - nearest) < _ROUNDING, nearest, array)
