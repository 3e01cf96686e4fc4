"""Stages of a network: wires that depend on the same inputs, in an order of evaluation."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import casadi as ca

from pfsc_drake.blocks.network import Node, Source
from pfsc_drake.errors import InputError

Needs = frozenset[Source]


@dataclass(frozen=True)
class Stage:
    """Wires that depend on the same inputs.

    Attributes:
        function: Function of ``sources``, then the results of earlier ``stages``; one vector out.
        inputs: Names of the inputs among its arguments.
        states: Names of the states it depends on.
        stages: Numbers of the earlier stages among its arguments.
        needs: Sources of its results: inputs and tick.
        needs_at_start: The same before the start, when the states follow from the inputs.
        parts: Slices of the wires in the result.
    """

    function: ca.Function
    inputs: tuple[str, ...]
    states: frozenset[str]
    stages: tuple[int, ...]
    needs: Needs
    needs_at_start: Needs
    parts: Mapping[str, slice]


def evaluation_order(nodes: Collection[Node]) -> list[Node]:
    """Return nodes sorted such that each comes after those whose wires it takes.

    Args:
        nodes: All nodes that evaluate wires.

    Raises:
        InputError: If there is a loop.
    """
    maker = {name: node for node in nodes for name in node.results}
    order: dict[int, Node] = {}
    path: list[Node] = []

    def visit(node: Node) -> None:
        if id(node) in order:
            return
        if any(node is other for other in path):
            names = [other.results[0] for other in path]
            raise InputError(f"algebraic loop of outputs: {' -> '.join([*names, names[0]])}")
        path.append(node)
        for source in node.sources:
            if source.kind == "wire":
                visit(maker[source.name])
        path.pop()
        order[id(node)] = node

    for node in nodes:
        visit(node)
    return list(order.values())


def call_named(function: ca.Function, named: Mapping[str, ca.MX]) -> ca.MX:
    """Return the only result of a function.

    Args:
        function: The function.
        named: Its arguments by name.
    """
    return function.call([named[name] for name in function.name_in()])[0]


def names_of(sources: Iterable[Source], kind: str) -> tuple[str, ...]:
    """Return the names of sources of a kind, each once.

    Args:
        sources: Any.
        kind: Kind of the source.
    """
    return tuple(dict.fromkeys(source.name for source in sources if source.kind == kind))


def ends_of(sizes: Mapping[str, int]) -> list[int]:
    """Return the first index of each of consecutive vectors, and the end of the last.

    Args:
        sizes: Sizes of the vectors.
    """
    ends = [0]
    for size in sizes.values():
        ends.append(ends[-1] + size)
    return ends


def slices_of(sizes: Mapping[str, int]) -> dict[str, slice]:
    """Return the slices of consecutive vectors, by name.

    Args:
        sizes: Sizes of the vectors.
    """
    ends = ends_of(sizes)
    return {name: slice(a, b) for name, a, b in zip(sizes, ends, ends[1:], strict=False)}
