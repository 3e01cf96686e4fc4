"""Instant of a logged fault."""

import numpy as np
from pydrake.systems.framework import Context

from diagrams.signal_log import SignalLog
from pfsc_drake.controller.fault_description import FaultInstant
from pfsc_drake.systems.fuse import BlockAccess


def first_instant(
    log: SignalLog, blocks: BlockAccess, root: Context, signal: str, column: int
) -> tuple[FaultInstant, FaultInstant | None]:
    """Return the first instant at which a logged fault was there, and the one before.

    Args:
        log: The log.
        blocks: Blocks of the diagram.
        root: Context of the diagram, in which the fault holds.
        signal: Logged signal with the fault.
        column: Column of the signal, where the fault is.
    """
    times, raw = log.read(root)
    faults = np.flatnonzero(raw[signal][:, column])
    k = int(faults[0]) if len(faults) else len(times)
    instants = [
        FaultInstant(float(times[i]), {name: x[i] for name, x in raw.items()})
        for i in (k - 1, k)
        if 0 <= i < len(times)
    ]
    if k == len(times):
        # it is so new that it has not been logged
        instants.append(FaultInstant(root.get_time(), log.now(blocks, root)))
    return instants[-1], instants[0] if len(instants) > 1 else None
