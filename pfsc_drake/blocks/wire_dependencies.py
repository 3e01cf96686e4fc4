"""What the wires of a network depend on, and which of them are evaluated together."""

from collections.abc import Sequence

from pfsc_drake.blocks.network import Network, Node, Source
from pfsc_drake.blocks.stage import Needs


class Dependencies:
    """Inputs that each node of a network depends on, now and at the start.

    Args:
        network: The network.

    Attributes:
        maker: The node that evaluates each wire.
        starter: The node that says how each state begins; states that begin at zero have none.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self.maker = {name: node for node in network.nodes for name in node.results}
        self.starter = {name: node for node in network.initials for name in node.results}
        self._needs: dict[tuple[str, bool], Needs] = {}

    def of(self, node: Node, *, at_start: bool) -> Needs:
        """Return the inputs that a node depends on, by way of wires and, at start, of states.

        Args:
            node: The node.
            at_start: Whether before the start, when states are what the inputs say.
        """
        key = node.results[0], at_start
        if key not in self._needs:
            needs = (self.of_source(source, at_start=at_start) for source in node.sources)
            self._needs[key] = frozenset().union(*needs)
        return self._needs[key]

    def of_source(self, source: Source, *, at_start: bool) -> Needs:
        """Return the inputs that what a node takes depends on, see :meth:`of`."""
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
        """Return nodes by what they need, those that need less before.

        Args:
            order: All that evaluate wires, each after those that it takes wires of.
        """
        places = self._places(order)
        groups: dict[tuple[Needs, Needs], list[Node]] = {}
        for node in order:
            groups.setdefault(places[node.results[0]], []).append(node)
        # what a node takes from another needs no more than itself
        return [groups[key] for key in sorted(groups, key=lambda key: (len(key[0]), len(key[1])))]

    def _places(self, order: Sequence[Node]) -> dict[str, tuple[Needs, Needs]]:
        """Return what each node's stage needs, now and at the start, by the node's first result.

        What is put out at the border waits for nothing that it does not need. Everything else is
        evaluated as late as those that take it, so that there are few stages.
        """
        shown = self._network.shown
        border = {wire for port, wire in self._network.outputs.items() if port not in shown}
        takers: dict[str, list[tuple[Needs, Needs]]] = {}
        places: dict[str, tuple[Needs, Needs]] = {}
        last: list[tuple[Needs, Needs]] = []
        for node in reversed(order):
            own = self.of(node, at_start=False), self.of(node, at_start=True)
            later = [place for name in node.results for place in takers.get(name, ())]
            if border.intersection(node.results):
                place = own
                last.append(own)
            elif later:
                place = (
                    frozenset.intersection(*(needs for needs, _ in later)),
                    frozenset.intersection(*(at_start for _, at_start in later)),
                )
            else:  # only what is remembered depends on it
                above = [p for p in last if own[0] <= p[0] and own[1] <= p[1]]
                place = max(above, key=lambda p: (len(p[0]), len(p[1])), default=own)
            places[node.results[0]] = place
            for source in node.sources:
                if source.kind == "wire":
                    takers.setdefault(source.name, []).append(place)
        return places
