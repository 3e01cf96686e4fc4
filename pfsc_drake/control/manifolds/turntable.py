"""Workpiece on a turntable: stacked axes, and compensation of a frame's measurement delay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, frame_size, frame_vector
from pfsc_drake.jets import Jet


@dataclass(frozen=True)
class TurntableAxes:
    """Stacked revolute axes, and the workpiece on the last one.

    At angles zero the axes of all frames are parallel to the base's.

    Attributes:
        base: Pose of the table ``[p_WB, R_WB by rows]`` [m, 1], shape (12,).
        directions: Directions of the N axes in the base's axes at zero, unit vectors, shape (N, 3).
        points: A point of each, from the base at zero [m], shape (N, 3).
        workpiece: Its frame from the base at zero, ``[p_BC, R_BC by rows]``, shape (12,).
    """

    base: np.ndarray
    directions: np.ndarray
    points: np.ndarray
    workpiece: np.ndarray

    def frame(self, angles: Sequence[Jet]) -> tuple[Jet, Jet]:
        """Return ``p_WC`` and ``R_WC`` as jets of the order of the angles'.

        Each axis turns its load about its point a: ``x -> a + R(q) (x - a)``, with
        ``R(q) = 1 + sin q K + (1 - cos q) K^2`` and K the cross product by its direction.

        Args:
            angles: Angles of the axes, the first one at the base [rad].
        """
        order = angles[0].order
        p, R = _constants(self.workpiece, order)
        both = zip(angles, self.directions, self.points, strict=True)
        for angle, direction, point in reversed(list(both)):
            turn, a = _turn(angle, direction), ca.DM(point)
            p, R = turn @ (p - a) + a, turn @ R
        p_WB, R_WB = _constants(self.base, order)
        return R_WB @ p + p_WB, R_WB @ R


def _constants(pose: np.ndarray, order: int) -> tuple[Jet, Jet]:
    position, rotation = ca.DM(pose[:3]), ca.DM(pose[3:].reshape(3, 3))
    return jets.constant(position, order), jets.constant(rotation, order)


def _turn(angle: Jet, direction: np.ndarray) -> Jet:
    """Return the rotation about a direction by an angle as a matrix jet."""
    K = ca.skew(ca.DM(direction))
    sines, cosines = jets.sin_cos(angle)
    both = zip(sines.coefficients, cosines.coefficients, strict=True)
    rows = [s * K - c * (K @ K) for s, c in both]
    return Jet([rows[0] + ca.DM.eye(3) + K @ K, *rows[1:]])


@once_per_content()
def turntable_motion_function(axes: TurntableAxes, order: int) -> ca.Function:
    """Return a workpiece's motion as a function of the table's.

    Args:
        axes: The table.
        order: Highest derivative k.

    Returns:
        ``angles -> frame_jet``, derivatives by rows, shapes (N (k + 1),) and (12 (k + 1),).
    """
    n = len(axes.directions)
    angles = ca.SX.sym("angles", n * (order + 1))
    rows = ca.vertsplit(angles, n)
    q = [Jet.from_derivatives([row[i] for row in rows]) for i in range(n)]
    frame = ca.densify(frame_vector(*axes.frame(q)))
    return ca.Function("turntable_motion", [angles], ca.cse([frame]), ["angles"], ["frame_jet"])


class TurntableFrame(Block):
    """Motion of a turntable's workpiece: angles as measured, derivatives as commanded.

    Ports:
        measured (input): Angles of the axes [rad], shape (N,).
        planned (input): Derivatives 0..k of the commanded angles by rows, shape (N (k + 1),).
        frame_jet (output): Derivatives 0..k of ``[p_WC, R_WC by rows]``, see :func:`frame_jets`.

    Args:
        axes: The controller's model of the table.
        order: Highest derivative k, of which those above ``highest`` are taken to be zero.
        highest: Highest derivative that is evaluated.
    """

    def __init__(self, axes: TurntableAxes, order: int, highest: int) -> None:
        self._n, self._highest = len(axes.directions), min(highest, order)
        self._motion = turntable_motion_function(axes, self._highest)
        self._rest = POSE_SIZE * (order - self._highest)
        self.inputs = {
            "measured": Port(self._n, "rad"),
            "planned": Port(self._n * (order + 1), "rad, rad/s, ..", optional=self._highest == 0),
        }
        self.outputs = {"frame_jet": Port(frame_size(order), "m, 1, per s, ..")}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        angles = u.measured
        if self._highest:
            angles = ca.vertcat(angles, u.planned[self._n : self._n * (self._highest + 1)])
        return {"frame_jet": ca.vertcat(self._motion(angles), ca.DM.zeros(self._rest))}


class AdvancedFrame(Block):
    """Present motion of a frame, extrapolated from a delayed measurement.

    A message delayed by d has derivatives of d ago. Taylor's formula extrapolates them::

        f^(k)(t) = sum_j f^(k + j)(t - d) d^j / j!,   k + j <= r

    The pose is off by the derivative of order r + 1 times ``d^(r+1) / (r+1)!`` then.

    Ports:
        frame_jet (input): Delayed derivatives 0..r, see :func:`frame_jets`.
        advanced (output): Present derivatives.

    Args:
        order: Highest derivative r.
        delay: Delay d of the message [s].
    """

    def __init__(self, order: int, delay: float) -> None:
        self._order, self._delay = order, delay
        size = frame_size(order)
        self.inputs, self.outputs = {"frame_jet": Port(size)}, {"advanced": Port(size)}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        rows, d = ca.vertsplit(u.frame_jet, POSE_SIZE), self._delay
        advanced = [
            sum(row * (d**j / math.factorial(j)) for j, row in enumerate(rows[k:]))
            for k in range(self._order + 1)
        ]
        return {"advanced": ca.vertcat(*advanced)}
