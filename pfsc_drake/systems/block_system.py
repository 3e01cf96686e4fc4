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

    At every tick, from time zero on, it remembers what the block's ``update`` says. Between ticks
    outputs follow the inputs. Before the simulation begins, states are what the block's
    ``initial`` says of the inputs at that moment; so whatever starts from another block's output
    starts from what that puts out at its own start, in whatever order Drake initializes them. A
    state that :meth:`set_state` has set before stays as it is.

    Ports:
        Those of the block.

    State:
        Discrete: whether the system has started, which states were set before that, and the states
        (:attr:`states` says where). States that are put out as they are make groups of their own,
        so that whoever reads them between ticks does so without Python.

    Args:
        block: The block or network.
        period: Sampling time [s].

    Attributes:
        block: The same; None of a network.
        network: What it does, all inputs connected.
        period: Sampling time [s].
        states: Where among the discrete variables each state is, all groups one after another.
    """

    def __init__(self, block: Block | Network, period: float) -> None:
        super().__init__()
        self.block = block if isinstance(block, Block) else None
        self.period = period
        whole = self.network = block if isinstance(block, Network) else Network.of(block)
        declared = Program.of(whole)
        self._programs: dict[frozenset[str], BoundProgram] = {}
        self._declared = declared
        # [started, which are set, states], of these in groups of their own what is shown
        first = 1 + len(declared.states)
        self._preset, self._x = slice(1, first), slice(first, first + declared.size)
        self.states = {
            name: slice(first + part.start, first + part.stop)
            for name, part in declared.states.items()
        }
        shown = {name: declared.states[name] for name in whole.shown.values()}
        self._hidden = declared.size - sum(part.stop - part.start for part in shown.values())
        self._own = slice(first, first + self._hidden)
        self._memory = self.DeclareDiscreteState(self._own.stop)
        self._shown = {
            name: (self.DeclareDiscreteState(part.stop - part.start), part)
            for name, part in sorted(shown.items(), key=lambda item: item[1].start)
        }
        # shown states that the next ones depend on
        self._kept = [p for name, p in self._shown.items() if name in declared.update_states]
        self._groups = [slice(0, self._own.stop)]
        self._groups += [self.states[name] for name in self._shown]
        self._inputs = {
            name: self.DeclareVectorInputPort(name, port.size)
            for name, port in whole.inputs.items()
        }
        self._shown_wires = {whole.outputs[port]: name for port, name in whole.shown.items()}
        self._optional = [name for name, port in whole.inputs.items() if port.optional]
        self._asked: set[str] = set()
        self._stages: list[CacheEntry] = []
        for k, stage in enumerate(stages_of(declared, declared.update_stage)):
            self._stages.append(self._declare_stage(k, stage))
        for port in whole.outputs:
            self._declare_output(port)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        if declared.size:
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def full_name(self, name: str) -> str:
        """Return ``block.name`` of a state or a wire; those of a network are called so already.

        Args:
            name: Name of the state or wire.
        """
        return name if self.block is None else f"{self.get_name()}.{name}"

    def state(self, context: Context, name: str) -> np.ndarray:
        """Return a state, as it is set or remembered.

        Args:
            context: The system's own.
            name: Name of the state.
        """
        if name in self._shown:
            group, _ = self._shown[name]
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
        """Set a state; before the start it stays when the simulation begins.

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
        """Return what a block puts out, at the border or inside.

        Args:
            context: The system's own.
            name: Name of the output; in a network ``block.output``.
        """
        if name in self._shown_wires:
            return self.state(context, self._shown_wires[name])
        k, part = self._declared.place(name)
        value: np.ndarray = self._stages[k].Eval(context)[part]
        return value

    def start(self, context: Context) -> None:
        """Begin, as a simulation does, for whoever evaluates a context without one.

        Args:
            context: The system's own.
        """
        self._set(context, self._begun(context))

    def _variables(self, context: Context) -> np.ndarray:
        """Return all that is remembered, all groups one after another."""
        numbers = range(len(self._groups))
        return np.concatenate([context.get_discrete_state(k).value() for k in numbers])

    def _set(self, context: Context, variables: np.ndarray) -> None:
        for k, part in enumerate(self._groups):
            context.SetDiscreteState(k, variables[part])

    def _declare_stage(self, k: int, stage: Stage) -> CacheEntry:
        shown = [place for name, place in self._shown.items() if name in stage.states]

        def calc(context: Context, value: Value) -> None:
            functions = self._program(context)
            stage, bound = functions.stage(k)
            made = [(j, self._stages[j].Eval(context)) for j in stage.stages]
            self._given(context, functions, stage.inputs, shown, stage.needs_at_start)
            for j, values in made:
                functions.made[j][:] = values[: len(functions.made[j])]
            bound.evaluate()
            value.set_value(bound.results["result"].copy())

        needs = stage.needs | stage.needs_at_start
        sources = {self._inputs[s.name].ticket() for s in needs if s.kind == "input"}
        sources |= {self.discrete_state_ticket(group) for group in (self._memory, *dict(shown))}
        if TICK in needs:
            sources.add(self.time_ticket())
        size = stage.function.numel_out(0)
        producer = ValueProducer(allocate=lambda: Value(np.zeros(size)), calc=calc)
        return self.DeclareCacheEntry(f"stage {k}", producer, sources)

    def _declare_output(self, port: str) -> None:
        if port in self.network.shown:
            group, _ = self._shown[self.network.shown[port]]
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
        """Return the functions for what is connected."""
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
        """Return whether an input has a value; to ask evaluates what it is connected to."""
        if name in self._asked:
            # it was asked for by way of this very input
            return True
        self._asked.add(name)
        try:
            return bool(self._inputs[name].HasValue(context))
        finally:
            self._asked.discard(name)

    def _given(
        self,
        context: Context,
        functions: "BoundProgram",
        inputs: Iterable[str],
        shown: Iterable[tuple[DiscreteStateIndex, slice]],
        needs_at_start: Needs | None = None,
    ) -> None:
        """Write states, tick and inputs into the functions' arguments."""
        state = context.get_discrete_state()
        memory = state.value(self._memory)
        if memory[_STARTED]:
            functions.x[: self._hidden] = memory[self._own]
            for group, part in shown:
                functions.x[part] = state.value(group)
        else:
            functions.x[:] = self._begun(context, needs_at_start)[self._x]
        functions.t[0] = last_tick(context.get_time(), self.period)
        for name in inputs:
            functions.u[name][:] = self._inputs[name].Eval(context)

    def _begun(self, context: Context, needs: Needs | None = None) -> np.ndarray:
        """Return the discrete state as it is at the start.

        Args:
            context: The system's own.
            needs: Inputs to look at, where only states that depend on these are asked for: others
                may come from what this system itself puts out.
        """
        functions = self._program(context)
        names = functions.program.initial_inputs
        wanted = [needs is None or Source("input", name) in needs for name in names]
        given = [
            self._inputs[name].Eval(context) if is_wanted else np.nan
            for name, is_wanted in zip(names, wanted, strict=True)
        ]
        for name, value in zip(functions.program.initial_inputs, given, strict=True):
            functions.u[name][:] = value
        before = self._variables(context)
        functions.x[:], functions.preset[:] = before[self._x], before[self._preset]
        functions.t[0] = last_tick(context.get_time(), self.period)
        functions.initial.evaluate()
        begun = np.zeros(len(before))
        begun[_STARTED], begun[self._x] = 1.0, functions.initial.results["x_start"]
        return begun

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        begun = self._begun(context)
        for k, part in enumerate(self._groups):
            state.set_value(k, begun[part])
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        later = self._later(context)
        state.get_mutable_value(self._memory)[self._own] = later[: self._hidden]
        for group, part in self._shown.values():
            state.get_mutable_value(group)[:] = later[part]

    def _later(self, context: Context) -> np.ndarray:
        """Return the states of the next tick."""
        if self._declared.update_stage is not None:
            found: np.ndarray = self._stages[self._declared.update_stage].Eval(context)
            return found[-self._declared.size :]
        functions = self._program(context)
        made = [(k, self._stages[k].Eval(context)) for k in functions.program.update_stages]
        self._given(context, functions, functions.program.update_inputs, self._kept)
        for k, values in made:
            functions.made[k][:] = values
        functions.update.evaluate()
        return functions.update.results["x_next"]


def last_tick(time: float, period: float) -> int:
    """Return the number of the last tick, that at time zero being 0.

    Args:
        time: The present instant [s], which may be a tick.
        period: Sampling time [s].
    """
    return math.floor(time / period + _ROUNDING)


def is_tick(time: float, period: float) -> bool:
    """Return whether blocks sample at an instant.

    Between two ticks they know their memory alone: what they would make of their inputs there,
    which have moved on by part of a period, is nothing that they ever see.

    Args:
        time: The instant [s].
        period: Sampling time [s].
    """
    return abs(time / period - round(time / period)) < _ROUNDING
