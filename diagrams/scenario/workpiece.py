"""The workpiece whose surface a tool presses on."""

import dataclasses as dc

from diagrams.scenario.ball import LARGEST, SMALLEST, SoftBall, require_contact_step
from diagrams.scenario.checks import require, require_between, require_numbers

_LARGEST_TURN = 45.0  # deg


@dc.dataclass
class WorkpieceParameters:
    """A rigid workpiece under the scenario's surface, and the soft ball on the tool.

    The surface was taught with the tool point, where the ball is nearest to the workpiece, on it;
    the material is on the side that the normal points away from.

    Attributes:
        ball: The ball, whose centre is its radius behind the tool point.
        shift: Of the workpiece since it was taught [m], world axes.
        turn_zyx_deg: How it turned about the middle of the surface since then [deg].
        spacing: Between the vertices of its mesh [m].
        time_step: Of the plant, a whole fraction of the controller's sampling time [s].
    """

    ball: SoftBall = dc.field(default_factory=SoftBall)
    shift: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    turn_zyx_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    spacing: float = 4e-3
    time_step: float = 5e-4

    def __post_init__(self) -> None:
        for key in ("shift", "turn_zyx_deg"):
            require_numbers(key, getattr(self, key), 3)
        near = max(map(abs, self.shift)) <= LARGEST
        require(near, "shift", self.shift, f"3 numbers of at most {LARGEST:g} m")
        small = max(map(abs, self.turn_zyx_deg)) <= _LARGEST_TURN
        allowed = f"3 numbers of at most {_LARGEST_TURN:g} deg"
        require(small, "turn_zyx_deg", self.turn_zyx_deg, allowed)
        require_between("spacing", self.spacing, SMALLEST, LARGEST, "m, a positive number")
        require_contact_step(self.time_step)
