"""What the scenario of a DELTA robot says beyond that of a serial arm."""

import dataclasses as dc

from diagrams.scenario.checks import require
from diagrams.scenario.notch import NotchParameters
from diagrams.scenario.robot import RobotParameters
from diagrams.scenario.schema import PathFollowingScenario


@dc.dataclass
class DeltaFollowingScenario(PathFollowingScenario):
    """A path following run of a DELTA robot.

    ``robot.model`` is a shipped DELTA robot or a YAML file of parameters. The end-effector only
    translates, so that ``robot.tool_frame`` has no meaning; one pose of the slides belongs to each
    position, so that no posture has to be given.

    Attributes:
        drive_friction: Whether the linear drives have the friction of the robot's parameters.
        notch: Workpiece that a ball on the end-effector runs in; it starts in the middle of the
            notch, ``start.offset`` beside. None for a robot that touches nothing.
    """

    drive_friction: bool = True
    notch: NotchParameters | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        posture, turned = self.start.posture_deg, self.start.rotation_deg
        require(not posture, "start.posture_deg", posture, "none; a position decides the slides'")
        require(not any(turned), "start.rotation_deg", turned, "zeros; the robot only translates")
        keyframes = self.path.orientation.keyframes
        allowed = "none; the robot only translates"
        require(not keyframes, "path.orientation.keyframes", len(keyframes), allowed)
        require(self.hand is None, "hand", "a block", "none for a DELTA robot")
        force = self.hold_back.force
        require(force == 0.0, "hold_back.force", force, "0 for a DELTA robot")
        require(not self.friction.is_given, "friction", "a block", "drive_friction here")
        for key, none in dc.asdict(RobotParameters()).items():
            value = dc.asdict(self.robot)[key]
            given = key not in ("model", "tool_frame") and value != none
            require(not given, f"robot.{key}", value, "none for a DELTA robot")
        measured = self.compliance.is_given or self.controller.external_torque.source == "measured"
        allowed = "only with a notch, nothing else touches a DELTA robot"
        require(self.notch is not None or not measured, "compliance", "a block", allowed)
