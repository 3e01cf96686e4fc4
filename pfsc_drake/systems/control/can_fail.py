"""What systems with a safe state have in common."""

from typing import Protocol, runtime_checkable

from pydrake.systems.framework import Context

from pfsc_drake.control.law.fault import Fault


@runtime_checkable
class CanFail(Protocol):
    """A system that goes to a safe state after a fault, and stays there."""

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds at the present instant.

        Args:
            context: Context of the system.
        """
