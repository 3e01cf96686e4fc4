"""A block, or a network of them, as a Drake system."""

import math
from collections.abc import Iterable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    CacheEntry,
    Context,
    DiscreteStateIndex,
    DiscreteValues,
    EventStatus,
    LeafSystem,
    ValueProducer,
)

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.bound_program import BoundProgram, stages_of
from pfsc_drake.blocks.network import TICK, Network, Source
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.blocks.stage import Needs, Stage

_ROUNDING = 1e-6  # of a period, by which a time may miss a tick
_STARTED = 0
_NOTHING: frozenset[str] = frozenset()


class BlockSystem(LeafSystem):
    """A block in a diagram: its ports, its states, and its methods as compiled functions.

    At every tick, from time zero on, the states are updated by the block's ``update``. Between
    ticks the outputs follow the inputs. Before the simulation begins, the states follow from the
    inputs at that moment by the block's ``initial``, so that a block that starts from another
    block's output starts from that block's initial output, in whatever order Drake initializes
    them. A state that :meth:`set_state` has set before is not initialized.

    Ports:
        Ports of the block.

    State:
        Discrete: whether the system has started, which states were set before that, and the states
            at the indices :attr:`states`. States that are outputs without change have groups of
            their own, so that reading them between ticks takes no Python.

    Args:
        block: The block or network.
        period: Sampling time [s].

    Attributes:
        block: The block; None for a network.
        network: The block as a network, all inputs connected.
        period: Sampling time [s].
        states: Slices of the states among the discrete variables, all groups one after another.
    """

    def __init__(self, block: Block | Network, period: float) -> None:
        super().__init__()
        self.block = block if isinstance(block, Block) else None
        self.period = period
        whole = self.network = block if isinstance(block, Network) else Network.of(block)
        declared = Program.of(whole)
        self._programs: dict[frozenset[str], BoundProgram] = {}
        self._declared = declared
        # [started, flags of set states, states]; states that are outputs have groups of their own
        first = 1 + len(declared.states)
        self._preset, self._x = slice(1, first), slice(first, first + declared.size)
        self.states = {
            name: slice(first + part.start, first + part.stop)
            for name, part in declared.states.items()
        }
        state_groups = {name: declared.states[name] for name in whole.state_outputs.values()}
        self._hidden = declared.size - sum(part.stop - part.start for part in state_groups.values())
        self._own = slice(first, first + self._hidden)
        self._memory = self.DeclareDiscreteState(self._own.stop)
        self._state_groups = {
            name: (self.DeclareDiscreteState(part.stop - part.start), part)
            for name, part in sorted(state_groups.items(), key=lambda item: item[1].start)
        }
        # states with their own groups that the update depends on
        self._update_groups = [
            p for name, p in self._state_groups.items() if name in declared.update_states
        ]
        self._groups = [slice(0, self._own.stop)]
        self._groups += [self.states[name] for name in self._state_groups]
        self._inputs = {
            name: self.DeclareVectorInputPort(name, port.size)
            for name, port in whole.inputs.items()
        }
        self._state_wires = {
            whole.outputs[port]: name for port, name in whole.state_outputs.items()
        }
        self._optional = [name for name, port in whole.inputs.items() if port.optional]
        self._being_evaluated: set[str] = set()
        self._stages: list[CacheEntry] = []
        for k, stage in enumerate(stages_of(declared, declared.update_stage)):
            self._stages.append(self._declare_stage(k, stage))
        for port in whole.outputs:
            self._declare_output(port)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        if declared.size:
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def full_name(self, name: str) -> str:
        """Return ``block.name`` of a state or a wire; in a network it has this form already.

        Args:
            name: Name of the state or wire.
        """
        return name if self.block is None else f"{self.get_name()}.{name}"

    def state(self, context: Context, name: str) -> np.ndarray:
        """Return a state.

        Args:
            context: The system's own.
            name: Name of the state.
        """
        if name in self._state_groups:
            group, _ = self._state_groups[name]
            return context.get_discrete_state(group).value().copy()
        return context.get_discrete_state(self._memory).value()[self.states[name]].copy()

    def is_set(self, context: Context, name: str) -> bool:
        """Return whether a state has been set before the start.

        Args:
            context: The system's own.
            name: Name of the state.
        """
        flag = 1 + list(self.states).index(name)
        return bool(context.get_discrete_state(self._memory).value()[flag])

    def set_state(self, context: Context, name: str, value: np.ndarray) -> None:
        """Set a state; a state set before the start is not initialized.

        Args:
            context: The system's own.
            name: Name of the state.
            value: Value of the state.
        """
        variables = self._variables(context)
        variables[self.states[name]] = value
        variables[1 + list(self.states).index(name)] = 1.0
        self._set(context, variables)

    def wire(self, context: Context, name: str) -> np.ndarray:
        """Return the value of a wire, at the border or inside.

        Args:
            context: The system's own.
            name: Name of the output; in a network ``block.output``.
        """
        if name in self._state_wires:
            return self.state(context, self._state_wires[name])
        k, part = self._declared.position(name)
        value: np.ndarray = self._stages[k].Eval(context)[part]
        return value

    def start(self, context: Context) -> None:
        """Initialize the states, as a simulation does, in a context that is evaluated without one.

        Args:
            context: The system's own.
        """
        self._set(context, self._initial_state(context))

    def _variables(self, context: Context) -> np.ndarray:
        """Return all discrete variables, all groups one after another."""
        numbers = range(len(self._groups))
        return np.concatenate([context.get_discrete_state(k).value() for k in numbers])

    def _set(self, context: Context, variables: np.ndarray) -> None:
        for k, part in enumerate(self._groups):
            context.SetDiscreteState(k, variables[part])

    def _declare_stage(self, k: int, stage: Stage) -> CacheEntry:
        state_groups = [group for name, group in self._state_groups.items() if name in stage.states]

        def calc(context: Context, value: Value) -> None:
            functions = self._program(context)
            stage, bound = functions.stage(k)
            stage_values = [(j, self._stages[j].Eval(context)) for j in stage.stages]
            self._set_arguments(
                context, functions, stage.inputs, state_groups, stage.needs_at_start
            )
            for j, values in stage_values:
                functions.stage_results[j][:] = values[: len(functions.stage_results[j])]
            bound.evaluate()
            value.set_value(bound.results["result"].copy())

        needs = stage.needs | stage.needs_at_start
        sources = {self._inputs[s.name].ticket() for s in needs if s.kind == "input"}
        sources |= {
            self.discrete_state_ticket(group) for group in (self._memory, *dict(state_groups))
        }
        if TICK in needs:
            sources.add(self.time_ticket())
        size = stage.function.numel_out(0)
        producer = ValueProducer(allocate=lambda: Value(np.zeros(size)), calc=calc)
        return self.DeclareCacheEntry(f"stage {k}", producer, sources)

    def _declare_output(self, port: str) -> None:
        if port in self.network.state_outputs:
            group, _ = self._state_groups[self.network.state_outputs[port]]
            self.DeclareStateOutputPort(port, group)
            return
        k, part = self._declared.output(port)
        stage = self._stages[k]

        def calc(context: Context, output: BasicVector) -> None:
            output.SetFromVector(stage.Eval(context)[part])

        self.DeclareVectorOutputPort(
            port, part.stop - part.start, calc, prerequisites_of_calc={stage.ticket()}
        )

    def _program(self, context: Context) -> "BoundProgram":
        """Return the functions for the connected inputs."""
        left = _NOTHING
        if self._optional:
            left = frozenset(n for n in self._optional if not self._is_connected(context, n))
        if left not in self._programs:
            program = self._declared
            if left:
                assert self.block is not None  # a network leaves no input open
                program = Program.of(Network.of(self.block, left), self._declared)
            self._programs[left] = BoundProgram(program, self._declared.update_stage)
        return self._programs[left]

    def _is_connected(self, context: Context, name: str) -> bool:
        """Return whether an input has a value; this evaluates its source."""
        if name in self._being_evaluated:
            # the source is being evaluated, and depends on this input
            return True
        self._being_evaluated.add(name)
        try:
            return bool(self._inputs[name].HasValue(context))
        finally:
            self._being_evaluated.discard(name)

    def _set_arguments(
        self,
        context: Context,
        functions: "BoundProgram",
        inputs: Iterable[str],
        state_groups: Iterable[tuple[DiscreteStateIndex, slice]],
        needs_at_start: Needs | None = None,
    ) -> None:
        """Write states, tick and inputs into the functions' arguments."""
        state = context.get_discrete_state()
        memory = state.value(self._memory)
        if memory[_STARTED]:
            functions.x[: self._hidden] = memory[self._own]
            for group, part in state_groups:
                functions.x[part] = state.value(group)
        else:
            functions.x[:] = self._initial_state(context, needs_at_start)[self._x]
        functions.t[0] = last_tick(context.get_time(), self.period)
        for name in inputs:
            functions.u[name][:] = self._inputs[name].Eval(context)

    def _initial_state(self, context: Context, needs: Needs | None = None) -> np.ndarray:
        """Return the discrete state at the start.

        Args:
            context: The system's own.
            needs: Inputs to evaluate, if only states that depend on these are needed: others may
                depend on this system's own outputs.
        """
        functions = self._program(context)
        names = functions.program.initial_inputs
        needed = [needs is None or Source("input", name) in needs for name in names]
        values = [
            self._inputs[name].Eval(context) if is_needed else np.nan
            for name, is_needed in zip(names, needed, strict=True)
        ]
        for name, value in zip(functions.program.initial_inputs, values, strict=True):
            functions.u[name][:] = value
        before = self._variables(context)
        functions.x[:], functions.preset[:] = before[self._x], before[self._preset]
        functions.t[0] = last_tick(context.get_time(), self.period)
        functions.initial.evaluate()
        initial_state = np.zeros(len(before))
        initial_state[_STARTED], initial_state[self._x] = 1.0, functions.initial.results["x_start"]
        return initial_state

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        initial_state = self._initial_state(context)
        for k, part in enumerate(self._groups):
            state.set_value(k, initial_state[part])
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        later = self._later(context)
        state.get_mutable_value(self._memory)[self._own] = later[: self._hidden]
        for group, part in self._state_groups.values():
            state.get_mutable_value(group)[:] = later[part]

    def _later(self, context: Context) -> np.ndarray:
        """Return the states of the next tick."""
        if self._declared.update_stage is not None:
            found: np.ndarray = self._stages[self._declared.update_stage].Eval(context)
            return found[-self._declared.size :]
        functions = self._program(context)
        stage_values = [(k, self._stages[k].Eval(context)) for k in functions.program.update_stages]
        self._set_arguments(
            context, functions, functions.program.update_inputs, self._update_groups
        )
        for k, values in stage_values:
            functions.stage_results[k][:] = values
        functions.update.evaluate()
        return functions.update.results["x_next"]


def last_tick(time: float, period: float) -> int:
    """Return the number of the last tick; the tick at time zero is 0.

    Args:
        time: Present time [s], which may be a tick.
        period: Sampling time [s].
    """
    return math.floor(time / period + _ROUNDING)


def is_tick(time: float, period: float) -> bool:
    """Return whether blocks sample at an instant.

    Between two ticks only the states are valid: outputs from inputs that have moved on by part of a
    period are never used.

    Args:
        time: The instant [s].
        period: Sampling time [s].
    """
    return abs(time / period - round(time / period)) < _ROUNDING
