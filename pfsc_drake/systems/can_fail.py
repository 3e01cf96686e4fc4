"""What systems with a safe state have in common."""

from typing import Protocol, runtime_checkable

from pydrake.systems.framework import Context

from pfsc_drake.control.law.fault import Fault

_ROUNDING = 1e-6  # of a period


def is_tick(context: Context, period: float) -> bool:
    """Return whether a sampled system samples at the present instant.

    Between two ticks it knows its memory alone: what it would make of its inputs there, which have
    moved on by part of a period, is nothing that it ever sees.

    Args:
        context: Context of the system.
        period: Its sampling time [s].
    """
    ticks = context.get_time() / period
    return abs(ticks - round(ticks)) < _ROUNDING


@runtime_checkable
class FailingSystem(Protocol):
    """A system that goes to a safe state after a fault, and stays there."""

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds since the last tick, the present instant if it is one.

        Args:
            context: Context of the system.
        """

    def GetMyContextFromRoot(self, root: Context) -> Context:
        """Return the system's part of a diagram's context, as every Drake system does.

        Args:
            root: Context of the diagram.
        """
