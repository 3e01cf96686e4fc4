"""What blocks remember and put out, by name, whether they are one system or many."""

import numpy as np
from pydrake.systems.framework import Context, Diagram

from pfsc_drake.systems.block_system import BlockSystem


class BlockAccess:
    """Reads and sets what the blocks of a diagram remember.

    Args:
        diagram: The diagram, with its blocks as systems of their own or fused.
    """

    def __init__(self, diagram: Diagram) -> None:
        self._states: dict[str, tuple[BlockSystem, str]] = {}
        self._wires: dict[str, tuple[BlockSystem, str]] = {}
        self._collect(diagram, "")

    def _collect(self, diagram: Diagram, path: str) -> None:
        for system in diagram.GetSystems():
            if isinstance(system, BlockSystem):
                for found, names in (
                    (self._states, system.states),
                    (self._wires, system.network.wires),
                ):
                    found |= {f"{path}{system.full_name(name)}": (system, name) for name in names}
            elif isinstance(system, Diagram):
                self._collect(system, f"{path}{system.get_name()}.")

    def output(self, root: Context, name: str) -> np.ndarray:
        """Return what a block puts out.

        Args:
            root: Context of the diagram.
            name: ``block.output``.
        """
        system, wire = self._wires[name]
        return system.wire(system.GetMyContextFromRoot(root), wire)

    def state(self, root: Context, name: str) -> np.ndarray:
        """Return what a block remembers.

        Args:
            root: Context of the diagram.
            name: ``block.state``.
        """
        system, state = self._states[name]
        return system.state(system.GetMyContextFromRoot(root), state)

    def presets(self, root: Context) -> dict[str, np.ndarray]:
        """Return what has been set before the start, by ``block.state``.

        Args:
            root: Context of the diagram.
        """
        found = {}
        for key, (system, name) in self._states.items():
            context = system.GetMyContextFromRoot(root)
            if system.is_set(context, name):
                found[key] = system.state(context, name)
        return found

    def set_state(self, root: Context, name: str, value: np.ndarray) -> None:
        """Set what a block remembers; see :meth:`BlockSystem.set_state`.

        Args:
            root: Context of the diagram.
            name: ``block.state``.
            value: Value of the state.
        """
        system, state = self._states[name]
        system.set_state(system.GetMyMutableContextFromRoot(root), state, value)
