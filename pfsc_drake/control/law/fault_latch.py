"""The first fault stays, and the drives do something else from then on."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import first_of, latched, where


class FaultLatch(Block):
    """The first fault of several kinds; only a new start takes it away.

    Ports:
        (inputs): A fault each, shape (1,), 0 for none; of those at one tick the first counts.
        fault (output): The fault, from the tick on at which it is found, shape (1,).

    State:
        fault

    Args:
        causes: Names of the inputs, the root cause first.
    """

    def __init__(self, causes: Sequence[str]) -> None:
        self.inputs = {name: Port(1) for name in causes}
        self.outputs, self.states = {"fault": Port(1)}, {"fault": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        found = [getattr(u, name) for name in self.inputs]
        return {"fault": latched(x.fault, first_of(*zip(found, found, strict=True), otherwise=0))}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"fault": y.fault}


class FaultSwitch(Block):
    """What drives are told: by a law, or, after a fault, by what stops the robot.

    Ports:
        drive (input): By the law, shape (N,).
        stop (input, optional): After a fault, shape (N,); zero if not connected.
        fault (input): Nonzero from the fault on, shape (1,).
        told (output): What they are told, shape (N,).

    Args:
        num_drives: N.
        unit: Of what they are told.
    """

    def __init__(self, num_drives: int, unit: str = "") -> None:
        self.inputs = {
            "drive": Port(num_drives),
            "stop": Port(num_drives, optional=True),
            "fault": Port(1),
        }
        self.outputs, self.states = {"told": Port(num_drives, unit)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        stop = ca.DM(*u.drive.shape) if u.stop is None else u.stop
        return {"told": where(u.fault, stop, u.drive)}
