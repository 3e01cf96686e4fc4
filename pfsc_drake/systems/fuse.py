"""Blocks of a diagram as one system, and access by name to fused and single blocks."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    InputPort,
    InputPortIndex,
    OutputPort,
    OutputPortIndex,
    System,
)

from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem

Connections = Mapping[tuple[System, InputPortIndex], tuple[System, OutputPortIndex]]


class FusedSystem(BlockSystem):
    """Blocks that are evaluated as one function, and drawn one by one.

    Args:
        wiring: Connections of the blocks.
        network: All blocks as one network.
        period: Sampling time [s].
        parts: Original systems, by name.
    """

    def __init__(
        self, wiring: Wiring, network: Network, period: float, parts: Mapping[str, System]
    ) -> None:
        super().__init__(network, period)
        self._wiring, self._parts = wiring, parts

    def DoGetGraphvizFragment(self, params: System.GraphvizFragmentParams) -> Any:
        """Draw all parts and their connections, within one frame."""
        drawn = {name: part.GetGraphvizFragment(max_depth=1) for name, part in self._parts.items()}
        fed: dict[str, list[str]] = {}
        lines = []
        for (name, port), source in self._wiring.connections.items():
            target = drawn[name].input_ports[self._parts[name].GetInputPort(port).get_index()]
            if isinstance(source, str):
                fed.setdefault(source, []).append(target)
            else:
                lines.append(f"{self._drawn_output(drawn, *source)}:e -> {target}:w;")
        inputs = []
        for k, name in enumerate(self.network.inputs):
            inputs.append(f"{params.node_id}u{k}")
            lines.append(f"{inputs[-1]} [shape=point];")
            lines += [f"{inputs[-1]}:e -> {target}:w;" for target in fed[name]]
        outputs = [
            self._drawn_output(drawn, *self._wiring.outputs[name]) for name in self.network.outputs
        ]
        frame = [f"subgraph cluster{params.node_id} {{", f'label="{self.get_name()}";']
        inside = [text for fragment in drawn.values() for text in fragment.fragments]
        fragment = super().DoGetGraphvizFragment(params)
        fragment.input_ports, fragment.output_ports = inputs, outputs
        fragment.fragments = [*frame, *inside, *lines, "}"]
        return fragment

    def _drawn_output(self, drawn: Mapping[str, Any], name: str, port: str) -> str:
        index = self._parts[name].GetOutputPort(port).get_index()
        return str(drawn[name].output_ports[index])


def fuse(diagram: Diagram) -> BlockSystem:
    """Return one system that replaces a diagram of blocks, with the same ports.

    Its states and wires are named ``block.name``.

    Args:
        diagram: The diagram; all its systems are blocks of one sampling time, or such diagrams.

    Raises:
        InputError: If one of them is not.
    """
    period = _period(diagram)
    if period is None:
        raise InputError(
            f"diagram {diagram.get_name()}: must consist of blocks with one sampling time"
        )
    return BlockSystem(network_of(diagram), period)


def fuse_blocks(builder: DiagramBuilder, name: str = "blocks") -> list[BlockSystem]:
    """Replace all blocks in a builder by one system, or one for each sampling time.

    Connections between blocks and other systems use the new system's ports, which are named
    ``block.port``. Ports that the builder has exported must belong to other systems.

    Args:
        builder: The builder, with everything connected.
        name: Name of the new system.

    Returns:
        The added systems.
    """
    by_period: dict[float, list[System]] = {}
    for system in builder.GetSystems():
        period = _period(system)
        if period is not None:
            by_period.setdefault(period, []).append(system)
    added = []
    for k, (period, systems) in enumerate(sorted(by_period.items())):
        title = name if k == 0 else f"{name}_{k}"
        added.append(_replace(builder, systems, period, title))
    return added


def _replace(
    builder: DiagramBuilder, systems: list[System], period: float, name: str
) -> BlockSystem:
    connections, inside = builder.connection_map(), set(systems)
    wiring = Wiring()
    # connections of the remaining systems: the ports that feed the new system, and those it feeds
    sources: dict[str, OutputPort] = {}
    targets: list[tuple[InputPort, str]] = []
    for system in systems:
        fed = {port for other, port in connections if other is system}
        left = [
            system.get_input_port(i).get_name()
            for i in range(system.num_input_ports())
            if InputPortIndex(i) not in fed
        ]
        wiring.networks[system.get_name()] = network_of(system, left)
    for (target, i), (source, o) in connections.items():
        output, port = source.get_output_port(o), target.get_input_port(i)
        origin = source.get_name(), output.get_name()
        if target in inside:
            key = ".".join(origin)
            wiring.connections[target.get_name(), port.get_name()] = (
                origin if source in inside else key
            )
            if source not in inside:
                sources[key] = output
        elif source in inside:
            wiring.outputs[".".join(origin)] = origin
            targets.append((port, ".".join(origin)))
    parts = {system.get_name(): system for system in systems}
    fused = FusedSystem(wiring, wiring.network(), period, parts)
    for system in systems:
        builder.RemoveSystem(system)
    builder.AddNamedSystem(name, fused)
    for key, output in sources.items():
        if fused.HasInputPort(key):
            builder.Connect(output, fused.GetInputPort(key))
    for port, key in targets:
        builder.Connect(fused.GetOutputPort(key), port)
    return fused


def _period(system: System) -> float | None:
    """Return the sampling time of a block, or of all blocks of a diagram; None for others."""
    if isinstance(system, BlockSystem):
        return system.period
    if not isinstance(system, Diagram):
        return None
    periods = {_period(part) for part in system.GetSystems()}
    return periods.pop() if len(periods) == 1 else None


def network_of(system: System, unconnected: Collection[str] = ()) -> Network:
    """Return a block, or a diagram of blocks, as a network.

    Args:
        system: The system.
        unconnected: Names of its input ports that are not connected.
    """
    if isinstance(system, BlockSystem):
        if system.block is None or not unconnected:
            return system.network
        return Network.of(system.block, unconnected)
    assert isinstance(system, Diagram)
    wiring = Wiring()
    connections: Connections = system.connection_map()
    for (target, i), (source, o) in connections.items():
        wiring.connections[target.get_name(), target.get_input_port(i).get_name()] = (
            source.get_name(),
            source.get_output_port(o).get_name(),
        )
    for i in range(system.num_input_ports()):
        port = system.get_input_port(i).get_name()
        if port in unconnected:
            continue
        for part, index in system.GetInputPortLocators(InputPortIndex(i)):
            wiring.connections[part.get_name(), part.get_input_port(index).get_name()] = port
    for part in system.GetSystems():
        names = [part.get_input_port(i).get_name() for i in range(part.num_input_ports())]
        left = [name for name in names if (part.get_name(), name) not in wiring.connections]
        wiring.networks[part.get_name()] = network_of(part, left)
    for o in range(system.num_output_ports()):
        part, index = system.get_output_port_locator(OutputPortIndex(o))
        output = part.get_output_port(index).get_name()
        wiring.outputs[system.get_output_port(o).get_name()] = part.get_name(), output
    return wiring.network()


class BlockAccess:
    """Access to the states and outputs of blocks in a diagram.

    Args:
        diagram: The diagram, with its blocks as systems of their own or fused.
    """

    def __init__(self, diagram: Diagram) -> None:
        self._states: dict[str, tuple[BlockSystem, str]] = {}
        self._wires: dict[str, tuple[BlockSystem, str]] = {}
        self._collect(diagram, "")

    def _collect(self, diagram: Diagram, path: str) -> None:
        for system in diagram.GetSystems():
            if isinstance(system, BlockSystem):
                for found, names in (
                    (self._states, system.states),
                    (self._wires, system.network.wires),
                ):
                    found |= {f"{path}{system.full_name(name)}": (system, name) for name in names}
            elif isinstance(system, Diagram):
                self._collect(system, f"{path}{system.get_name()}.")

    def output(self, root: Context, name: str) -> np.ndarray:
        """Return the value of a block's output.

        Args:
            root: Context of the diagram.
            name: ``block.output``.
        """
        system, wire = self._wires[name]
        return system.wire(system.GetMyContextFromRoot(root), wire)

    def state(self, root: Context, name: str) -> np.ndarray:
        """Return the value of a block's state.

        Args:
            root: Context of the diagram.
            name: ``block.state``.
        """
        system, state = self._states[name]
        return system.state(system.GetMyContextFromRoot(root), state)

    def presets(self, root: Context) -> dict[str, np.ndarray]:
        """Return the states that were set before the start, by ``block.state``.

        Args:
            root: Context of the diagram.
        """
        found = {}
        for key, (system, name) in self._states.items():
            context = system.GetMyContextFromRoot(root)
            if system.is_set(context, name):
                found[key] = system.state(context, name)
        return found

    def set_state(self, root: Context, name: str, value: np.ndarray) -> None:
        """Set a block's state; see :meth:`BlockSystem.set_state`.

        Args:
            root: Context of the diagram.
            name: ``block.state``.
            value: Value of the state.
        """
        system, state = self._states[name]
        system.set_state(system.GetMyMutableContextFromRoot(root), state, value)
