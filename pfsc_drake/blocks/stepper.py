"""Stepping of a block without Drake."""

from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError

# arguments of a program that do not belong to the block
_NO_INPUTS = {"x", "t", "preset"}


class Stepper:
    """Steps a block tick by tick, with numbers.

    Args:
        block: The block or network.
        connected: Names of the connected optional inputs; each step needs their values.

    Attributes:
        tick: Number of the next tick.
    """

    def __init__(self, block: Block | Network, connected: tuple[str, ...] = ()) -> None:
        if isinstance(block, Block):
            optional = {name for name, port in block.inputs.items() if port.optional}
            block = Network.of(block, optional - set(connected))
        self._program = Program(block)
        self._x = np.zeros(self._program.size)
        step, initial = self._program.step(), self._program.initial
        self._step = BoundFunction(step, x=self._x)
        self._initial = BoundFunction(initial)
        self._connected = set(self._step.arguments) - _NO_INPUTS
        self._started = False
        self.tick = 0

    @property
    def states(self) -> dict[str, np.ndarray] | None:
        """States by name, before the next tick; None before the start."""
        if not self._started:
            return None
        return {name: self._x[part].copy() for name, part in self._program.states.items()}

    def restart(self) -> None:
        """Delete all states: the next step is the first one."""
        self._started, self.tick = False, 0

    def start(self, **inputs: Any) -> None:
        """Set the initial states from the inputs.

        Args:
            inputs: Values by name.
        """
        expected = self._program.initial_inputs
        initial_inputs = {name: value for name, value in inputs.items() if name in expected}
        self._set_arguments(
            self._initial, initial_inputs, set(self._initial.arguments) - _NO_INPUTS
        )
        self._initial.arguments["t"][0] = self.tick
        self._initial.evaluate()
        self._x[:] = self._initial.results["x_start"]
        self._started = True

    def set_state(self, name: str, value: Any) -> None:
        """Set a state after the start.

        Args:
            name: Name of the state.
            value: Value of the state.
        """
        self._x[self._program.states[name]] = value
        self._started = True

    def step(self, **inputs: Any) -> dict[str, np.ndarray]:
        """Return the outputs of a tick by name, and advance to the next.

        Args:
            inputs: Values of all connected inputs, by name.

        Raises:
            InputError: If one is missing, unknown or of another size.
        """
        if not self._started:
            self.start(**inputs)
        self._set_arguments(self._step, inputs, self._connected)
        self._step.arguments["t"][0] = self.tick
        self._step.evaluate()
        results = {name: value.copy() for name, value in self._step.results.items()}
        self._x[:] = results.pop("x_next")
        self.tick += 1
        return results

    def _set_arguments(
        self, function: BoundFunction, inputs: dict[str, Any], expected: set[str]
    ) -> None:
        if inputs.keys() != expected:
            raise InputError(f"inputs: {', '.join(inputs)}; must be {', '.join(sorted(expected))}")
        for name, value in inputs.items():
            values = np.ravel(value)
            if values.shape != function.arguments[name].shape:
                size = len(function.arguments[name])
                raise InputError(f"input {name}: {len(values)} numbers; must be {size}")
            function.arguments[name][:] = values
