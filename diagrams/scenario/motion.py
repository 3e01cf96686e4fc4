"""Start and reference motion of a scenario."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.checks import LARGEST_ANGLE, require
from pfsc_drake.control.law.swing import Swing
from pfsc_drake.controller.options.motion_limits import ACCELERATION, VELOCITY, MotionLimits
from pfsc_drake.yaml.fields import NUMBERS_OR_END, ONE_FOR_ALL, equal
from pfsc_drake.yaml.rules import Count, Numbers, Parameters, Range

_FARTHEST = 1e6  # m, many revolutions of a closed path
_SEVERAL = Count(2, words="two or more finite numbers")
_TRANSITIONS = (1e-3, 1e3)  # s


_Points = Annotated[list[float], Numbers(each=Range(-_FARTHEST, _FARTHEST, "m")), _SEVERAL]
_Pair = Annotated[list[float], Numbers(2, Range(-_FARTHEST, _FARTHEST, "m"))]


@dc.dataclass
class SecondReference(Parameters):
    """Motion along the second tangential coordinate of a surface, with its own speed.

    Attributes:
        points: Coordinates to visit [m], at most 1e6; the first is the start.
        velocity: Largest velocity [m/s].
        acceleration: Largest acceleration [m/s^2].
    """

    points: _Points = dc.field(default_factory=lambda: [0.0, 0.1])
    velocity: Annotated[float, VELOCITY] = 0.1
    acceleration: Annotated[float, ACCELERATION] = 1.0


@dc.dataclass
class ReferenceParameters(MotionLimits):
    """Motion along the path, or along a surface, resting at every point.

    Attributes:
        points: Arc lengths to visit [m], at most 1e6; the first is the start. Of a path ``end``
            stands for its length, so that ``[0, end]`` is the whole path, and ``[0, end, 0]`` there
            and back; on a closed one ``end`` is the start again.
        places: Points of a surface, instead: pairs of tangential coordinates to visit [m], along
            straight lines of these coordinates.
        second: Motion of the second coordinate of a surface, where ``points`` are those of the
            first.
        velocity: Largest velocity, 1e-6 to 1e3 [m/s]; null for 0.1, and with ``speed: fastest`` for
            any.
        acceleration: Largest acceleration, 1e-6 to 1e6 [m/s^2]; with ``speed: fastest`` the drives
            limit it.
        dwell: Rest before, between and after the moves, 0 or 1e-6 to 1e6 [s].
        swings: Oscillation of the path or surface itself along its normals (5.1), (5.2).
        limits: ``respect``: a reference that exceeds the limits of the drives, by the nominal
            model, is slowed; ``warn``: there is only a warning.
        reserve: Share of the drives' torques, and of the speeds of velocity servos, that the
            reference leaves, from 0 to below 1.
        speed: ``asked``: the requested velocity and acceleration; ``fastest``: the shortest time
            within the limits of the drives, by the nominal model, less the reserve.
        torque_rate: With ``speed: fastest`` the largest rate of the drives' torques [Nm/s]; for
            strong drives ten times their largest torque per second; ``.inf`` for any.
    """

    points: Annotated[list[Annotated[float, Range(-_FARTHEST, _FARTHEST, "m")] | str], _SEVERAL] = (
        dc.field(default_factory=lambda: [0.0, 0.1], metadata=NUMBERS_OR_END)
    )
    swings: list[Swing] = dc.field(default_factory=list)
    places: Annotated[list[_Pair], Count(2, empty=True, words="two or more pairs, or none")] = (
        dc.field(default_factory=list)
    )
    second: SecondReference | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        one = not (self.places and self.second)
        require(one, "second", "given", "null where places are given")
        if self.speed == "fastest":
            self._check_fastest()

    def _check_fastest(self) -> None:
        """Refuse motions for which no fastest one is computed."""
        allowed = "none with speed: fastest"
        require(self.second is None, "second", "given", f"{allowed}; write places")
        require(not self.swings, "swings", f"{len(self.swings)} given", allowed)

    def arc_lengths(self, length: float | None) -> list[float]:
        """Return the points [m].

        Args:
            length: Length for ``end`` [m]; None for a surface, which has no end.

        Raises:
            InputError: If there is an ``end`` without a length.
        """
        words = [point for point in self.points if isinstance(point, str)]
        allowed = "numbers; a surface has no end"
        require(not words or length is not None, "reference.points", self.points, allowed)
        return [length or 0.0 if isinstance(point, str) else point for point in self.points]


@dc.dataclass
class StartParameters(Parameters):
    """Start of the tool, at rest.

    Attributes:
        offset: Transversal coordinates [m] relative to the first point of the reference, one number
            for equal ones; of a surface the first is the distance along its normal.
        theta: Parameters of a surface at the start; empty for its middle.
        position: Position of the tool point on a surface, instead [m].
        rotation_deg: ZYX angles [deg] relative to the path's orientation.
        posture_deg: Joint angles [deg] near the start pose (m for prismatic joints), one number
            for all that are equal; they choose the branch of the inverse kinematics.
        transition: Time in which the reference moves from the tool to the path, so that a start
            off the path causes no jump of the drives, 0 or 1e-3 to 1e3 [s]; 0 for a reference on
            the path from the start.
    """

    offset: Annotated[list[float], Numbers(2)] = dc.field(
        default_factory=lambda: [0.0, 0.0], metadata=equal(2)
    )
    theta: Annotated[list[float], Numbers(2, empty=True)] = dc.field(default_factory=list)
    position: Annotated[list[float], Numbers(3, empty=True)] = dc.field(default_factory=list)
    rotation_deg: Annotated[
        list[float], Numbers(3, Range(-LARGEST_ANGLE, LARGEST_ANGLE, "deg"))
    ] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    posture_deg: Annotated[
        list[float], Numbers(each=Range(-LARGEST_ANGLE, LARGEST_ANGLE, "deg"))
    ] = dc.field(default_factory=list, metadata=ONE_FOR_ALL)
    transition: Annotated[float, Range(*_TRANSITIONS, "s", besides=0.0)] = 0.0
