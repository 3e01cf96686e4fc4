"""Teleoperation: follower's side of a channel to a leader device."""

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Linear, Sum
from pfsc_drake.control.teleoperation.commanded_point import (
    CommandedOrientation,
    CommandedPoint,
    FixtureReaction,
)
from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters, PortLimits
from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.control.teleoperation.port import TeleoperationPort
from pfsc_drake.controller.extension import Extension, OpenController
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.systems.block_system import BlockSystem


class Teleoperated(Extension):
    """Tool that complies with a leader device and with forces measured at the tool.

    Ports:
        message (input): Newest message of the leader's side, shape (15,).
        message (output): Message to the leader's side.

    Args:
        coupling: Coupling of both sides.
        limits: Limits of the follower's port.
        axes: Axes of leader and follower, 3 or 6.
        lag: Lag between the commanded and the actual tool [s].
    """

    def __init__(
        self, coupling: CouplingParameters, limits: PortLimits, axes: int, lag: float
    ) -> None:
        self._block, self._axes = TeleoperationPort("follower", coupling, limits), axes
        self._lag = lag

    def before_law(self, assembly: OpenController) -> None:
        """Add the follower's port, and the force for the compliance of the tool."""
        message = assembly.open("message", MESSAGE)
        port = self._port = assembly.add("follower_port", self._block, message=message)
        force = port.GetOutputPort("force")
        wrench = assembly.add("follower_wrench", Linear(np.eye(6, self._axes)), vector=force)
        total = assembly.add(
            "led_wrench",
            Sum(2, 6),
            term_0=wrench.GetOutputPort("product"),
            term_1=assembly.signals["wrench_measured"],
        )
        assembly.signals["wrench_led"] = total.GetOutputPort("sum")
        assembly.signals["message"] = port.GetOutputPort("message")
        assembly.public.append("message")
        assembly.show(follower_record=port.GetOutputPort("record"))

    def after_law(self, assembly: OpenController) -> None:
        """Connect the position of the tool and the force on it with the port."""
        task, robot, signals = assembly.task, assembly.nominal.robot, assembly.signals
        wrench, joint_state = signals["wrench_measured"], signals["joint_state"]
        if isinstance(task, SpaceTask):
            block: Block = FixtureReaction(len(task.fixtures), self._axes, len(task.guides))
            sources = {"record": signals["guidance"]}
            sources |= {"guides": signals["guides"]} if task.guides else {}
        else:
            block, sources = (
                CommandedPoint(robot, self._lag, self._axes),
                {"joint_state": joint_state},
            )
        view = assembly.add("follower_view", block, wrench=wrench, **sources)
        for name in ("position", "felt"):
            self._connect(assembly, view, name)
        if self._axes > 3:
            turned = assembly.add(
                "follower_orientation",
                CommandedOrientation(robot, self._lag),
                joint_state=joint_state,
            )
            self._connect(assembly, turned, "orientation")

    def _connect(self, assembly: OpenController, system: BlockSystem, name: str) -> None:
        assembly.builder.Connect(system.GetOutputPort(name), self._port.GetInputPort(name))
