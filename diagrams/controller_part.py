"""The controller of a station, from what is measured to what drives are told, as a network."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram, InputPort, OutputPort, System

from diagrams.holder_station import HOLDER
from diagrams.station import Station
from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.errors import InputError
from pfsc_drake.following.link_state import DEVIATION
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import network_of

_CONTROLLER = "following_controller"
# where blocks live that control, and those that only lead vectors from one to another
_CONTROL = ("pfsc_drake.control.", "pfsc_drake.blocks.")
# where systems live that a controller only measures
_PHYSICS = (
    "pfsc_drake.physics.",
    "pfsc_drake.systems.physics.",
    "pfsc_drake.systems.plants.",
    "pydrake.multibody.",
)
_TOLD = ("manifold_state", "status", "fault")


@dataclass(frozen=True)
class ControllerPart:
    """The controller of a station.

    Attributes:
        network: What it does; ``joint_state`` is as measured, other inputs are called as the ports
            that they come from.
        period: Sampling time [s].
        inputs: Ports of the station's systems that the network's inputs come from, by name.
        outputs: The same of its outputs: ``drive_torque`` or ``velocity_reference``,
            ``manifold_state``, ``status``, ``fault``, ``reference``; where another robot holds
            the workpiece ``holder_drive_torque`` and ``holder_fault``; then standard deviations,
            where links are found without encoders on them.
    """

    network: Network
    period: float
    inputs: Mapping[str, OutputPort]
    outputs: Mapping[str, OutputPort]

    def presets(self, station: Station, root: Context) -> dict[str, np.ndarray]:
        """Return the states that a station sets before it starts, by name.

        Args:
            station: The station.
            root: Context of its diagram, after :meth:`Station.set_start`.
        """
        found = station.blocks.presets(root)
        return {name: value for name, value in found.items() if name in self.network.states}


def controller_part(station: Station) -> ControllerPart:
    """Return the controller of a station: all blocks between what is measured and the drives.

    Args:
        station: The station, its blocks not fused.

    Raises:
        InputError: If something that controls is no block.
    """
    return _Search(station).part()


class _Search:
    """Goes upstream from the drives to what is measured."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._sources: dict[tuple[System, int], OutputPort] = {
            (system, int(i)): source.get_output_port(o)
            for (system, i), (source, o) in station.diagram.connection_map().items()
        }
        self._inputs: dict[str, OutputPort] = dict(station.part.told)
        if not self._inputs:
            name, port = station.measured
            measured = station.diagram.GetSubsystemByName(name).GetOutputPort(port)
            self._inputs["joint_state"] = measured
        if station.holder is not None:
            name, port = station.holder.measured
            measured = station.diagram.GetSubsystemByName(name).GetOutputPort(port)
            self._inputs[f"{HOLDER}joint_state"] = measured
            force = f"{HOLDER}wrench_hold"
            if station.diagram.HasSubsystemNamed(force):
                held = station.diagram.GetSubsystemByName(force).GetOutputPort("held")
                self._inputs["reaction"] = held
        self._wiring = Wiring()

    def part(self) -> ControllerPart:
        controller = self._station.diagram.GetSubsystemByName(_CONTROLLER)
        self._add(controller)
        access = self._station.controller
        outputs = {
            name: controller.GetOutputPort(name)
            for name in (access.drive_port, *_TOLD)
            if controller.HasOutputPort(name)
        }
        reference = self._source(controller.GetInputPort("reference"))
        assert reference is not None  # every law has one
        outputs["reference"] = reference
        if self._station.holder is not None:
            carrier = self._station.diagram.GetSubsystemByName(f"{HOLDER}{_CONTROLLER}")
            self._add(carrier)
            for name in (self._station.holder.controller.drive_port, "fault"):
                outputs[f"{HOLDER}{name}"] = carrier.GetOutputPort(name)
        if self._station.diagram.HasSubsystemNamed(DEVIATION):
            deviation = self._station.diagram.GetSubsystemByName(DEVIATION)
            self._add(deviation)
            ports = [deviation.get_output_port(i) for i in range(deviation.num_output_ports())]
            outputs |= {port.get_name(): port for port in ports}
        for name, port in outputs.items():
            self._wiring.outputs[name] = _names(port)
        network = self._wiring.network()
        inputs = {name: self._inputs[name] for name in network.inputs}
        return ControllerPart(network, access.period, inputs, outputs)

    def _add(self, system: System) -> None:
        """Add a system of blocks, and what it is fed from."""
        if system.get_name() in self._wiring.networks:
            return
        ports = [system.get_input_port(i) for i in range(system.num_input_ports())]
        fed = {port.get_name(): self._source(port) for port in ports}
        left = [name for name, source in fed.items() if source is None]
        self._wiring.networks[system.get_name()] = network_of(system, left)
        for name, source in fed.items():
            if source is not None:
                self._wiring.connections[system.get_name(), name] = self._origin(source)

    def _origin(self, source: OutputPort) -> tuple[str, str] | str:
        """Return an output of a block, which is added, or the input at the border that it is."""
        for name, port in self._inputs.items():
            if _names(port) == _names(source):
                return name
        system = source.get_system()
        if not self._is_measured(system):
            if not _controls(system):
                raise InputError(
                    f"export: {system.get_name()} is no block, but {type(system).__name__}; a "
                    "controller in C consists of blocks"
                )
            self._add(system)
            return _names(source)
        name = self._measured_name(source)
        if name in self._inputs:
            name = f"{system.get_name()}_{name}"
        self._inputs[name] = source
        return name

    def _is_measured(self, system: System) -> bool:
        """Return whether a system is physics, or only leads from there."""
        if isinstance(system, Diagram) and not _controls(system):
            return all(self._is_measured(part) for part in system.GetSystems())
        module = _module(system)
        if module.startswith(_PHYSICS):
            return True
        if not module.startswith(("pydrake.systems.", "pfsc_drake.blocks.wiring_blocks")):
            return False
        ports = [system.get_input_port(i) for i in range(system.num_input_ports())]
        sources = [source for port in ports if (source := self._source(port)) is not None]
        return bool(sources) and all(self._is_measured(s.get_system()) for s in sources)

    def _measured_name(self, source: OutputPort) -> str:
        """Return what is measured there, also if it comes some ticks later."""
        system = source.get_system()
        while isinstance(system, BlockSystem) and isinstance(system.block, Hold):
            earlier = self._source(system.get_input_port())
            assert earlier is not None  # something is delayed
            source, system = earlier, earlier.get_system()
        return source.get_name()

    def _source(self, port: InputPort) -> OutputPort | None:
        return self._sources.get((port.get_system(), int(port.get_index())))


def _controls(system: System) -> bool:
    """Return whether a system is a block that controls, or a diagram of such blocks."""
    if isinstance(system, Diagram):
        return all(_controls(part) for part in system.GetSystems())
    return isinstance(system, BlockSystem) and _module(system).startswith(_CONTROL)


def _module(system: System) -> str:
    """Return where a system's class, or that of its block, is at home."""
    block = system.block if isinstance(system, BlockSystem) else None
    return type(system if block is None else block).__module__


def _names(port: OutputPort) -> tuple[str, str]:
    return port.get_system().get_name(), port.get_name()
