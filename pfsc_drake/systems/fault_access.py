"""What has stopped a robot, by name, whether blocks are one system or many."""

import numpy as np
from pydrake.systems.framework import Context, Diagram

from pfsc_drake.control.law.fault import Fault
from pfsc_drake.systems.block_access import BlockAccess
from pfsc_drake.systems.block_system import is_tick


class FaultAccess:
    """What a diagram that stops a robot after a fault has found, fused with other blocks or not.

    Args:
        diagram: With a ``fault_latch``, a ``safe_stop`` and, where joints are watched, a
            ``supervision``; in a builder under its name.
        period: Sampling time of its blocks [s].

    Attributes:
        name: Of the diagram.
        period: Sampling time [s].
    """

    def __init__(self, diagram: Diagram, period: float) -> None:
        self.name, self.period = diagram.get_name(), period
        self._is_supervised = diagram.HasSubsystemNamed("supervision")

    def fault(self, blocks: BlockAccess, root: Context) -> Fault:
        """Return the fault that holds since the last tick, the present instant if it is one.

        Args:
            blocks: Of the diagram.
            root: Context of the diagram.
        """
        latch = f"{self.name}.fault_latch.fault"
        read = blocks.output if is_tick(root.get_time(), self.period) else blocks.state
        return Fault(int(read(root, latch)[0]))

    def suspects(self, blocks: BlockAccess, root: Context) -> np.ndarray:
        """Return which measured values are not believed, nonzero if so, shape (4N,).

        Args:
            blocks: Of the diagram.
            root: Context of the diagram.
        """
        ignored = blocks.state(root, f"{self.name}.safe_stop.ignored")
        if not (self._is_supervised and is_tick(root.get_time(), self.period)):
            return ignored
        return np.maximum(ignored, blocks.output(root, f"{self.name}.supervision.suspects"))
