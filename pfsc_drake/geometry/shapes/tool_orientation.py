"""Orientation of the tool along a path or a surface, in a scenario. Angles in degrees."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from pfsc_drake.checks import (
    LARGEST_ANGLE,
    require,
)
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve, interpolate_orientation
from pfsc_drake.geometry.rotation import (
    EULER_TO_QUATERNION,
    quaternion_to_matrix,
)
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import Direction, Numbers, OneOf, Parameters, Range

PATH_TASKS = ("full", "tool_axis", "yaw", "none")
_KINDS = ("none", "given", "normal")
_TASKS = ("full", "tool_axis", "yaw")
_CONVENTIONS = ("zyx", "zyz")
_JACOBIANS = ("geometric", "analytic")
_Angles = Annotated[list[float], Numbers(3, Range(-LARGEST_ANGLE, LARGEST_ANGLE, "deg"))]


@dc.dataclass
class Keyframe(Parameters):
    """Orientation of the tool at one point of the path.

    Attributes:
        theta: Path parameter, as a fraction of the path's domain (0..1).
        angles_deg: Euler angles [deg], in the order of the convention's name; at most 3600.
    """

    theta: Annotated[float, Range(0.0, 1.0, words="0 to 1, a fraction")] = 0.0
    angles_deg: _Angles = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))


@dc.dataclass
class OrientationParameters(Parameters):
    """Orientation along the path.

    Attributes:
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).
        keyframes: Orientations to interpolate; a single one is constant along the path; on a
            closed path the first is repeated at the end.
        task: Controlled part: ``full``, the whole orientation; ``tool_axis``, the
            direction of an axis of the tool, about which it may turn freely; ``yaw``, the
            turn about an axis in the world, with the tool's tilt uncontrolled (four outputs, as of
            an SCARA); ``none``.
        tool_axis: The axis, in the tool frame, of any length.
        yaw_axis: The axis of ``yaw``, in the world, of any length; by default the vertical.
        jacobian: Representation of orientation errors: ``geometric``, the ZYX angles of the
            turn from the reference to the tool; or, for comparison, ``analytic`` (2.16), the
            Euler angles of the tool in the world minus the reference's, of ``convention``,
            which share their singularities. Only for the task ``full``.
    """

    convention: Annotated[str, OneOf(_CONVENTIONS)] = "zyx"
    keyframes: list[Keyframe] = dc.field(default_factory=list)
    task: Annotated[str, OneOf(PATH_TASKS)] = "full"
    tool_axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    yaw_axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    jacobian: Annotated[str, OneOf(_JACOBIANS)] = "geometric"

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_jacobian(self.jacobian, "task", self.task)

    def along(self, position: Curve, smoothness: int) -> OrientationCurve | None:
        """Return the interpolated keyframes, or None if there are none.

        Args:
            position: The path's curve, over whose parameter they are interpolated.
            smoothness: k of the class C^k of the interpolation.

        Raises:
            InputError: If they do not extend from one end to the other.
        """
        if not self.keyframes:
            return None
        quaternions = _quaternions(self.convention, [k.angles_deg for k in self.keyframes])
        if len(self.keyframes) == 1:
            return OrientationCurve.fixed(quaternions[0], position.domain)
        begin, end = position.domain
        fractions = np.array([keyframe.theta for keyframe in self.keyframes])
        if position.closed:
            fractions = np.append(fractions, fractions[0] + 1.0)
            quaternions = np.vstack([quaternions, quaternions[:1]])
        span = fractions[-1] - fractions[0]
        if fractions[0] != 0.0 or not np.isclose(span, 1.0):
            raise InputError(
                f"path.orientation.keyframes: theta runs from {fractions[0]:g} to "
                f"{fractions[-1]:g}; allowed: from 0 to 1 (on closed paths the first keyframe "
                "stands for 1 too)"
            )
        return interpolate_orientation(
            quaternions,
            begin + fractions * (end - begin),
            smoothness=smoothness,
            closed=position.closed,
        )


@dc.dataclass
class SurfaceOrientationParameters(Parameters):
    """Orientation of the tool along a surface.

    Attributes:
        kind: ``none``: position only; ``given``: the same everywhere; ``normal``: turning with the
            frame of first tangent, second and normal.
        convention: ``zyx`` (2.7) or ``zyz`` (2.6); of an ``analytic`` Jacobian too.
        angles_deg: Euler angles [deg]: of the orientation, or of its turn away from the frame.
        task: ``full``; ``tool_axis``, whose turn about itself is free; or ``yaw``, the turn about
            an axis in the world alone.
        tool_axis: Axis in the tool frame, of any length, for ``tool_axis``.
        yaw_axis: Axis in the world, of any length, for ``yaw``; by default the vertical.
        jacobian: ``geometric`` or ``analytic``, see ``path.orientation.jacobian``.
    """

    kind: Annotated[str, OneOf(_KINDS)] = "none"
    convention: Annotated[str, OneOf(_CONVENTIONS)] = "zyx"
    angles_deg: _Angles = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    task: Annotated[str, OneOf(_TASKS)] = "full"
    tool_axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    yaw_axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    jacobian: Annotated[str, OneOf(_JACOBIANS)] = "geometric"

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_jacobian(self.jacobian, "task", self.task)
        _require_jacobian(self.jacobian, "kind", "full" if self.kind != "none" else self.kind)

    @property
    def quaternion(self) -> np.ndarray | None:
        """Quaternion of an orientation that is the same everywhere, shape (4,), or None."""
        return self._turn if self.kind == "given" else None

    @property
    def offset(self) -> np.ndarray:
        """Rotation of the tool away from the surface's frame, shape (3, 3)."""
        return quaternion_to_matrix(self._turn)

    @property
    def _turn(self) -> np.ndarray:
        return _quaternions(self.convention, [self.angles_deg])[0]


def _quaternions(convention: str, angles_deg: Sequence[Sequence[float]]) -> np.ndarray:
    """Return the quaternions of Euler angles [deg], shape (n, 4)."""
    return EULER_TO_QUATERNION[convention](np.deg2rad(angles_deg))


def _require_jacobian(jacobian: str, key: str, value: str) -> None:
    """Refuse the analytic Jacobian for a part of the orientation.

    Args:
        jacobian: The scenario's value.
        key: Key of the controlled part of the orientation.
        value: Its value; ``full`` for all of it.
    """
    good = jacobian == "geometric" or value == "full"
    require(good, "jacobian", jacobian, f"geometric with {key}: {value}")
