"""The functions of a program, bound to one set of arrays."""

import functools

import casadi as ca
import numpy as np

from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.stage import Stage
from pfsc_drake.compiled.bound_function import BoundFunction


def stages_of(program: Program, update_stage: int | None) -> list[Stage]:
    """Return a program's stages, one of them with the update.

    Args:
        program: The program.
        update_stage: Number of that stage; no update if omitted.
    """
    stages = list(program.stages)
    if update_stage is not None:
        stages[update_stage] = program.with_update(update_stage)
    return stages


class BoundProgram:
    """The functions of a program, bound to one set of arrays.

    Args:
        program: The program.
        update_stage: Number of the stage that is evaluated with the update, if any.

    Attributes:
        program: The same.
        x, t, preset, u, stage_results: Arguments of the functions: states, tick, flags of states
            that were set, inputs by name, results of stages.
    """

    def __init__(self, program: Program, update_stage: int | None) -> None:
        self.program = program
        self.x, self.t = np.zeros(program.size), np.zeros(1)
        self.preset = np.zeros(len(program.states))
        self.u = {name: np.zeros(port.size) for name, port in program.network.inputs.items()}
        self.stage_results = [np.zeros(stage.function.numel_out(0)) for stage in program.stages]
        arrays = {"x": self.x, "t": self.t, "preset": self.preset} | self.u
        arrays |= {f"stage_{k}": values for k, values in enumerate(self.stage_results)}
        self._arrays = arrays
        self._stages = stages_of(program, update_stage)
        self._bound_stages: dict[int, BoundFunction] = {}

    def stage(self, k: int) -> tuple[Stage, BoundFunction]:
        """Return a stage with its function, compiled at the first call.

        Args:
            k: Its number.
        """
        if k not in self._bound_stages:
            self._bound_stages[k] = self._bind(self._stages[k].function)
        return self._stages[k], self._bound_stages[k]

    @functools.cached_property
    def initial(self) -> BoundFunction:
        """States at the start; evaluated too rarely to be compiled."""
        return self._bind(self.program.initial, False)

    @functools.cached_property
    def update(self) -> BoundFunction:
        """States at the next tick, if no stage evaluates them."""
        return self._bind(self.program.update)

    def _bind(self, function: ca.Function, often: bool = True) -> BoundFunction:
        arrays = {name: self._arrays[name] for name in function.name_in()}
        return BoundFunction(function, often, **arrays)
