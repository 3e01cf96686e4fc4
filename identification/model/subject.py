"""The robot under test.

Rounded angles of a model file, such as 1.5708 for a right angle, are detected: axes that are
parallel or perpendicular up to 4e-6 rad have another set of base parameters than those of the
robot. Gravity then acts about a vertical axis, and additional parameters become visible at 4e-6 of
the effect of others; their estimates are noise of any size.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Frame

from diagrams.robots.model import is_delta, load_delta_robot, locate_model, read_robot, tool_frame
from diagrams.scenario import RobotParameters as RobotBlock
from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.models.robot_parameters import ArmParameters, BodyParameters, load_parameters
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.robot.serial.rotor_coupling import RotorMount, mounts_from_parameters
from pfsc_drake.yaml.reading import read_yaml
from pfsc_drake.yaml.typed import load_typed

# angles of a robot's design are multiples of this
STEP_DEG = 15.0
# largest deviation of a rounded angle from such a multiple [rad]
TOLERANCE = 1e-4
# deviation of a rotation matrix that is no rounding of an angle
_EXACT = 1e-12


def with_round_angles(chain: SerialChain) -> tuple[SerialChain, str]:
    """Return a chain with joints turned by multiples of 15 degrees where they nearly are.

    Roll, pitch and yaw of a joint's frame in the previous one are rounded separately.

    Args:
        chain: Chain of the model file.

    Returns:
        The chain, and its changes in one line; empty if there are none.
    """
    links, changed, most = [], [], 0.0
    for link in chain.links:
        rounded = round_rotation(link.R_PF)
        off = float(np.abs(rounded - link.R_PF).max())
        if off > _EXACT:
            changed.append(link.name)
            most = max(most, off)
            link = replace(link, R_PF=rounded)
        links.append(link)
    if not changed:
        return chain, ""
    note = (
        f"the model's angles at {', '.join(changed)} are up to {most:.2g} rad off multiples of "
        f"{STEP_DEG:g} deg; treated as rounded, and corrected"
    )
    return replace(chain, links=tuple(links)), note


def round_rotation(R: np.ndarray) -> np.ndarray:
    """Return a rotation whose roll, pitch and yaw are rounded to multiples of 15 degrees if close.

    Args:
        R: Shape (3, 3).
    """
    angles = RollPitchYaw(RotationMatrix(R)).vector()
    step = np.deg2rad(STEP_DEG)
    nearest = step * np.round(angles / step)
    near = np.abs(angles - nearest) <= TOLERANCE
    if not near.any():
        return R
    rounded = RollPitchYaw(np.where(near, nearest, angles)).ToRotationMatrix().matrix()
    # sines and cosines of right angles are zero and one
    rounded = np.where(np.abs(rounded - np.round(rounded)) < _EXACT, np.round(rounded), rounded)
    return rounded if np.abs(rounded - R).max() <= 3.0 * TOLERANCE else R


_YAML = (".yaml", ".yml")


@dataclass(frozen=True, eq=False)
class Subject:
    """A robot with N joints whose parameters are identified.

    Exactly one of ``chain`` and ``delta`` is not None.

    Attributes:
        name: Name of the robot.
        chain: A serial robot.
        delta: A DELTA robot.
        mounts: Mounts of the N rotors of a serial robot; None if unknown.
        gear_ratio: Turns of the rotors per turn of the joints (rad per m for slides), shape (N,);
            1 if unknown.
        position_limits: Lower and upper limits [rad or m], shape (N, 2); infinite if unknown.
        velocity_limit: Largest velocities [rad/s or m/s], shape (N,); infinite if unknown.
        acceleration_limit: Largest accelerations [rad/s^2 or m/s^2], shape (N,); infinite if
            unknown.
        effort_limit: Largest torques of the drives at the joint side [Nm or N], shape (N,);
            infinite if unknown.
        joint_names: Names as in the model.
        joint_units: ``rad`` or ``m`` of each.
        coulomb: Simulated Coulomb friction [Nm or N], shape (N,); None if unknown.
        viscous: Simulated viscous friction [Nm s/rad or N s/m], shape (N,); None if unknown.
        parameters: Parameter file of a serial robot's model; None if unknown.
        block: Model of a serial robot, as in scenarios; None for others.
        folder: Base folder of relative file names in ``block``.
        tool: Whether the tool of the parameter file belongs to the last link.
        note: Corrections of the model file, one line; empty if there are none.
    """

    name: str
    chain: SerialChain | None
    delta: DeltaRobot | None
    mounts: list[RotorMount] | None
    gear_ratio: np.ndarray
    position_limits: np.ndarray
    velocity_limit: np.ndarray
    acceleration_limit: np.ndarray
    effort_limit: np.ndarray
    joint_names: list[str]
    joint_units: list[str]
    coulomb: np.ndarray | None
    viscous: np.ndarray | None
    parameters: ArmParameters | None = None
    block: RobotBlock | None = None
    folder: Path = Path()
    tool: bool = False
    note: str = ""

    @property
    def robot(self) -> RobotModel:
        """The robot model, of either kind."""
        robot = self.delta if self.chain is None else self.chain
        assert robot is not None
        return robot

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.robot.dimension

    @property
    def family(self) -> str:
        """Name under which data of the robot are shipped, for all of its models."""
        return self.name if self.parameters is None else self.parameters.name


def load_subject(robot: str | Path, tool: bool = False) -> Subject:
    """Return the robot of a name or a file.

    Args:
        robot: Name of a shipped model (``comau_racer_1_4``, ``festo_expt_45``,
            ``franka_emika_panda``), an SDF, URDF or MJCF file, the parameter file of a DELTA robot,
                or a scenario, whose ``robot:`` block is used. From a bare model file all links up
                to the frame ``tool_point`` are used, or up to the last body without such a frame.
        tool: Whether the tool in the robot's parameter file stays on the last link. It is not part
            of the robot of Tab. C.3. Robots without such a file keep their tools.

    Raises:
        InputError: If there is no such robot, its model cannot be read, or is no chain of joints.
    """
    path, folder = Path(robot), Path()
    if path.suffix.lower() in _YAML:
        block, folder = _robot_block(path), path.parent
        name = path.stem
    else:
        block = RobotBlock(model=str(robot))
        name = path.stem if path.suffix else str(robot)
    if is_delta(block.model):
        return _delta_subject(name, load_delta_robot(block.model, folder))
    return _serial_subject(name, block, folder, tool)


def _robot_block(path: Path) -> RobotBlock:
    data = read_yaml(path)
    if "geometry" in data and "masses" in data:
        return RobotBlock(model=str(path.absolute()))
    if not isinstance(data.get("robot"), dict):
        raise InputError(
            f"{path}: no block 'robot'; allowed: a scenario with one, which names the model, or "
            "the parameters of a DELTA robot"
        )
    return load_typed(RobotBlock, data["robot"], str(path))


def _delta_subject(name: str, robot: DeltaRobot) -> Subject:
    n, friction = robot.dimension, robot.parameters.friction
    return Subject(
        name=name,
        chain=None,
        delta=robot,
        mounts=None,
        gear_ratio=np.ones(n),
        position_limits=robot.gather("position_limits"),
        velocity_limit=robot.gather("velocity_limit"),
        acceleration_limit=np.full(n, np.inf),
        effort_limit=robot.gather("effort_limit"),
        joint_names=list(robot.names),
        joint_units=["m"] * n,
        coulomb=friction.coulomb.copy(),
        viscous=friction.viscous.copy(),
    )


def _serial_subject(name: str, block: RobotBlock, folder: Path, tool: bool) -> Subject:
    plant, _ = read_robot(block, folder)
    from_file, _ = chain_from_plant(plant, tool_frame_of(plant, block))
    chain, changed = with_round_angles(from_file)
    parameters = _parameter_file(locate_model(block, folder))
    if parameters is not None and not tool:
        chain = without_tool(chain, parameters)
    n, friction = chain.dimension, None if parameters is None else parameters.friction
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    gears = {drive.joint().name(): drive.default_gear_ratio() for drive in actuators}
    joints = [plant.GetJointByName(joint) for joint in chain.names]
    return Subject(
        name=name,
        chain=chain,
        delta=None,
        mounts=_mounts(chain, parameters),
        gear_ratio=np.array([gears.get(joint, 1.0) for joint in chain.names]),
        position_limits=chain.gather("position_limits"),
        velocity_limit=chain.gather("velocity_limit"),
        acceleration_limit=np.array([joint.acceleration_upper_limits()[0] for joint in joints]),
        effort_limit=chain.gather("effort_limit"),
        joint_names=list(chain.names),
        joint_units=["rad" if link.is_revolute else "m" for link in chain.links],
        coulomb=None if friction is None else friction.coulomb[:n].copy(),
        viscous=None if friction is None else friction.viscous[:n] + chain.viscous_damping,
        parameters=parameters,
        block=block,
        folder=folder,
        tool=tool,
        note=f"{name}: {changed}" if changed else "",
    )


def tool_frame_of(plant: MultibodyPlant, block: RobotBlock) -> Frame:
    """Return the frame that a block names, or the frame of the last body.

    Args:
        plant: Plant with the robot.
        block: Block of the robot.
    """
    if block.tool_frame == RobotBlock().tool_frame and not plant.HasFrameNamed(block.tool_frame):
        return plant.get_body(BodyIndex(plant.num_bodies() - 1)).body_frame()
    return tool_frame(plant, block)


def _parameter_file(model: Path) -> ArmParameters | None:
    """Return the parameters of a model from the file beside it."""
    file = model.with_name("parameters.yaml")
    if model.suffix.lower() != ".sdf" or not file.is_file():
        return None
    parameters = load_parameters(file)
    written = [parameters.name, *(variant.name for variant in parameters.variants)]
    return parameters if model.stem in written else None


def _mounts(chain: SerialChain, parameters: ArmParameters | None) -> list[RotorMount] | None:
    if parameters is None or not parameters.rotors.fixed_to_link:
        return None
    # the pose of the base belongs to the scenario and has no effect on rotors
    upright = (replace(chain.links[0], R_PF=np.eye(3)), *chain.links[1:])
    return mounts_from_parameters(replace(chain, links=upright), parameters)


def without_tool(chain: SerialChain, parameters: ArmParameters) -> SerialChain:
    """Return a chain without the tool on its last link.

    Args:
        chain: The robot with the tool; its tool point is the one in the parameters.
        parameters: Parameters of the robot and its tool.
    """
    tool = parameters.tool
    p_LB = chain.p_LT - chain.R_LT @ tool.tool_point
    last_link = _remove_body(chain.links[-1], tool, chain.R_LT, p_LB)
    return replace(chain, links=(*chain.links[:-1], last_link))


def _remove_body(
    link: ChainLink, body: BodyParameters, R_LB: np.ndarray, p: np.ndarray
) -> ChainLink:
    """Return a link without one of its bodies, whose frame is at R_LB, p."""
    p_LC = p + R_LB @ body.center_of_mass
    I_C = R_LB @ body.inertia_matrix() @ R_LB.T
    other = replace(link, mass=body.mass, p_LC=p_LC, I_C=I_C)
    # moments of mass of order 0, 1, 2 about the link's origin are additive
    mass = link.mass - body.mass
    center = (link.mass * link.p_LC - body.mass * p_LC) / mass
    about_origin = link.inertia_about_origin - other.inertia_about_origin
    point = replace(link, mass=mass, p_LC=center, I_C=np.zeros((3, 3)))
    return replace(point, I_C=about_origin - point.inertia_about_origin)
