"""What a tool is to follow: a manifold, where it is found, and the motion along it."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.projector import Projector
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class Followed:
    """A manifold and the motion along it.

    Attributes:
        manifold: The manifold that the law makes linear.
        projector: Finds the place of the tool on it.
        motion: Tangential coordinates of the reference over time [m].
        start: Where the tool is when the motion begins.
        point: The manifold's point there, laid out by the manifold's layout.
    """

    manifold: Manifold
    projector: Projector
    motion: PiecewisePolynomialCurve
    start: ToolTarget
    point: np.ndarray
