"""A measured wrench: bias, frozen components, loss of the sensor, compensation of a payload."""

from enum import IntEnum
from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, is_finite, where

# s, length of blocks whose means decide whether a sensor is quiet
TARING_BLOCK = 0.01


class Taring:
    """Taring: bias of a sensor as the mean of residuals over a quiet window.

    The window is quiet if means over blocks of samples hardly differ. Thus noise has no influence,
    nor has stick-slip motion of the drives: an arm with an unmodelled load creeps for seconds by
    single increments of its encoders, and the compensation of the tool's inertia causes a spike of
    one or two samples at each of them. Forces on the tool and its motion last longer than a block.
    The first block must agree with the others, but does not contribute to the bias, because
    transients, e.g. of the start, may still decay in it.

    The states of a window (:attr:`states`) are the number of its samples, their sum, the lowest and
    the highest mean of a block, and the sum of the incomplete block; all are zero for an empty
    window. Whenever the means differ too much, the window restarts with the last block.

    Args:
        samples: Number of samples in a window.
        largest_spread: Largest difference of means in it, shape (6,) [N, Nm].
        largest_bias: Largest plausible bias, shape (6,) [N, Nm].
        block: Number of samples in a block; a window consists of whole blocks.
    """

    states: ClassVar = MappingProxyType(
        {
            "taring_count": 1,
            "taring_sum": 6,
            "taring_lowest": 6,
            "taring_highest": 6,
            "taring_block": 6,
        }
    )

    def __init__(
        self,
        samples: int,
        largest_spread: np.ndarray,
        largest_bias: np.ndarray,
        block: int = 1,
    ) -> None:
        self._block = min(block, samples)
        self._samples = -(-samples // self._block) * self._block
        self._only_judged = self._block if 1 < self._block < self._samples else 0
        self._largest_spread = ca.DM(np.asarray(largest_spread, dtype=float))
        self._largest_bias = ca.DM(np.asarray(largest_bias, dtype=float))

    def extend(self, x: Values, residual: Any) -> Values:
        """Return the window with one more residual; only its last block if that differs.

        Args:
            x: The window.
            residual: Shape (6,) [N, Nm].
        """
        count, block = x.taring_count + 1.0, x.taring_block + residual
        total = where(x.taring_count >= self._only_judged, x.taring_sum + residual, x.taring_sum)
        mean, is_first = block / self._block, count <= self._block
        lowest = where(is_first, mean, ca.fmin(x.taring_lowest, mean))
        highest = where(is_first, mean, ca.fmax(x.taring_highest, mean))
        is_full = ca.fmod(count, self._block) == 0.0
        differs = all_of(is_full, any_of(highest - lowest > self._largest_spread))
        anew = ca.DM.zeros(6) if self._only_judged else block
        return Values(
            taring_count=where(differs, self._block, count),
            taring_sum=where(differs, anew, total),
            taring_lowest=where(is_full, where(differs, mean, lowest), x.taring_lowest),
            taring_highest=where(is_full, where(differs, mean, highest), x.taring_highest),
            taring_block=where(is_full, 0.0, block),
        )

    def bias(self, x: Values) -> tuple[Any, Any, Any]:
        """Return the bias, whether the window is long enough, and whether the bias is plausible.

        Args:
            x: The window.

        Returns:
            The mean, shape (6,) [N, Nm], and two conditions, shape (1,): if the first is false, the
            other results are meaningless; if the second is false, the window must be discarded.
        """
        mean = x.taring_sum / (x.taring_count - self._only_judged)
        is_plausible = all_of(ca.fabs(mean) <= self._largest_bias)
        return mean, x.taring_count >= self._samples, is_plausible


# s, for which a component has to change first, and to be constant then
STILL_TIME = 0.05
# other components that must change, and samples within which they must have changed
_OTHERS, _LATELY = 3, 3


def memory_size(size: int) -> int:
    """Return the size of the memory of :func:`stands_still` for a number of components."""
    return 3 * size


def stands_still(
    measured: ca.SX,
    memory: ca.SX,
    at_range: ca.SX,
    samples: int,
    noisy: np.ndarray,
    robot_moves: ca.SX,
) -> tuple[ca.SX, ca.SX]:
    """Return whether components of a sensor are frozen.

    A component is constant if its value is the same, to the last bit, for ``samples`` samples. A
    component with noise larger than its resolution is never constant; the sensor has failed if more
    than three of them are. One constant component is sufficient if at least three others changed
    within the last three samples. Here only components are considered that changed at ``samples``
    consecutive samples before: components without noise never did, and a sensor at rest with a
    coarse resolution repeats its values, too, but in all components. Independent of noise, the
    sensor has failed if all considered components, more than three, are constant while the robot
    moves.

    Args:
        measured: The measurement, shape (n,).
        memory: ``[last measurement, samples for which it was constant, samples at which it
            changed]`` of each component, shape (3n,); zero before the first.
        at_range: Whether each is saturated, shape (n,).
        samples: Number of samples.
        noisy: Whether each has noise larger than its resolution, shape (n,).
        robot_moves: Whether the robot moves.

    Returns:
        0 or 1, and the next memory.
    """
    last, stayed, changed = ca.vertsplit(memory, measured.numel())
    same = ca.logic_and(measured == last, ca.logic_not(at_range))
    counts = changed >= samples
    stayed = ca.if_else(same, stayed + 1.0, 0.0)
    # once it is considered it remains so
    changed = ca.if_else(counts, changed, ca.if_else(same, 0.0, changed + 1.0))
    moving = ca.logic_and(counts, stayed < _LATELY)
    still = ca.logic_and(counts, stayed >= samples)
    one = ca.logic_and(ca.sum1(still) > 0, ca.sum1(moving) >= _OTHERS)
    most = ca.dot(stayed >= samples, ca.DM(np.asarray(noisy, dtype=float))) > _OTHERS
    number = ca.sum1(still)
    every = all_of(number > _OTHERS, number == ca.sum1(counts), robot_moves)
    return ca.logic_or(ca.logic_or(one, most), every), ca.vertcat(measured, stayed, changed)


class SensorFault(IntEnum):
    """Fault of a measured wrench."""

    NONE = 0
    LOST = 1  # NaN or infinite, or a frozen component
    SATURATED = 2
    JUMPED = 3  # a step that no force can cause


class MeasuredWrench(Block):
    """A measured wrench, already without the load of the tool, with its fault.

    Ports:
        wrench (input): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].
        measured (output): The input.
        sensor_fault (output): A :class:`SensorFault`, shape (1,): ``LOST`` if a component is NaN or
            infinite.
        tared (output): 1, shape (1,).
    """

    def __init__(self) -> None:
        self.inputs, self.states = {"wrench": Port(6, "N, Nm")}, {}
        self.outputs = {"measured": Port(6, "N, Nm"), "sensor_fault": Port(1), "tared": Port(1)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        fault = where(all_finite(u.wrench), SensorFault.NONE, SensorFault.LOST)
        return {"measured": u.wrench, "sensor_fault": fault, "tared": ca.DM(1.0)}


class PayloadCompensation(Block):
    """Subtracts the weight of a grasped payload from a wrench.

    ``f - h m g`` and ``tau - h (R_e p_TC) x m g`` with the share h of the payload that hangs on the
    gripper. A payload that was grasped while the sensor was tared is part of its bias, and h is
    relative to that share; this is exact if the tool keeps its orientation, or if nothing was
    grasped.

    Ports:
        wrench (input): At the tool point, world axes, shape (6,) [N, Nm], see
            :class:`ToolCompensation`.
        tool_pose (input): Measured ``[y_t, R_e by rows]``, shape (12,).
        held (input): Grasped share of the payload, 0 to 1, shape (1,).
        tared (input): Above 0.5 once the sensor is tared, shape (1,).
        sensor_fault (input): A :class:`SensorFault`, shape (1,).
        payload_free (output): The wrench without the payload, shape (6,) [N, Nm].
        fault (output): Fault of the sensor; ``LOST`` also if the share is NaN or infinite, shape
            (1,).

    State:
        Grasped share when the sensor was tared (``at_taring``).

    Args:
        mass: m, nominal [kg].
        p_TC: Nominal centre of mass of the payload in the tool's frame [m], shape (3,).
        gravity: g, world axes [m/s^2], shape (3,).
    """

    def __init__(self, mass: float, p_TC: np.ndarray, gravity: np.ndarray) -> None:
        self._weight, self._p_TC = mass * ca.DM(gravity), ca.DM(p_TC)
        self.inputs = {
            "wrench": Port(6, "N, Nm"),
            "tool_pose": Port(12, "m, 1"),
            "held": Port(1),
            "tared": Port(1),
            "sensor_fault": Port(1),
        }
        self.outputs = {"payload_free": Port(6, "N, Nm"), "fault": Port(1)}
        self.states = {"at_taring": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        R_e = ca.reshape(u.tool_pose[3:], 3, 3).T
        load = ca.vertcat(self._weight, ca.cross(R_e @ self._p_TC, self._weight))
        return {
            "payload_free": u.wrench - (u.held - x.at_taring) * load,
            "fault": where(is_finite(u.held), u.sensor_fault, float(SensorFault.LOST)),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"at_taring": where(u.tared < 0.5, u.held, x.at_taring)}
