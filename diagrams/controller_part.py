"""The controllers of a station as one network, from measured signals to drive commands."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram, InputPort, OutputPort, System

from diagrams.holder_station import HOLDER
from diagrams.station import Station
from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import network_of

# outputs of the controller in C, beside the commands to the drives; and those of a workpiece robot
_OUTPUTS, _OF_HOLDER = ("manifold_state", "status", "fault", "reference"), ("fault",)


@dataclass(frozen=True)
class ControllerPart:
    """The controllers of a station.

    Attributes:
        network: Their network; inputs and outputs are named as the controllers' ports, those of a
            workpiece robot with the prefix ``holder_``.
        period: Sampling time [s].
        inputs: Ports of the station's controllers with the network's inputs, by name.
        outputs: Ports with the network's outputs, by name: ``drive_torque`` or
            ``velocity_reference``, ``manifold_state``, ``status``, ``fault``, ``reference``; with a
            workpiece robot ``holder_drive_torque`` and ``holder_fault``; then standard deviations
            of a link state that is estimated.
    """

    network: Network
    period: float
    inputs: Mapping[str, InputPort]
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
    """Return the controllers of a station.

    Args:
        station: The station, its blocks not fused.

    Raises:
        InputError: If a part of a controller is no block.
    """
    systems: list[System] = list(station.controllers)
    own, *others = station.controllers
    wiring, inputs, outputs = Wiring(), dict[str, InputPort](), dict[str, OutputPort]()
    names = [own.drive_port, *_OUTPUTS, *own.deviations]
    chosen = {name: (own, name) for name in names}
    for holder in others:
        systems.append(station.diagram.GetSubsystemByName(f"{HOLDER}stop"))
        chosen |= {f"{HOLDER}{name}": (holder, name) for name in (holder.drive_port, *_OF_HOLDER)}
    for system in systems:
        _refuse_others(system)
        wiring.networks[system.get_name()] = network_of(system)
    sources = {
        (target.get_name(), target.get_input_port(i).get_name()): source.get_output_port(o)
        for (target, i), (source, o) in station.diagram.connection_map().items()
        if target in systems
    }
    for (name, port), source in sources.items():
        system = source.get_system()
        if system in systems:
            wiring.connections[name, port] = system.get_name(), source.get_name()
            continue
        key = f"{HOLDER if name.startswith(HOLDER) else ''}{port}"
        wiring.connections[name, port] = key
        inputs[key] = station.diagram.GetSubsystemByName(name).GetInputPort(port)
    for key, (controller, name) in chosen.items():
        wiring.outputs[key] = controller.get_name(), name
        outputs[key] = controller.GetOutputPort(name)
    network = wiring.network().subnetwork(list(chosen))
    return ControllerPart(network, own.period, {n: inputs[n] for n in network.inputs}, outputs)


def _refuse_others(system: System) -> None:
    """Refuse a controller with systems that are no blocks."""
    if isinstance(system, BlockSystem):
        return
    if not isinstance(system, Diagram):
        raise InputError(
            f"export: {system.get_name()} is no block, but {type(system).__name__}; a "
            "controller in C consists of blocks"
        )
    for part in system.GetSystems():
        _refuse_others(part)
