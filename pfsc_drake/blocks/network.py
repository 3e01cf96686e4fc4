"""Blocks, one or many, as functions between ports, states and wires."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.compiled.dependencies import dependencies


class Source(NamedTuple):
    """Where an argument comes from.

    Attributes:
        kind: ``input``, ``state``, ``wire``, ``tick`` or ``parameter``.
        name: Which; of several parameters as one vector all names, with blanks between them.
    """

    kind: str
    name: str


TICK = Source("tick", "tick")
# symbols that no argument brings are parameters
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
    """What one block does, or many that are wired.

    Attributes:
        inputs: Ports at the border; none that is optional is left open.
        outputs: Wires that are led out, by port.
        units: Units of these ports.
        states: Sizes by name.
        wires: Sizes by name.
        nodes: What evaluates wires, each by one node.
        updates: What evaluates states at the next tick; others stay.
        initials: What evaluates states at the start; others are zero.
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
        """Return the network that a block is.

        Args:
            block: The block.
            unconnected: Optional inputs that nothing is connected to.

        Raises:
            ValueError: If the block's methods return what it has not declared.
        """
        # the same nodes whatever is connected
        groups = [node.results for node in cls.of(block).nodes] if unconnected else []
        return cls._grouped(block, frozenset(unconnected), groups)

    @classmethod
    @once_per_content(300)
    def _grouped(
        cls, block: Block, unconnected: frozenset[str], groups: list[tuple[str, ...]]
    ) -> "Network":
        """Return the network of a block whose nodes are known, or are to be found if none is."""
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

    def restricted(self, outputs: Collection[str]) -> "Network":
        """Return what is needed for some of the outputs, in their order.

        Args:
            outputs: Names of the outputs.
        """
        made: dict[Source, set[Source]] = {}
        for kind, nodes in (("wire", self.nodes), ("state", (*self.updates, *self.initials))):
            for node in nodes:
                for name in node.results:
                    made.setdefault(Source(kind, name), set()).update(node.sources)
        found = needed = {Source("wire", self.outputs[name]) for name in outputs}
        while needed:
            needed = set().union(*(made.get(source, ()) for source in needed)) - found
            found = found | needed

        def kept(nodes: tuple[Node, ...], kind: str) -> tuple[Node, ...]:
            return tuple(n for n in nodes if any(Source(kind, name) in found for name in n.results))

        nodes = kept(self.nodes, "wire")
        wires = {name for node in nodes for name in node.results}
        return Network(
            {name: p for name, p in self.inputs.items() if Source("input", name) in found},
            {name: self.outputs[name] for name in outputs},
            {name: self.units.get(name, "") for name in outputs},
            {name: n for name, n in self.states.items() if Source("state", name) in found},
            {name: n for name, n in self.wires.items() if name in wires},
            nodes,
            kept(self.updates, "state"),
            kept(self.initials, "state"),
        )

    @cached_property
    def shown(self) -> dict[str, str]:
        """Outputs at the border that are a state as it is, zero at the start, by port."""
        begun = {name for node in self.initials for name in node.results}
        wires: dict[str, str] = {}
        for node in self.nodes:
            wires |= _shown(node)
        return {
            port: wires[wire]
            for port, wire in self.outputs.items()
            if wire in wires and wires[wire] not in begun
        }


@dataclass
class Wiring:
    """How blocks are wired.

    Attributes:
        networks: By name.
        connections: What feeds an input: ``(name, input)`` of an output ``(name, output)``, or the
            name of an input at the border.
        outputs: Ports at the border, and which output ``(name, output)`` they are.
    """

    networks: dict[str, Network] = field(default_factory=dict)
    connections: dict[tuple[str, str], tuple[str, str] | str] = field(default_factory=dict)
    outputs: dict[str, tuple[str, str]] = field(default_factory=dict)

    def network(self) -> Network:
        """Return all of them as one; states and wires are called ``block.name``.

        Raises:
            ValueError: If an input is not fed.
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
                into += [_renamed(node, name, fed) for node in kind]
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


def _shown(node: Node) -> dict[str, str]:
    """Return those of a node's results that are states as they are, by name."""
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


def _renamed(node: Node, prefix: str, fed: Mapping[str, Source]) -> Node:
    """Return a node of a part as one of the whole."""
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
    """Refuse what a method returns that has not been declared."""
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
        block: Whose method it is.
        method: Its name.
        known: Symbols of all arguments.
        found: The results.
        groups: Which results are one function; if there are none, those that need the same inputs.
    """
    if not found:
        return ()
    sources, names = list(known), list(found)
    results = [ca.densify(ca.MX(value)) for value in found.values()]
    whole = ca.Function(f"{type(block).__name__}_{method}", list(known.values()), results)
    arguments: list[Any] = list(known.values())
    expanded = _expanded(whole) if block.expands else None
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
    """Return one function of some results, of the arguments that they need."""
    used = [i for i in range(len(sources)) if any(needs[row, i] for row in rows)]
    chosen = ca.cse([results[row] for row in rows])
    given, sources = [arguments[i] for i in used], [sources[i] for i in used]
    function = ca.Function(title, given, chosen, _FREE)
    if function.has_free():
        parameters = function.free_sx()
        function = ca.Function(title, [*given, ca.vertcat(*parameters)], chosen)
        sources.append(Source("parameter", " ".join(p.name() for p in parameters)))
    return Node(function, tuple(sources), tuple(names[row] for row in rows))


def _expanded(function: ca.Function) -> ca.Function | None:
    """Return a function of scalars, or None if there is none."""
    try:
        return function.expand(function.name(), _FREE)
    except RuntimeError:
        return None


def _refuse_parameters(function: ca.Function) -> None:
    """Refuse symbols that are no arguments where they cannot become some."""
    for inner in function.find_functions():
        if inner.has_free():
            raise ValueError(f"{function.name()}: {inner.name()} has parameters without values")
