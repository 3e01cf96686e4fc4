"""What systems with a safe state have in common."""

from typing import Protocol, runtime_checkable

from pydrake.systems.framework import Context

from pfsc_drake.control.law.fault import Fault


@runtime_checkable
class FailingSystem(Protocol):
    """A system that goes to a safe state after a fault, and stays there."""

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds at the present instant.

        Args:
            context: Context of the system.
        """

    def GetMyContextFromRoot(self, root: Context) -> Context:
        """Return the system's part of a diagram's context, as every Drake system does.

        Args:
            root: Context of the diagram.
        """
