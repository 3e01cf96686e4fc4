"""What the scenario of a DELTA robot says beyond that of a serial arm."""

import dataclasses as dc

from diagrams.checks import require
from diagrams.scenario import EncoderOptions, PathFollowingScenario


@dc.dataclass
class DeltaFollowingScenario(PathFollowingScenario):
    """A path following run of a DELTA robot.

    ``robot.model`` is a shipped DELTA robot or a YAML file of parameters. The end-effector only
    translates, so that ``robot.tool_frame`` has no meaning; one pose of the slides belongs to each
    position, so that no posture has to be given.

    Attributes:
        drive_friction: Whether the linear drives have the friction of the robot's parameters.
    """

    drive_friction: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        posture, turned = self.start.posture_deg, self.start.rotation_deg
        require(not posture, "start.posture_deg", posture, "none; a position decides the slides'")
        require(not any(turned), "start.rotation_deg", turned, "zeros; the robot only translates")
        keyframes = self.path.orientation.keyframes
        allowed = "none; the robot only translates"
        require(not keyframes, "path.orientation.keyframes", len(keyframes), allowed)
        require(not self.forces, "forces", f"{len(self.forces)} pulses", "none for a DELTA robot")
        force = self.hold_back.force
        require(force == 0.0, "hold_back.force", force, "0 for a DELTA robot")
        require(not self.friction.is_given, "friction", "a block", "drive_friction here")
        exact = self.encoders == EncoderOptions()
        require(exact, "encoders", "a block", "none for a DELTA robot")
        require(not self.compliance.is_given, "compliance", "a block", "none for a DELTA robot")
