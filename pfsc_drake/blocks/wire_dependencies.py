"""Inputs that the wires of a network depend on, and groups of wires evaluated together."""

from collections.abc import Sequence

from pfsc_drake.blocks.network import Network, Node, Source
from pfsc_drake.blocks.stage import Needs


class Dependencies:
    """Inputs that each node of a network depends on, now and at the start.

    Args:
        network: The network.

    Attributes:
        maker: The node that evaluates each wire.
        starter: The node that evaluates each initial state; states that begin at zero have none.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self.maker = {name: node for node in network.nodes for name in node.results}
        self.starter = {name: node for node in network.initials for name in node.results}
        self._needs: dict[tuple[str, bool], Needs] = {}

    def of(self, node: Node, *, at_start: bool) -> Needs:
        """Return the inputs that a node depends on, through wires and, at the start, states.

        Args:
            node: The node.
            at_start: Whether before the start, when the states follow from the inputs.
        """
        key = node.results[0], at_start
        if key not in self._needs:
            needs = (self.of_source(source, at_start=at_start) for source in node.sources)
            self._needs[key] = frozenset().union(*needs)
        return self._needs[key]

    def of_source(self, source: Source, *, at_start: bool) -> Needs:
        """Return the inputs that a source depends on, see :meth:`of`."""
        if source.kind == "wire":
            return self.of(self.maker[source.name], at_start=at_start)
        if source.kind == "parameter":
            return frozenset()
        if source.kind != "state":
            return frozenset({source})
        if at_start and source.name in self.starter:
            return self._at_start(self.starter[source.name])
        return frozenset()

    def _at_start(self, node: Node) -> Needs:
        needs: set[Source] = set()
        for source in node.sources:
            if source.kind == "wire":
                needs |= self.of(self.maker[source.name], at_start=True)
            elif source.kind != "parameter":
                needs.add(source)
        return frozenset(needs)

    def groups(self, order: Sequence[Node]) -> list[list[Node]]:
        """Return groups of nodes with the same needs, those with fewer needs first.

        Args:
            order: All nodes that evaluate wires, each after those whose wires it takes.
        """
        needs_of_result = self._stage_needs(order)
        groups: dict[tuple[Needs, Needs], list[Node]] = {}
        for node in order:
            groups.setdefault(needs_of_result[node.results[0]], []).append(node)
        # a node needs at least the inputs of the wires that it takes
        return [groups[key] for key in sorted(groups, key=lambda key: (len(key[0]), len(key[1])))]

    def _stage_needs(self, order: Sequence[Node]) -> dict[str, tuple[Needs, Needs]]:
        """Return the needs of each node's stage, now and at the start, by the node's first result.

        Outputs at the border wait only for inputs that they need. Everything else is evaluated as
        late as its consumers, so that there are few stages.
        """
        shown = self._network.state_outputs
        border = {wire for port, wire in self._network.outputs.items() if port not in shown}
        takers: dict[str, list[tuple[Needs, Needs]]] = {}
        needs_of_result: dict[str, tuple[Needs, Needs]] = {}
        last: list[tuple[Needs, Needs]] = []
        for node in reversed(order):
            own = self.of(node, at_start=False), self.of(node, at_start=True)
            later = [stage_needs for name in node.results for stage_needs in takers.get(name, ())]
            if border.intersection(node.results):
                stage_needs = own
                last.append(own)
            elif later:
                stage_needs = (
                    frozenset.intersection(*(needs for needs, _ in later)),
                    frozenset.intersection(*(at_start for _, at_start in later)),
                )
            else:  # only states depend on it
                above = [p for p in last if own[0] <= p[0] and own[1] <= p[1]]
                stage_needs = max(above, key=lambda p: (len(p[0]), len(p[1])), default=own)
            needs_of_result[node.results[0]] = stage_needs
            for source in node.sources:
                if source.kind == "wire":
                    takers.setdefault(source.name, []).append(stage_needs)
        return needs_of_result
