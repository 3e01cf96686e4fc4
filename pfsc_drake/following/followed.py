"""What a tool is to follow: a manifold, where it is found, and the motion along it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pfsc_drake.control.compliance.tuned_impedance import TuningParameters
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.fixtures.lead import Lead
from pfsc_drake.control.fixtures.parameters import Admittance, Fixture
from pfsc_drake.control.manifolds.manifold import Manifold, Projector
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.control.planning.course import Projection
from pfsc_drake.control.streams.projector import StreamedProjector
from pfsc_drake.following.options.follower import FixtureOptions
from pfsc_drake.following.streamed_path import StreamedPath
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class Guided:
    """What a tool is led through.

    Attributes:
        place: Space, with the orientation that the tool keeps.
        fixtures: The M regions.
        speeds: Speeds of each the largest speed near the tool [m/s].
        motion: The free motion.
        lead: What is between the velocity that is asked for and the tool.
        options: What else is chosen.
        guides: Paths that attract it.
    """

    place: SpaceManifold
    fixtures: Sequence[Fixture]
    speeds: Sequence[float]
    motion: Admittance
    lead: Lead
    options: FixtureOptions
    guides: Sequence[Guide] = ()


@dataclass(frozen=True)
class Followed:
    """A manifold and the motion along it.

    Attributes:
        manifold: The manifold that the law makes linear.
        projector: Finds the place of the tool on it.
        motion: Tangential coordinates of the reference over time [m]; None where a hand leads, and
            where way points come while the tool moves.
        start: Where the tool is when the motion begins.
        point: The manifold's point there, laid out by the manifold's layout.
        lap: Length of the path [m] if it is closed.
        length: Length of the path [m], if there is one.
        guided: What a hand leads the tool through, where one leads.
        streamed: The path, where its way points come while the tool moves.
        projection: Finds the place on a path beforehand.
        warnings: Doubts about the path, one sentence each.
    """

    manifold: Manifold
    projector: Projector | StreamedProjector
    motion: PiecewisePolynomialCurve | None
    start: ToolTarget
    point: np.ndarray
    lap: float | None = None
    length: float = 0.0
    guided: Guided | None = None
    streamed: StreamedPath | None = None
    projection: Projection | None = None
    warnings: Sequence[str] = ()


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a tool, before it yields to forces.

    Attributes:
        start: Joint coordinates at the start, shape (N,) [rad or m].
        transition: How long the reference takes from where the tool is at the start to the motion
            that is wanted [s]; 0 for no such transition.
        lap: Length of the path [m] if it is closed.
        length: Length of the path [m], if there is one.
        end: When the motion ends [s].
        tuning: How the impedance follows what an operator sets, if there is one.
    """

    start: np.ndarray
    transition: float = 0.0
    lap: float | None = None
    length: float = 0.0
    end: float = math.inf
    tuning: TuningParameters = field(default_factory=TuningParameters)
