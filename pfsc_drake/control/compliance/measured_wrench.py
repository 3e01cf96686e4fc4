"""A measured wrench: its bias, components that stand still, when it is lost, a payload on it."""

from enum import IntEnum
from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, is_finite, where

# s, over whose means a sensor is judged to be quiet
TARING_BLOCK = 0.01


class Taring:
    """The sensor's bias as the mean of a quiet stretch of residuals.

    Quiet is judged by means over blocks of samples. Noise does not matter then, and neither do the
    strokes of drives that creep against their friction: an arm that holds a load which nobody
    told it of does so for seconds, at rest but for the last increments of its encoders, and what
    the tool's inertia is believed to do at every one of them is a spike of a sample or two. What
    pushes or moves the tool lasts longer than a block. The first block is judged, but does not
    count for the bias: what came before it, a start for instance, may still fade in it.

    What is remembered of a stretch (:attr:`states`) is the number of its samples, their sum, the
    lowest and the highest mean of a block, and the sum of the block that is not full; all zero is
    the empty one. It starts anew, with the last block, whenever the means differ too much, so that
    taring goes on until it is quiet.

    Args:
        samples: Number of samples in a stretch.
        largest_spread: Largest difference of means in it, shape (6,) [N, Nm].
        largest_bias: Largest mean that is believed, shape (6,) [N, Nm].
        block: Number of samples in a block; a stretch is made of whole ones.
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

    def extended(self, x: Values, residual: Any) -> Values:
        """Return a stretch with one more residual; only its last block if that differs.

        Args:
            x: The stretch.
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
        """Return the bias, whether the stretch is long enough, and whether it is believed.

        Args:
            x: The stretch.

        Returns:
            The mean, shape (6,) [N, Nm], and two conditions, shape (1,): where the first does not
            hold, the others mean nothing; where the second does not, the stretch is to be thrown
            away.
        """
        mean = x.taring_sum / (x.taring_count - self._only_judged)
        is_believed = all_of(ca.fabs(mean) <= self._largest_bias)
        return mean, x.taring_count >= self._samples, is_believed


# s, for which a component has to move first, and to stand still then
STILL_TIME = 0.05
# other components that must move, and samples within which they must have changed
_OTHERS, _LATELY = 3, 3


def memory_size(size: int) -> int:
    """Return the number of values that are remembered of a measurement of as many components."""
    return 3 * size


def stands_still(
    measured: ca.SX,
    memory: ca.SX,
    at_range: ca.SX,
    samples: int,
    noisy: np.ndarray,
    robot_moves: ca.SX,
) -> tuple[ca.SX, ca.SX]:
    """Return whether components of a sensor stand still that should not.

    One stands still when it has been the same, to the last bit, for so many samples. With noise
    larger than its steps none ever does, so the sensor is broken if more than three do that have
    some. One is enough if at least three others changed within the last three samples; there only
    components count that changed at each of as many samples in a row before. What is constant
    anyway, as without noise, never did; and a sensor at rest with coarse steps repeats its values,
    too, but in all components. All of those that count, if they are more than three, must not do so
    while the robot moves, whatever their noise.

    Args:
        measured: The measurement, shape (n,).
        memory: ``[last measurement, samples for which it stayed, samples at which it changed]``
            of each component, shape (3n,); zero before the first.
        at_range: Whether each is at the end of its range, where it stays, shape (n,).
        samples: Number of samples.
        noisy: Whether each is believed to have noise larger than its steps, shape (n,).
        robot_moves: Whether the robot moves.

    Returns:
        0 or 1, and the next memory.
    """
    last, stayed, changed = ca.vertsplit(memory, measured.numel())
    same = ca.logic_and(measured == last, ca.logic_not(at_range))
    counts = changed >= samples
    stayed = ca.if_else(same, stayed + 1.0, 0.0)
    # once it counts it goes on to
    changed = ca.if_else(counts, changed, ca.if_else(same, 0.0, changed + 1.0))
    moving = ca.logic_and(counts, stayed < _LATELY)
    still = ca.logic_and(counts, stayed >= samples)
    one = ca.logic_and(ca.sum1(still) > 0, ca.sum1(moving) >= _OTHERS)
    most = ca.dot(stayed >= samples, ca.DM(np.asarray(noisy, dtype=float))) > _OTHERS
    number = ca.sum1(still)
    every = all_of(number > _OTHERS, number == ca.sum1(counts), robot_moves)
    return ca.logic_or(ca.logic_or(one, most), every), ca.vertcat(measured, stayed, changed)


class SensorFault(IntEnum):
    """Why a compensated wrench is not to be trusted."""

    NONE = 0
    LOST = 1  # no finite number, or a component that stands still
    SATURATED = 2
    JUMPED = 3  # by a step that no force makes


class MeasuredWrench(Block):
    """A measured wrench, the load of the tool taken off already, with what stops the robot.

    Ports:
        wrench (input): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].
        measured (output): The same.
        sensor_fault (output): A :class:`SensorFault`, shape (1,): ``LOST`` where a component is no
            finite number.
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
    """Takes the weight of a payload off a wrench while it is held.

    ``f - h m g`` and ``tau - h (R_e p_TC) x m g``, h being the share of the payload that hangs on
    the gripper. What hung there while the sensor was tared is part of its bias, and h counts from
    there; that is right as long as the tool keeps its orientation, or nothing was held.

    Ports:
        wrench (input): At the tool point, world axes, shape (6,) [N, Nm], see
            :class:`ToolCompensation`.
        tool_pose (input): ``[y_t, R_e by rows]`` as measured, shape (12,).
        held (input): Share that is held, 0 to 1, shape (1,).
        tared (input): Above 0.5 once the sensor is tared, shape (1,).
        sensor_fault (input): A :class:`SensorFault`, shape (1,).
        payload_free (output): The wrench without the payload, shape (6,) [N, Nm].
        fault (output): The sensor's, which is lost too where the share is no number, shape (1,).

    State:
        Share that was held when the sensor was tared (``at_taring``).

    Args:
        mass: m, as believed [kg].
        p_TC: Its centre of mass in the tool's frame, as believed [m], shape (3,).
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
        """Return what is remembered at the next tick; what is left out stays."""
        return {"at_taring": where(u.tared < 0.5, u.held, x.at_taring)}
