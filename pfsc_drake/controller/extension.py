"""Further blocks of a controller, beside those of every one."""

from typing import Protocol

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.controller.believed import Believed
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.systems.block_system import BlockSystem


class OpenController(Protocol):
    """A controller while it is assembled, see :class:`~pfsc_drake.controller.assembly.Assembly`.

    Attributes:
        builder: Builder of its diagram.
        task: Task of the tool.
        law: Law.
        believed: Nominal model of the robot.
        period: Sampling time [s].
        signals: Output ports of its systems, by name.
        public: Names of further signals that are outputs of the controller.
    """

    builder: DiagramBuilder
    task: Task
    law: FollowingLaw
    believed: Believed
    period: float
    signals: dict[str, OutputPort]
    public: list[str]

    def add(self, name: str, block: Block, **sources: OutputPort) -> BlockSystem:
        """Add a block with the sources of its inputs, and return its system."""

    def show(self, **signals: OutputPort) -> None:
        """Take signals by name, and into the log."""

    def open(self, name: str, size: int) -> OutputPort:
        """Add an input of the controller, and return its signal."""

    def planned_frame(self, placement: np.ndarray) -> PiecewisePolynomialCurve:
        """Return the planned motion of the tool frame over time."""


class Extension:
    """Adds blocks to a controller at one of three moments of its assembly.

    Attributes:
        measures: Whether it provides the measured force on the tool: the signals
            ``wrench_measured``, ``tared`` and ``sensor_fault``.
    """

    measures: bool = False

    def before_projection(self, assembly: OpenController) -> None:
        """Add blocks where a moving manifold is about to be projected on.

        Args:
            assembly: The controller.
        """

    def before_law(self, assembly: OpenController) -> None:
        """Add blocks where projection and inputs of forces exist.

        Args:
            assembly: The controller.
        """

    def after_law(self, assembly: OpenController) -> None:
        """Add blocks where all others exist.

        Args:
            assembly: The controller.
        """
