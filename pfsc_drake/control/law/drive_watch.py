"""Drives that are at a limit for too long, or jump from one of their limits to the other."""

import math
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import any_of, first_of, where
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.supervision import SupervisionParameters

# s, in which turns are forgotten
_FORGETTING = 0.2
# ticks at a limit that one tick within the limits makes up for
_FORGIVEN = 0.5


class DriveWatch(Block):
    """Finds drives that are at their limits for too long, or at both of them in turns.

    Saturation: each drive's ticks at a limit are counted, and taken off by half a tick when it is
    within. So drives that go from limit to limit and back are found as well.

    Chatter: a loop that has become unstable in the frequencies of its own sampling asks for more
    torque at every turn until the drives give all they have, one way and the other: it stays in
    bounds, and no drive is at one limit for long. So the turns are counted, from one limit to the
    other; in between, a drive may be anywhere. They are forgotten with a time constant of 0.2 s, so
    that a drive that swings at f Hz counts ``0.4 f`` in the end, beyond ``chatter_turns`` for all f
    above ``2.5 chatter_turns`` Hz. A reversal at full torque, even with an overshoot, has one or
    two.

    Ports:
        drive (input): What the drives are told, shape (N,).
        stopping (input): Nonzero where they are told so after a fault, which does not count, shape
            (1,).
        fault (output): DRIVE_SATURATED, DRIVE_CHATTERS or NONE, shape (1,), of the ticks before:
            it depends on the state alone.

    State:
        Of each drive: ``ticks`` at a limit; at which ``side`` it was last, -1, 0 or 1; its
        ``turns``, each of shape (N,).

    Args:
        limits: Of what drives are told, shape (N,).
        parameters: How much is too much.
        period: Sampling time [s].
    """

    def __init__(
        self, limits: np.ndarray, parameters: SupervisionParameters, period: float
    ) -> None:
        n, time = len(limits), parameters.saturation_time
        self._limits = ca.DM(np.asarray(limits, dtype=float))
        self._ticks = round(time / period) if time else math.inf
        self._turns = parameters.chatter_turns or math.inf
        self._decay = math.exp(-period / _FORGETTING)
        self.inputs = {"drive": Port(n), "stopping": Port(1)}
        self.outputs = {"fault": Port(1)}
        self.states = {"ticks": n, "side": n, "turns": n}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        fault = first_of(
            (any_of(x.ticks >= self._ticks), Fault.DRIVE_SATURATED),
            (any_of(x.turns >= self._turns), Fault.DRIVE_CHATTERS),
            otherwise=Fault.NONE,
        )
        return {"fault": fault}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        at_limit = ca.fabs(u.drive) >= self._limits
        side = where(at_limit, ca.sign(u.drive), 0.0)
        counted = {
            "ticks": where(at_limit, x.ticks + 1.0, ca.fmax(x.ticks - _FORGIVEN, 0.0)),
            "side": where(side, side, x.side),
            "turns": self._decay * x.turns + (side * x.side < 0.0),
        }
        return {name: where(u.stopping, getattr(x, name), new) for name, new in counted.items()}
