"""A network as few functions: stages of outputs, update and initial states."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca

from pfsc_drake.blocks.network import TICK, Network, Node, Source
from pfsc_drake.blocks.stage import (
    Stage,
    call_named,
    ends_of,
    evaluation_order,
    names_of,
    slices_of,
)
from pfsc_drake.blocks.wire_dependencies import Dependencies
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError


class Program:
    """A network as functions of one state vector.

    All functions take ``x`` (all states), ``t`` (the tick), the inputs by name that they need, and
    ``stage_k`` of the stages that they need. Nothing is evaluated in two of them.

    Args:
        network: The network.
        like: Program of the same block with more inputs, whose stages are reused.

    Attributes:
        network: The same.
        states: Slices of the states in ``x``; states that are outputs without change come last.
        size: Size of ``x``.
        stages: Stages in an order of evaluation.
        update: ``x`` of the next tick, called ``x_next``.
        update_inputs, update_states, update_stages: Its arguments.
        update_stage: Number of the stage that needs everything that the update needs, so that both
            can be one function, see :meth:`with_update`; None if there is none.
        initial: ``x`` at the start, called ``x_start``, of ``x``, ``preset`` (a flag for each state
            by name; nonzero to keep its value in ``x``), ``t`` and ``initial_inputs``.

    Raises:
        InputError: If outputs depend on themselves within a tick.
    """

    def __init__(self, network: Network, like: "Program | None" = None) -> None:
        self.network, self._like = network, like
        self._with_update: dict[int, Stage] = {}
        shown = set(network.state_outputs.values())
        sizes = dict(sorted(network.states.items(), key=lambda item: item[0] in shown))
        self.states = slices_of(sizes)
        self.size = sum(sizes.values())
        self._x, self._t = ca.MX.sym("x", self.size), ca.MX.sym("t")
        self._u = {name: ca.MX.sym(name, port.size) for name, port in network.inputs.items()}
        values = ca.vertsplit(self._x, ends_of(sizes)) if self.size else []
        self._states = dict(zip(self.states, values, strict=True))
        self._dependencies = Dependencies(network)
        self.stages, self._stage_of = self._stages(self._groups())
        self._stage_results = [
            ca.MX.sym(f"stage_{k}", stage.function.numel_out(0))
            for k, stage in enumerate(self.stages)
        ]
        self._make_update()
        self.update_stage = self._find_update_stage()
        self.initial, self.initial_inputs = _initial_function(self)

    @classmethod
    @once_per_content()
    def of(cls, network: Network, like: "Program | None" = None) -> "Program":
        """Return the program of a network, the same one for an equal network.

        Args:
            network: The network.
            like: Program of the same block with more inputs, whose stages are reused.

        Raises:
            InputError: If outputs depend on themselves within a tick.
        """
        return cls(network, like)

    def __content__(self) -> object:
        """Return everything that determines the functions."""
        return self.network, self._like

    def output(self, output: str) -> tuple[int, slice]:
        """Return the stage that evaluates an output at the border, and its slice in the result.

        Args:
            output: Name of the port.
        """
        return self.position(self.network.outputs[output])

    def position(self, wire: str) -> tuple[int, slice]:
        """Return the stage that evaluates a wire, and its slice in the result.

        Args:
            wire: Its name.
        """
        k = self._stage_of[wire]
        return k, self.stages[k].parts[wire]

    def step(self) -> ca.Function:
        """Return one function of a whole tick.

        ``(x, t, inputs ..) -> (x_next, outputs ..)``, by name.
        """
        results: list[ca.MX] = []
        arguments = {"x": self._x, "t": self._t} | self._u
        for k, stage in enumerate(self.stages):
            named = arguments | {f"stage_{j}": results[j] for j in stage.stages}
            results.append(call_named(self.stages[k].function, named))
        named = arguments | {f"stage_{j}": results[j] for j in self.update_stages}
        outputs = {}
        for port in self.network.outputs:
            k, part = self.output(port)
            outputs[port] = results[k][part]
        return ca.Function(
            "step",
            list(arguments.values()),
            [call_named(self.update, named), *outputs.values()],
            list(arguments),
            ["x_next", *outputs],
            # an input and an output may have the same name
            {"allow_duplicate_io_names": True},
        )

    def with_update(self, k: int) -> Stage:
        """Return a stage that has ``x_next`` behind its results.

        Args:
            k: The stage, :attr:`update_stage` of this program or of one with more inputs.
        """
        if k not in self._with_update:
            self._with_update[k] = self._combine_with_update(k)
        return self._with_update[k]

    def _combine_with_update(self, k: int) -> Stage:
        stage = self.stages[k]
        arguments = {*stage.function.name_in(), *self.update.name_in()}
        inputs = {name: symbol for name, symbol in self._u.items() if name in arguments}
        stages = tuple(sorted({*stage.stages, *self.update_stages} - {k}))
        named = {"x": self._x, "t": self._t} | inputs
        named |= {f"stage_{j}": self._stage_results[j] for j in stages}
        result = call_named(stage.function, named)
        later = call_named(self.update, named | {f"stage_{k}": result})
        function = ca.Function(
            f"stage_{k}_and_update",
            list(named.values()),
            [ca.vertcat(result, later)],
            list(named),
            ["result"],
        )
        states = stage.states | self.update_states
        return replace(stage, function=function, inputs=tuple(inputs), states=states, stages=stages)

    def _find_update_stage(self) -> int | None:
        nodes = self.network.updates
        for k in reversed(range(len(self.stages) if self.size else 0)):
            stage = self.stages[k]
            needs = {False: stage.needs, True: stage.needs_at_start}
            fits = all(
                self._dependencies.of_source(source, at_start=begin) <= needs[begin]
                for begin in needs
                for node in nodes
                for source in node.sources
            )
            if fits and all(j <= k for j in self.update_stages):
                return k
        return None

    def _groups(self) -> list[list[Node]]:
        """Return the nodes of each stage."""
        order = evaluation_order(self.network.nodes)
        if self._like is None:
            return self._dependencies.groups(order)
        stage_of, numbers = self._like._stage_of, range(len(self._like.stages))
        return [[node for node in order if stage_of[node.results[0]] == k] for k in numbers]

    def _stages(self, groups: list[list[Node]]) -> tuple[list[Stage], dict[str, int]]:
        """Return the stages of groups of nodes, and the stage of each wire."""
        stages: list[Stage] = []
        stage_of: dict[str, int] = {}
        wire_values: dict[str, ca.MX] = {}
        vectors: list[ca.MX] = []
        for nodes in groups:
            inside: dict[str, ca.MX] = {}
            for node in nodes:
                results = node.function.call(
                    [self._value(source, inside | wire_values) for source in node.sources]
                )
                inside |= dict(zip(node.results, results, strict=True))
            sources = [s for node in nodes for s in node.sources]
            earlier = sorted(
                {stage_of[s.name] for s in sources if s.kind == "wire" and s.name not in inside}
            )
            inputs = names_of(sources, "input")
            k = len(stages)
            function = ca.Function(
                f"stage_{k}",
                [self._x, self._t, *(self._u[name] for name in inputs)]
                + [vectors[j] for j in earlier],
                [ca.vertcat(*inside.values())],
                ["x", "t", *inputs, *(f"stage_{j}" for j in earlier)],
                ["result"],
            )
            needs, at_start = (
                frozenset().union(*(self._dependencies.of(node, at_start=begin) for node in nodes))
                for begin in (False, True)
            )
            parts = slices_of({name: self.network.wires[name] for name in inside})
            states = frozenset(s.name for s in sources if s.kind == "state")
            stages.append(Stage(function, inputs, states, tuple(earlier), needs, at_start, parts))
            vectors.append(ca.MX.sym(f"stage_{k}", function.numel_out(0)))
            wire_values |= {name: vectors[k][part] for name, part in parts.items()}
            stage_of |= dict.fromkeys(inside, k)
        return stages, stage_of

    def _value(self, source: Source, wires: Mapping[str, ca.MX]) -> ca.MX:
        if source.kind == "state":
            return self._states[source.name]
        if source.kind == "input":
            return self._u[source.name]
        if source.kind == "parameter":  # without a value in a simulation
            return ca.MX.nan(len(source.name.split()))
        return self._t if source == TICK else wires[source.name]

    def _make_update(self) -> None:
        nodes = self.network.updates
        sources = [source for node in nodes for source in node.sources]
        wires = {s.name for s in sources if s.kind == "wire"}
        changed = {name for node in nodes for name in node.results}
        self.update_inputs = names_of(sources, "input")
        self.update_states = frozenset(names_of(sources, "state")) | (set(self.states) - changed)
        self.update_stages = tuple(sorted({self._stage_of[name] for name in wires}))
        wire_values = {
            name: self._stage_results[k][self.stages[k].parts[name]]
            for name, k in self._stage_of.items()
            if name in wires
        }
        later = dict(self._states)
        for node in nodes:
            results = node.function.call(
                [self._value(source, wire_values) for source in node.sources]
            )
            later |= dict(zip(node.results, results, strict=True))
        self.update = ca.Function(
            "update",
            [self._x, self._t, *(self._u[name] for name in self.update_inputs)]
            + [self._stage_results[k] for k in self.update_stages],
            [ca.vertcat(*later.values())],
            ["x", "t", *self.update_inputs, *(f"stage_{k}" for k in self.update_stages)],
            ["x_next"],
        )


def _initial_function(program: Program) -> tuple[ca.Function, tuple[str, ...]]:
    """Return the function of the initial states, and the names of its inputs."""
    preset = ca.MX.sym("preset", len(program.states))
    flags = dict(zip(program.states, ca.vertsplit(preset), strict=True)) if program.states else {}
    initial_values: dict[str, ca.MX] = {}
    wires: dict[str, ca.MX] = {}
    pending: set[str] = set()
    used: set[str] = set()

    def evaluate(node: Node) -> list[ca.MX]:
        arguments = []
        for source in node.sources:
            if source.kind == "state":
                arguments.append(start_of(source.name))
            elif source.kind == "wire":
                arguments.append(wire_of(source.name))
            else:
                used.update({source.name} if source.kind == "input" else ())
                arguments.append(program._value(source, {}))
        return list(node.function.call(arguments))

    def wire_of(name: str) -> ca.MX:
        if name not in wires:
            if name in pending:
                raise InputError(
                    f"{name}: depends on itself at the start, through {', '.join(pending)}"
                )
            pending.add(name)
            node = program._dependencies.maker[name]
            wires.update(zip(node.results, evaluate(node), strict=True))
            pending.discard(name)
        return wires[name]

    def start_of(name: str) -> ca.MX:
        if name not in initial_values:
            node = program._dependencies.starter.get(name)
            size = program.network.states[name]
            if node is None:
                found = {name: ca.MX(ca.DM.zeros(size))}
            else:
                found = dict(zip(node.results, evaluate(node), strict=True))
            for key, value in found.items():
                initial_values[key] = ca.if_else(flags[key], program._states[key], value)
        return initial_values[name]

    start = [start_of(name) for name in program.states]
    inputs = tuple(name for name in program._u if name in used)
    function = ca.Function(
        "initial",
        [program._x, preset, program._t, *(program._u[name] for name in inputs)],
        [ca.vertcat(*start)],
        ["x", "preset", "t", *inputs],
        ["x_start"],
    )
    return function, inputs
