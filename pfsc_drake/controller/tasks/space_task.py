"""Hand guiding of a tool through space, within virtual fixtures (Sec. 5.1.1, 5.2.4)."""

from collections.abc import Iterator, Sequence

import numpy as np

from pfsc_drake.control.fixtures.fixture_parameters import Admittance, Fixture
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.fixtures.lead import Lead
from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller.options.follower_options import FixtureOptions
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.geometry import PiecewisePolynomialCurve, quaternion_to_matrix
from pfsc_drake.physics.hand_way import Place


class SpaceTask(Task):
    """A tool that moves where a hand guides it, and not into forbidden regions.

    Args:
        manifold: Space, with the orientation that the tool keeps.
        first: Tool point at the start [m], shape (3,).
        fixtures: The M regions.
        admittance: The free motion.
        lead: Filter between the requested velocity and the tool.
        options: Further options.
        guides: Paths that attract the tool, by name.
        rotation_deg: ZYX angles of the tool at the start from the orientation that it keeps [deg].
        duration: Duration of the run [s], if it ends.

    Attributes:
        fixtures: The regions.
        speeds: Largest speed of each near the tool's start [m/s].
        admittance: The free motion.
        lead: Filter between the requested velocity and the tool.
        options: Further options.
        guides: Paths that attract the tool, by name.
    """

    projector_name = "tool_place"
    place: SpaceManifold

    def __init__(
        self,
        manifold: SpaceManifold,
        first: np.ndarray,
        fixtures: Sequence[Fixture],
        admittance: Admittance,
        lead: Lead,
        options: FixtureOptions,
        guides: dict[str, Guide],
        *,
        rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
        duration: float | None = None,
    ) -> None:
        self.place = self.manifold = manifold
        self._first, self._rotation_deg, self.warnings = first, rotation_deg, []
        self.fixtures, self.admittance, self.lead = fixtures, admittance, lead
        self.options, self.guides = options, guides
        self.speeds = [fixture.largest_speed(first) for fixture in fixtures]
        self.motion = None
        if duration is not None:
            self.motion = PiecewisePolynomialCurve([0.0, duration], first[None, None])

    @property
    def is_planned(self) -> bool:
        """False: a hand decides on the motion."""
        return False

    @property
    def projecting(self) -> Projector:
        """Block that finds the closest point on the manifold."""
        return Projector(self.place)

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``place`` next to a tool, shape (size,)."""
        return self.place.point(y_t.tolist())

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts."""
        y_t, R_d = self._first + shift, None
        if self.place.is_oriented:
            R_d = quaternion_to_matrix(self.place.point(y_t)[self.place.layout.quaternion])
        return StartPoint(self._target(y_t, R_d, self._rotation_deg), y_t)

    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield the start alone: a hand decides on the rest."""
        yield self._first, "start"

    @property
    def target(self) -> Place:
        """Map from coordinates of the manifold, which are those of the world."""
        return lambda coordinates, rates: (coordinates, rates)

    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse nothing: the manifold is all of space."""

    def distances(self, y_t: np.ndarray, clock: np.ndarray) -> np.ndarray:
        """Return the distances of tool points from each region [m], shape (samples, M).

        Args:
            y_t: Tool points [m], shape (samples, 3).
            clock: Clock of moving regions at each sample [s], shape (samples,).
        """
        places = zip(y_t.tolist(), clock.tolist(), strict=True)
        return np.array(
            [[fixture.distance(place, time) for fixture in self.fixtures] for place, time in places]
        ).reshape(len(y_t), len(self.fixtures))
