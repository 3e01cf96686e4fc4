"""A block that is stepped by hand, without Drake."""

from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError


class Stepper:
    """Steps a block tick by tick, with numbers.

    Args:
        block: The block or network.
        connected: Names of the optional inputs that are given at every step; the others are not
            connected.

    Attributes:
        tick: Number of the next tick.
        states: States by name, as they are before it; None before the start.
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
        self.tick = 0
        self.states: dict[str, np.ndarray] | None = None

    def start(self, **inputs: Any) -> None:
        """Begin, as the inputs say.

        Args:
            inputs: Values by name.
        """
        wanted = self._program.initial_inputs
        self._give(self._initial, {k: value for k, value in inputs.items() if k in wanted})
        self._initial.arguments["t"][0] = self.tick
        self._initial.evaluate()
        self._x[:] = self._initial.results["x_start"]
        self._name_states()

    def set_state(self, name: str, value: Any) -> None:
        """Set what is remembered, after the start.

        Args:
            name: Name of the state.
            value: Value of the state.
        """
        self._x[self._program.states[name]] = value
        self._name_states()

    def step(self, **inputs: Any) -> dict[str, np.ndarray]:
        """Return the outputs of a tick by name, and go on to the next.

        Args:
            inputs: Values by name, all that are connected.

        Raises:
            InputError: If one is missing, unknown or of another size.
        """
        if self.states is None:
            self.start(**inputs)
        self._give(self._step, inputs)
        self._step.arguments["t"][0] = self.tick
        self._step.evaluate()
        results = {name: value.copy() for name, value in self._step.results.items()}
        self._x[:] = results.pop("x_next")
        self.tick += 1
        self._name_states()
        return results

    def _name_states(self) -> None:
        self.states = {name: self._x[part].copy() for name, part in self._program.states.items()}

    def _give(self, function: BoundFunction, inputs: dict[str, Any]) -> None:
        wanted = set(function.arguments) - {"x", "t", "preset"}
        if wanted != set(inputs):
            raise InputError(f"inputs: {', '.join(inputs)}; must be {', '.join(sorted(wanted))}")
        for name, value in inputs.items():
            values = np.ravel(value)
            if values.shape != function.arguments[name].shape:
                size = len(function.arguments[name])
                raise InputError(f"input {name}: {len(values)} numbers; must be {size}")
            function.arguments[name][:] = values
