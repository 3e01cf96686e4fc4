"""The hand of a person at a screen: what is asked of it now, as a force that a hand could exert."""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import require

_LARGEST = 1e9  # of stiffness, damping and force; what it multiplies stays within a float
_SLOWEST = 10.0  # s
# below this share of its grip a hand is open
_OPEN = 1e-3
# parts of what is asked, and of the memory
PUSH, HOLD, TARGET = slice(0, 3), 3, slice(4, 7)
ASKED = 7


@dataclass
class LiveHandParameters:
    """Properties of a hand whose owner decides, at every instant, what it does.

    Attributes:
        stiffness: K, from the tool to where a holding hand wants it [N/m].
        damping: D of a holding hand [N s/m].
        rotational_damping: D_r, by which a holding hand resists turning [Nm s/rad].
        force_limit: Largest magnitude of the force [N].
        torque_limit: Largest magnitude of the torque [Nm].
        response_time: Time constant of each of two lags between what is asked and what the muscles
            do [s].
    """

    stiffness: float = 400.0
    damping: float = 30.0
    rotational_damping: float = 0.3
    force_limit: float = 45.0
    torque_limit: float = 3.0
    response_time: float = 0.05

    def __post_init__(self) -> None:
        for key in ("stiffness", "force_limit", "torque_limit"):
            value = getattr(self, key)
            require(0.0 < value <= _LARGEST, key, value, f"positive, at most {_LARGEST:g}")
        for key in ("damping", "rotational_damping"):
            value = getattr(self, key)
            require(0.0 <= value <= _LARGEST, key, value, f"zero or positive, at most {_LARGEST:g}")
        time = self.response_time
        require(0.0 < time <= _SLOWEST, "response_time", time, f"positive, at most {_SLOWEST:g} s")


class LiveHandModel:
    """Force of a hand that is asked for a push, and to hold the tool at a place.

    ``f = limit(f_2 + g_2 (K (p_2 - y_t) - D y_t'))``, ``tau = limit(-g_2 D_r w)``: what is asked -
    push f, grip g (0 or 1) and target p - passes two lags of first order,
    ``x_1' = (x - x_1) / T_r``, ``x_2' = (x_1 - x_2) / T_r``, so that the force is C^1 in time
    whatever a slider does. The target of an open hand is taken at once: a hand closes where it is
    asked to hold, not on the way there from where it held before.

    Args:
        parameters: Its properties.
        period: Time over which what is asked is held [s].
    """

    def __init__(self, parameters: LiveHandParameters, period: float) -> None:
        bound = BoundFunction(_hand_function(parameters, period))
        self._arguments, self._evaluate = list(bound.arguments.values()), bound.evaluate
        self._lags, self._wrench = bound.results["lags"], bound.results["wrench"]

    @property
    def rest(self) -> np.ndarray:
        """The memory of an open hand that does nothing, shape (14,)."""
        return np.zeros(2 * ASKED)

    def advance(
        self, memory: np.ndarray, asked: np.ndarray, last: np.ndarray, pose: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return both lags one period later, shape (14,), and the wrench on the tool.

        The wrench is ``[force, torque]``, world axes, shape (6,) [N, Nm].

        Args:
            memory: Both lags, shape (14,).
            asked: Push, world axes [N], 1 to hold and 0 not to, place to hold at, world axes [m],
                shape (7,).
            last: ``[y_t, R_e by rows]`` one period ago, shape (12,).
            pose: The same now.
        """
        for argument, value in zip(self._arguments, (memory, asked, last, pose), strict=True):
            argument[:] = value
        self._evaluate()
        return self._lags.copy(), self._wrench.copy()


def _hand_function(hand: LiveHandParameters, period: float) -> ca.Function:
    """Return ``(memory, asked, last, pose) -> (lags, wrench)``, see :class:`LiveHandModel`."""
    memory, asked = ca.SX.sym("memory", 2 * ASKED), ca.SX.sym("asked", ASKED)
    last, pose = ca.SX.sym("last", 12), ca.SX.sym("pose", 12)
    share = -math.expm1(-period / hand.response_time)
    first, second = ca.vertsplit(memory, ASKED)
    is_open = ca.logic_and(ca.SX(np.arange(ASKED) >= TARGET.start), first[HOLD] < _OPEN)
    first, second = ca.if_else(is_open, asked, first), ca.if_else(is_open, asked, second)
    second += share * (first - second)
    first += share * (asked - first)
    grip = second[HOLD]
    velocity = (pose[:3] - last[:3]) / period
    turn = ca.reshape(pose[3:], 3, 3).T @ ca.reshape(last[3:], 3, 3)
    spin = ca.inv_skew((turn - turn.T) / 2.0) / period
    held = hand.stiffness * (second[TARGET] - pose[:3]) - hand.damping * velocity
    force = _limited(second[PUSH] + grip * held, hand.force_limit)
    torque = _limited(-grip * hand.rotational_damping * spin, hand.torque_limit)
    return ca.Function(
        "live_hand",
        [memory, asked, last, pose],
        ca.cse([ca.vertcat(first, second), ca.vertcat(force, torque)]),
        ["memory", "asked", "last", "pose"],
        ["lags", "wrench"],
    )


def _limited(vector: ca.SX, limit: float) -> ca.SX:
    size = ca.norm_2(vector)
    return ca.if_else(size > limit, vector * (limit / size), vector)
