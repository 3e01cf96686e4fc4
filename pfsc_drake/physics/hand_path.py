"""Target motion of an operator: positions and orientations with a rest in each."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.curves.piecewise_fit import fit_pieces
from pfsc_drake.physics.scripted_force import smooth_step, smooth_step_slope

# map of coordinates and their rates, shape (3,) each, to position and velocity in the world
CoordinateMap = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

_DEGREE = 7
_TOLERANCE = 1e-11  # m


class Legs:
    """Minimum-jerk motion between successive points, at rest in each.

    Args:
        times: Times at the ends of the legs, ascending, shape (k,) [s].
    """

    def __init__(self, times: np.ndarray) -> None:
        # the last leg, at rest, never ends
        self._begins = ca.MX(ca.DM(np.append(times, times[-1] + 1.0)))
        self._durations = ca.MX(ca.DM(np.append(np.diff(times), 1.0)))

    def at(self, time: Any) -> tuple[Any, Any, Any]:
        """Return the index of the leg at a time, its completed share, and its rate [1/s].

        Args:
            time: [s].
        """
        leg = ca.low(self._begins, time, {"lookup_mode": "binary"})
        duration = self._durations[leg]
        x = (time - self._begins[leg]) / duration
        return leg, smooth_step(x), smooth_step_slope(x) / duration


class HandPath:
    """Path of an operator's target in the world over time.

    Along a manifold it is a precomputed table of polynomials of the share of each leg.

    Args:
        times: Times of the waypoints, ascending, shape (k,) [s].
        positions: Positions of the waypoints, shape (k, 3).
        to_world: Map of positions to the world; None for world coordinates [m].
    """

    def __init__(
        self, times: np.ndarray, positions: np.ndarray, to_world: CoordinateMap | None = None
    ) -> None:
        self._legs, last = Legs(times), len(times) - 1
        strides = np.vstack([np.diff(positions, axis=0), np.zeros(3)])
        if to_world is None:
            breaks = np.arange(last + 2.0)
            table = np.stack(
                [np.hstack([positions, strides]), np.pad(strides, [(0, 0), (0, 3)])], axis=1
            )
        else:
            breaks, table = _fit_table(positions, strides, to_world)
        self._breaks = ca.MX(ca.DM(breaks))
        self._table = ca.MX(ca.DM(table.reshape(len(table), -1).T))

    def at(self, time: Any) -> tuple[Any, Any]:
        """Return position [m] and velocity [m/s], shape (3,) each.

        Args:
            time: [s].
        """
        leg, share, rate = self._legs.at(time)
        piece = ca.low(self._breaks, leg + share, {"lookup_mode": "binary"})
        # from the begin of the leg, without cancellation of the share
        u = share - (self._breaks[piece] - leg)
        rows = ca.horzsplit(ca.reshape(self._table[:, piece], 6, -1))
        values = rows[-1]
        for row in rows[-2::-1]:
            values = row + u * values
        return values[:3], rate * values[3:]


@once_per_content()
def _fit_table(
    positions: np.ndarray, strides: np.ndarray, to_world: CoordinateMap
) -> tuple[np.ndarray, np.ndarray]:
    """Return polynomials of position and slope over the index of the leg plus its share."""
    last = len(positions) - 1

    def along(number: float) -> np.ndarray:
        leg = int(number)
        share = number - leg
        return np.concatenate(to_world(positions[leg] + share * strides[leg], strides[leg]))

    breaks, table = np.zeros(1), np.zeros((0, _DEGREE + 1, 6))
    if last > 0:
        breaks, table = fit_pieces(
            lambda numbers: np.array([along(number) for number in numbers.tolist()]),
            np.arange(last + 1.0),
            degree=_DEGREE,
            tolerance=_TOLERANCE,
        )
    rest = np.zeros((1, _DEGREE + 1, 6))
    rest[0, 0] = along(float(last))
    return np.append(breaks, last + 1.0), np.concatenate([table, rest])


class OrientationTarget:
    """Orientation ``R_d`` that turns between successive ones about fixed axes by less than pi.

    It is at rest in each, as the target of the tool point is.

    Args:
        times: Times of the orientations, ascending, shape (k,) [s].
        zyx_deg: Their ZYX angles (2.7), shape (k, 3) [deg].
    """

    def __init__(self, times: np.ndarray, zyx_deg: np.ndarray) -> None:
        self._legs, R = Legs(times), zyx_to_matrix(np.deg2rad(zyx_deg))
        turns = np.zeros((len(R), 3))
        if len(R) > 1:
            turns[:-1] = Rotation.from_matrix(R[1:] @ np.swapaxes(R[:-1], 1, 2)).as_rotvec()
        angles = np.linalg.norm(turns, axis=1)
        axes = turns / np.maximum(angles, np.finfo(float).tiny)[:, None]
        self._table = ca.MX(ca.DM(np.vstack([R.reshape(-1, 9).T, axes.T, angles])))

    def at(self, time: Any) -> tuple[Any, Any]:
        """Return ``R_d``, shape (3, 3), and its angular velocity, world axes, (3,) [rad/s].

        Args:
            time: [s].
        """
        leg, share, rate = self._legs.at(time)
        row = self._table[:, leg]
        R, axis, angle = ca.reshape(row[:9], 3, 3).T, row[9:12], row[12]
        S, turned = ca.skew(axis), share * angle
        turn = ca.DM.eye(3) + ca.sin(turned) * S + 2.0 * ca.sin(turned / 2.0) ** 2 * (S @ S)
        return turn @ R, rate * angle * axis
