"""A block that is stepped by hand, without Drake."""

from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError

# arguments of a program that are not the block's
_NO_INPUTS = {"x", "t", "preset"}


class Stepper:
    """Steps a block tick by tick, with numbers.

    Args:
        block: The block or network.
        connected: Names of the optional inputs that are given at every step; the others are not
            connected.

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
        """States by name, as they are before the next tick; None before the start."""
        if not self._started:
            return None
        return {name: self._x[part].copy() for name, part in self._program.states.items()}

    def restart(self) -> None:
        """Forget all states: the next step is the first one."""
        self._started, self.tick = False, 0

    def start(self, **inputs: Any) -> None:
        """Begin, as the inputs say.

        Args:
            inputs: Values by name.
        """
        wanted = self._program.initial_inputs
        given = {name: value for name, value in inputs.items() if name in wanted}
        self._give(self._initial, given, set(self._initial.arguments) - _NO_INPUTS)
        self._initial.arguments["t"][0] = self.tick
        self._initial.evaluate()
        self._x[:] = self._initial.results["x_start"]
        self._started = True

    def set_state(self, name: str, value: Any) -> None:
        """Set what is remembered, after the start.

        Args:
            name: Name of the state.
            value: Value of the state.
        """
        self._x[self._program.states[name]] = value
        self._started = True

    def step(self, **inputs: Any) -> dict[str, np.ndarray]:
        """Return the outputs of a tick by name, and go on to the next.

        Args:
            inputs: Values by name, all that are connected.

        Raises:
            InputError: If one is missing, unknown or of another size.
        """
        if not self._started:
            self.start(**inputs)
        self._give(self._step, inputs, self._connected)
        self._step.arguments["t"][0] = self.tick
        self._step.evaluate()
        results = {name: value.copy() for name, value in self._step.results.items()}
        self._x[:] = results.pop("x_next")
        self.tick += 1
        return results

    def _give(self, function: BoundFunction, inputs: dict[str, Any], wanted: set[str]) -> None:
        if inputs.keys() != wanted:
            raise InputError(f"inputs: {', '.join(inputs)}; must be {', '.join(sorted(wanted))}")
        for name, value in inputs.items():
            values = np.ravel(value)
            if values.shape != function.arguments[name].shape:
                size = len(function.arguments[name])
                raise InputError(f"input {name}: {len(values)} numbers; must be {size}")
            function.arguments[name][:] = values
