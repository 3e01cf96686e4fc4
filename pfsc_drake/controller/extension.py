"""Extensions: further blocks of a controller."""

from typing import Protocol

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.systems.block_system import BlockSystem


class OpenController(Protocol):
    """Controller during assembly, see :class:`~pfsc_drake.controller.assembly.Assembly`.

    Attributes:
        builder: Builder of its diagram.
        task: Task of the tool.
        law: Law.
        nominal: Nominal model of the robot.
        period: Sampling time [s].
        signals: Output ports of its systems, by name.
        public: Names of further outputs of the controller.
    """

    builder: DiagramBuilder
    task: Task
    law: FollowingLaw
    nominal: NominalRobot
    period: float
    signals: dict[str, OutputPort]
    public: list[str]

    def add(self, name: str, block: Block, **sources: OutputPort) -> BlockSystem:
        """Add a block with the sources of its inputs, and return its system."""

    def show(self, **signals: OutputPort) -> None:
        """Add signals by name, and log them."""

    def open(self, name: str, size: int) -> OutputPort:
        """Add an input of the controller, and return its signal."""

    def planned_frame(self, placement: np.ndarray) -> PiecewisePolynomialCurve:
        """Return the planned motion of the tool frame over time."""


class Extension:
    """Extension that adds blocks at one of three stages of the assembly of a controller.

    Attributes:
        measures: Whether it provides the measured force on the tool, with the signals
            ``wrench_measured``, ``tared`` and ``sensor_fault``.
    """

    measures: bool = False

    def before_projection(self, assembly: OpenController) -> None:
        """Add blocks before the projection onto a moving manifold.

        Args:
            assembly: The controller.
        """

    def before_law(self, assembly: OpenController) -> None:
        """Add blocks after the projection and the inputs of forces.

        Args:
            assembly: The controller.
        """

    def after_law(self, assembly: OpenController) -> None:
        """Add blocks after all others.

        Args:
            assembly: The controller.
        """
