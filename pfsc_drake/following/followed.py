"""What a tool is to follow: a manifold, where it is found, and the motion along it."""

import math
from dataclasses import dataclass, field

import numpy as np

from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
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


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a tool, before it yields to forces.

    Attributes:
        start: Joint coordinates at the start, shape (N,) [rad or m].
        transition: How long the reference takes from where the tool is at the start to the motion
            that is wanted [s]; 0 for no such transition.
        lap: Length of the path [m] if it is closed.
        length: Of the path [m], if there is one.
        end: When the motion ends [s].
        tuning: How the impedance follows what an operator sets, if there is one.
    """

    start: np.ndarray
    transition: float = 0.0
    lap: float | None = None
    length: float = 0.0
    end: float = math.inf
    tuning: TuningParameters = field(default_factory=TuningParameters)
