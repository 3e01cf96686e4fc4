"""What a tool is to follow: a manifold, where it is found, and the motion along it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class Followed:
    """A manifold and the motion along it.

    Attributes:
        manifold: The manifold that the law makes linear.
        motion: Tangential coordinates of the reference over time [m].
        start: Where the tool is when the motion begins.
        point: The manifold's point there, laid out by the manifold's layout.
        add_projector: ``(builder, tool_pose) -> manifold_point``: adds what finds the place of the
            tool.
    """

    manifold: Manifold
    motion: PiecewisePolynomialCurve
    start: ToolTarget
    point: np.ndarray
    add_projector: Callable[[DiagramBuilder, OutputPort], OutputPort]
