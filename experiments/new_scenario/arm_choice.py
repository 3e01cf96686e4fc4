"""Choice of the arm in a robot model: tool frame, fixed joints, law."""

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, RigidBody

from diagrams.robots.arm_model import ArmModel, read_arm
from diagrams.scenario import RobotParameters
from pfsc_drake.control.law.laws import LAWS
from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.robot.models.files import packages_for, read_with_inclusions, resolve_model
from pfsc_drake.robot.models.inspection import inspect_model
from pfsc_drake.robot.models.joint_edits import all_joints, inboard_joints, model_frames
from pfsc_drake.robot.models.model_xml import read_model_xml
from pfsc_drake.robot.models.reading import ModelOptions, read_model

# names of tool frames, the most telling first
_TOOL_NAMES = (
    r"tcp|tool_?point|tool_?cent(er|re)(_?point)?|grasp_?target",
    r"tool_?0|tool_?frame|tool",
    r"ee(_?link|_?frame)?|eef|end_?effector|tip",
    r"flange|attachment_?site",
    r"hand|gripper",
)
_LEAST_JOINTS = 3
_MOST_NAMED = 6

Ask = Callable[[str, Sequence[str]], str]


class ArmChoice:
    """The arm of a model that is to follow a path.

    Args:
        model: Name of a shipped model, or a URDF, SDF or MJCF file.
        tool_frame: Frame that follows the path; empty to choose it.
        law: Law of the controller; empty to choose it.
        ask: Returns one of several names, the first being the default.

    Attributes:
        tool_frame: Name of the frame.
        fixed_joints: Joints that are no axis of the arm, and their positions [rad or m].
        law: Law of the controller.
        arm: The arm.
        reasons: A phrase on each choice, by ``tool_frame``, ``fixed_joints`` and ``law``.

    Raises:
        InputError: If the model cannot be read, has no such frame, or no arm.
    """

    def __init__(self, model: str, tool_frame: str, law: str, ask: Ask) -> None:
        if law and law not in LAWS:
            raise InputError(f"--law {law}: allowed: {', '.join(LAWS)}{suggestion(law, LAWS)}")
        self.model, self.reasons = model, dict[str, str]()
        plant = self._every_joint()
        self.tool_frame = tool_frame or self._choose_frame(plant, ask)
        self.fixed_joints = self._other_joints(plant)
        self.law, self.arm = self._choose_law(law)

    def _every_joint(self) -> MultibodyPlant:
        """Return the model with all joints that it can move; its masses do not matter."""
        file = resolve_model(self.model)
        packages = packages_for(file, read_model_xml(file).content, {})
        facts = inspect_model(read_with_inclusions(file, packages))
        leaders = sorted({m.leader for m in facts.mimics.values()} - facts.mimics.keys())
        free = (-math.inf, math.inf)
        self._leaders = {
            name: _nearest_to_zero(*facts.position_limits.get(name, free)) for name in leaders
        }
        plant = MultibodyPlant(0.0)
        read_model(plant, file, ModelOptions(fixed_joints=self._leaders, by_velocity=True))
        return plant

    def _choose_frame(self, plant: MultibodyPlant, ask: Ask) -> str:
        """Return the frame that a user most probably means."""
        joints = {frame.name(): len(_joints_to(plant, frame.body())) for frame in _frames(plant)}
        longest = max(joints.values(), default=0)
        if longest < _LEAST_JOINTS:
            raise InputError(
                f"{self.model}: no frame behind {_LEAST_JOINTS} moving joints or more; allowed: "
                "the model of an arm"
            )
        for pattern in _TOOL_NAMES:
            named = [name for name in joints if re.search(rf"(^|_)({pattern})($|_)", name, re.I)]
            named = [name for name in named if joints[name] >= _LEAST_JOINTS]
            if named:
                named.sort(key=lambda name: (-joints[name], len(name)))
                chosen = named[0] if len(named) == 1 else ask("tool frame", named[:_MOST_NAMED])
                others = [name for name in named if name != chosen][:_MOST_NAMED]
                self.reasons["tool_frame"] = "by its name" + (
                    f"; also possible: {', '.join(others)}" if others else ""
                )
                return chosen
        *_, last = (name for name, count in joints.items() if count == longest)
        self.reasons["tool_frame"] = f"the last frame behind all {longest} joints"
        return last

    def _other_joints(self, plant: MultibodyPlant) -> dict[str, float]:
        """Return the joints that do not move the tool, where they come nearest to zero."""
        try:
            bodies = {frame.name(): frame.body() for frame in _frames(plant)}
            arm = {joint.index() for joint in _joints_to(plant, bodies[self.tool_frame])}
        except KeyError:
            return {}  # reading the arm says which frames there are
        positions = dict(self._leaders)
        for joint in all_joints(plant):
            if joint.num_velocities() == 1 and joint.index() not in arm:
                lower, upper = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
                positions[joint.name()] = _nearest_to_zero(lower, upper)
        if positions:
            self.reasons["fixed_joints"] = f"they do not move '{self.tool_frame}'"
        return positions

    def parameters(self) -> RobotParameters:
        """Return the robot as a scenario has it, with the model's path as it was given."""
        return RobotParameters(
            model=self.model, tool_frame=self.tool_frame, fixed_joints=self.fixed_joints
        )

    def _choose_law(self, law: str) -> tuple[str, ArmModel]:
        """Return the most capable law for which the model has the data, and the arm."""
        if law:
            arm = read_arm(self.parameters(), Path(), by_velocity=law == "velocity_servo")
            return law, arm
        try:
            arm = read_arm(self.parameters(), Path())
        except InputError as error:
            arm = read_arm(self.parameters(), Path(), by_velocity=True)
            self.reasons["law"] = f"kinematics suffice for it; for torques {error}"
            return "velocity_servo", arm
        elastic = arm.chain.elastic_joints
        if elastic.all():
            self.reasons["law"] = "the model has masses, and a spring in each joint"
            return "elastic", arm
        self.reasons["law"] = "the model has masses" + (
            f", and springs in {int(elastic.sum())} of {elastic.size} joints" * bool(elastic.any())
        )
        return "rigid", arm


def _nearest_to_zero(lower: float, upper: float) -> float:
    return float(min(max(0.0, lower), upper))


def _frames(plant: MultibodyPlant) -> list[Frame]:
    """Return the frames of a model that may be meant as the tool's, not those of Drake's welds."""
    return [frame for frame in model_frames(plant) if "_welds_to_" not in frame.name()]


def _joints_to(plant: MultibodyPlant, body: RigidBody) -> list[Joint]:
    """Return the moving joints from the world to a body."""
    inboard, joints = inboard_joints(plant), []
    while body.index() in inboard:
        joint = inboard[body.index()]
        joints += [joint] if joint.num_velocities() else []
        body = joint.parent_body()
    return joints
