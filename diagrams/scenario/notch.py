"""The workpiece with a notch that a ball on the tool runs in (Sec. 3.8.2)."""

import dataclasses as dc

from diagrams.scenario.ball import (
    LARGEST,
    SMALLEST,
    SoftBall,
    require_contact_step,
    require_up_to,
)
from diagrams.scenario.checks import require, require_between, require_numbers


@dc.dataclass
class BallParameters(SoftBall):
    """A ball with a soft shell on the tool.

    A DELTA robot holds it by a gripper; gripper, ball and force/torque sensor are the load of
    the robot's parameters.

    Attributes:
        distance: From the tool point down to the ball's centre [m]; 0 on robots that turn
            their tool.
    """

    distance: float = 0.12

    def __post_init__(self) -> None:
        super().__post_init__()
        require_up_to("distance", self.distance, LARGEST)


@dc.dataclass
class NotchParameters:
    """A rigid workpiece with a round-bottomed notch, and the ball that runs in it.

    The path is where the tool point is when the ball lies on the bottom of the notch of a
    workpiece that stands where it stood when the path was taught.

    Attributes:
        ball: The ball.
        displacement: Of the workpiece since then [m], world axes (z_0 down for DELTA robots).
        radius: Of the bottom [m], more than the ball's.
        depth: From the rim down to the bottom [m], not less than ``radius``.
        width: Of the workpiece across the notch [m].
        time_step: Of the plant, a whole fraction of the controller's sampling time [s].
    """

    ball: BallParameters = dc.field(default_factory=BallParameters)
    displacement: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    radius: float = 0.022
    depth: float = 0.025
    width: float = 0.07
    time_step: float = 5e-4

    def __post_init__(self) -> None:
        require_numbers("displacement", self.displacement, 3)
        near = max(map(abs, self.displacement)) <= LARGEST
        require(near, "displacement", self.displacement, f"3 numbers of at most {LARGEST:g} m")
        for key in ("radius", "depth", "width"):
            require_between(key, getattr(self, key), SMALLEST, LARGEST, "m, a positive number")
        require(self.radius > self.ball.radius, "radius", self.radius, "more than ball.radius")
        require(self.depth >= self.radius, "depth", self.depth, "radius or more")
        require(self.width > 2.0 * self.radius, "width", self.width, "more than twice the radius")
        require_contact_step(self.time_step)

    @property
    def clearance(self) -> float:
        """From the bottom up to where the ball touches nothing, the notch's axis [m]."""
        return self.radius - self.ball.radius
