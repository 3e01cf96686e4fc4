"""Blocks, single or connected, as functions between ports, states and wires."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.compiled.dependencies import dependencies


class Source(NamedTuple):
    """The source of an argument.

    Attributes:
        kind: ``input``, ``state``, ``wire``, ``tick`` or ``parameter``.
        name: Its name; of several parameters as one vector all names, separated by blanks.
    """

    kind: str
    name: str


TICK = Source("tick", "tick")
# free symbols become parameters
_FREE = {"allow_free": True}


@dataclass(frozen=True)
class Node:
    """A function in a network.

    Attributes:
        function: The function; vectors in, vectors out.
        sources: Sources of its arguments.
        results: Names of wires, or of states.
    """

    function: ca.Function
    sources: tuple[Source, ...]
    results: tuple[str, ...]


@dataclass(frozen=True)
class Network:
    """A block, or several connected blocks, as functions.

    Attributes:
        inputs: Ports at the border, all of them connected.
        outputs: Wires of the output ports at the border, by port.
        units: Units of these ports.
        states: Sizes by name.
        wires: Sizes by name.
        nodes: Functions of the wires, each wire in exactly one of them.
        updates: Functions of the states at the next tick; other states stay the same.
        initials: Functions of the states at the start; other states are zero.
    """

    inputs: Mapping[str, Port]
    outputs: Mapping[str, str]
    units: Mapping[str, str]
    states: Mapping[str, int]
    wires: Mapping[str, int]
    nodes: tuple[Node, ...]
    updates: tuple[Node, ...] = ()
    initials: tuple[Node, ...] = ()

    @classmethod
    def of(cls, block: Block, unconnected: Collection[str] = ()) -> "Network":
        """Return a block as a network.

        Args:
            block: The block.
            unconnected: Optional inputs that are not connected.

        Raises:
            ValueError: If the block's methods return undeclared values.
        """
        # the same nodes whatever is connected
        groups = [node.results for node in cls.of(block).nodes] if unconnected else []
        return cls._of_groups(block, frozenset(unconnected), groups)

    @classmethod
    @once_per_content(300)
    def _of_groups(
        cls, block: Block, unconnected: frozenset[str], groups: list[tuple[str, ...]]
    ) -> "Network":
        """Return the network of a block with known groups of results; none to find them."""
        inputs = {name: p for name, p in block.inputs.items() if name not in unconnected}
        x, u = _symbols(block.states), _symbols({name: p.size for name, p in inputs.items()})
        sizes = {name: p.size for name, p in block.outputs.items()} | dict(block.inner)
        y = _symbols(sizes)
        t = ca.MX.sym("t")
        of_x, of_y = Values(**x), Values(**y)
        of_u = Values(**u, **dict.fromkeys(unconnected))
        known = {Source("input", name): symbol for name, symbol in u.items()}
        known[TICK] = t
        begin = block.initial(of_u, t)
        _check(block, "initial", begin, block.states)
        initials = _nodes(block, "initial", known, begin, [tuple(begin)])
        known |= {Source("state", name): symbol for name, symbol in x.items()}
        outputs = block.output(of_x, of_u, t)
        _check(block, "output", outputs, sizes, every=True)
        nodes = _nodes(block, "output", known, outputs, groups)
        known |= {Source("wire", name): symbol for name, symbol in y.items()}
        later = block.update(of_x, of_u, of_y, t)
        _check(block, "update", later, block.states)
        updates = _nodes(block, "update", known, later, [tuple(later)])
        return cls(
            inputs,
            {name: name for name in block.outputs},
            {name: p.unit for name, p in block.outputs.items()},
            dict(block.states),
            sizes,
            nodes,
            updates,
            initials,
        )

    def subnetwork(self, outputs: Collection[str]) -> "Network":
        """Return the part of the network that some of the outputs need, in their order.

        Args:
            outputs: Names of the outputs.
        """
        sources_of: dict[Source, set[Source]] = {}
        for kind, nodes in (("wire", self.nodes), ("state", (*self.updates, *self.initials))):
            for node in nodes:
                for name in node.results:
                    sources_of.setdefault(Source(kind, name), set()).update(node.sources)
        found = needed = {Source("wire", self.outputs[name]) for name in outputs}
        while needed:
            needed = set().union(*(sources_of.get(source, ()) for source in needed)) - found
            found = found | needed

        def select(nodes: tuple[Node, ...], kind: str) -> tuple[Node, ...]:
            return tuple(n for n in nodes if any(Source(kind, name) in found for name in n.results))

        nodes = select(self.nodes, "wire")
        wires = {name for node in nodes for name in node.results}
        return Network(
            {name: p for name, p in self.inputs.items() if Source("input", name) in found},
            {name: self.outputs[name] for name in outputs},
            {name: self.units.get(name, "") for name in outputs},
            {name: n for name, n in self.states.items() if Source("state", name) in found},
            {name: n for name, n in self.wires.items() if name in wires},
            nodes,
            select(self.updates, "state"),
            select(self.initials, "state"),
        )

    @cached_property
    def state_outputs(self) -> dict[str, str]:
        """States that are outputs at the border without change and begin at zero, by port."""
        initialized = {name for node in self.initials for name in node.results}
        wires: dict[str, str] = {}
        for node in self.nodes:
            wires |= _state_results(node)
        return {
            port: wires[wire]
            for port, wire in self.outputs.items()
            if wire in wires and wires[wire] not in initialized
        }


@dataclass
class Wiring:
    """Connections of blocks.

    Attributes:
        networks: Networks by name.
        connections: Source of an input ``(name, input)``: an output ``(name, output)``, or the name
            of an input at the border.
        outputs: Output ``(name, output)`` of each port at the border.
    """

    networks: dict[str, Network] = field(default_factory=dict)
    connections: dict[tuple[str, str], tuple[str, str] | str] = field(default_factory=dict)
    outputs: dict[str, tuple[str, str]] = field(default_factory=dict)

    def network(self) -> Network:
        """Return all blocks as one network; states and wires are named ``block.name``.

        Raises:
            ValueError: If an input is not connected.
        """
        inputs: dict[str, Port] = {}
        states: dict[str, int] = {}
        wires: dict[str, int] = {}
        nodes: list[Node] = []
        updates: list[Node] = []
        initials: list[Node] = []
        for name, part in self.networks.items():
            fed = {}
            for port, vector in part.inputs.items():
                source = self.connections.get((name, port))
                if source is None:
                    raise ValueError(f"{name}.{port}: nothing is connected to this input")
                fed[port] = self._source(source)
                if isinstance(source, str):
                    inputs.setdefault(source, replace(vector, optional=False))
            states |= {f"{name}.{key}": size for key, size in part.states.items()}
            wires |= {f"{name}.{key}": size for key, size in part.wires.items()}
            for kind, into in (
                (part.nodes, nodes),
                (part.updates, updates),
                (part.initials, initials),
            ):
                into += [_prefix_names(node, name, fed) for node in kind]
        outputs = {
            port: f"{name}.{self.networks[name].outputs[output]}"
            for port, (name, output) in self.outputs.items()
        }
        units = {
            port: self.networks[name].units.get(output, "")
            for port, (name, output) in self.outputs.items()
        }
        return Network(
            inputs, outputs, units, states, wires, tuple(nodes), tuple(updates), tuple(initials)
        )

    def _source(self, source: tuple[str, str] | str) -> Source:
        if isinstance(source, str):
            return Source("input", source)
        name, output = source
        return Source("wire", f"{name}.{self.networks[name].outputs[output]}")


def _state_results(node: Node) -> dict[str, str]:
    """Return the results of a node that are unchanged states, by name."""
    function = node.function
    of_states = all(source.kind == "state" for source in node.sources)
    if not of_states or function.class_name() != "SXFunction":
        return {}
    states = [ca.SX.sym("x", function.numel_in(i)) for i in range(function.n_in())]
    return {
        name: source.name
        for name, result in zip(node.results, function.call(states), strict=True)
        for source, state in zip(node.sources, states, strict=True)
        if result.shape == state.shape and ca.is_equal(result, state)
    }


def _prefix_names(node: Node, prefix: str, fed: Mapping[str, Source]) -> Node:
    """Return a node of a part as a node of the whole network."""
    sources = tuple(
        fed[source.name]
        if source.kind == "input"
        else source
        if source.kind in ("tick", "parameter")
        else Source(source.kind, f"{prefix}.{source.name}")
        for source in node.sources
    )
    return Node(node.function, sources, tuple(f"{prefix}.{name}" for name in node.results))


def _symbols(sizes: Mapping[str, int]) -> dict[str, ca.MX]:
    return {name: ca.MX.sym(name, size) for name, size in sizes.items()}


def _check(
    block: Block, method: str, found: dict[str, Any], sizes: Mapping[str, int], every: bool = False
) -> None:
    """Refuse undeclared results of a method."""
    name = type(block).__name__
    for key, value in found.items():
        if key not in sizes:
            raise ValueError(f"{name}.{method}: {key!r} is none of {', '.join(sizes)}")
        shape = ca.MX(value).shape
        if shape != (sizes[key], 1):
            raise ValueError(f"{name}.{method}: {key} is {shape}; declared as ({sizes[key]}, 1)")
    missing = [key for key in sizes if key not in found]
    if every and missing:
        raise ValueError(f"{name}.{method}: {', '.join(missing)} not returned")


def _nodes(
    block: Block,
    method: str,
    known: Mapping[Source, ca.MX],
    found: Mapping[str, Any],
    groups: Sequence[tuple[str, ...]],
) -> tuple[Node, ...]:
    """Return the functions of a method's results.

    Args:
        block: Block of the method.
        method: Its name.
        known: Symbols of all arguments.
        found: The results.
        groups: Results of each function; if there are none, one function for all with the same
            inputs.
    """
    if not found:
        return ()
    sources, names = list(known), list(found)
    results = [ca.densify(ca.MX(value)) for value in found.values()]
    whole = ca.Function(f"{type(block).__name__}_{method}", list(known.values()), results)
    arguments: list[Any] = list(known.values())
    expanded = _expand(whole) if block.expands else None
    if expanded is None:
        _refuse_parameters(whole)
    if expanded is not None:
        whole = expanded
        arguments = [ca.SX.sym(source.name, *symbol.shape) for source, symbol in known.items()]
        results = list(whole.call(arguments))
    needs = dependencies(whole)
    rows_of = [[names.index(name) for name in group] for group in groups]
    if not groups:
        by_needs: dict[frozenset[int], list[int]] = {}
        outer = [i for i, source in enumerate(sources) if source.kind in ("input", "tick")]
        for row in range(len(names)):
            by_needs.setdefault(frozenset(i for i in outer if needs[row, i]), []).append(row)
        rows_of = list(by_needs.values())
    return tuple(
        _node(f"{whole.name()}_{k}", rows, needs, sources, arguments, names, results)
        for k, rows in enumerate(rows_of)
    )


def _node(
    title: str,
    rows: list[int],
    needs: Any,
    sources: list[Source],
    arguments: list[Any],
    names: list[str],
    results: list[Any],
) -> Node:
    """Return one function of some results and of the arguments that they need."""
    used = [i for i in range(len(sources)) if any(needs[row, i] for row in rows)]
    chosen = ca.cse([results[row] for row in rows])
    symbols, sources = [arguments[i] for i in used], [sources[i] for i in used]
    function = ca.Function(title, symbols, chosen, _FREE)
    if function.has_free():
        parameters = function.free_sx()
        function = ca.Function(title, [*symbols, ca.vertcat(*parameters)], chosen)
        sources.append(Source("parameter", " ".join(p.name() for p in parameters)))
    return Node(function, tuple(sources), tuple(names[row] for row in rows))


def _expand(function: ca.Function) -> ca.Function | None:
    """Return a function of scalars, or None if it cannot be expanded."""
    try:
        return function.expand(function.name(), _FREE)
    except RuntimeError:
        return None


def _refuse_parameters(function: ca.Function) -> None:
    """Refuse free symbols where they cannot become parameters."""
    for inner in function.find_functions():
        if inner.has_free():
            raise ValueError(f"{function.name()}: {inner.name()} has parameters without values")
