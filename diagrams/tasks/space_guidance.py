"""Leading a tool through space by hand, within virtual fixtures (Sec. 5.1.1, 5.2.4)."""

from collections.abc import Iterator
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario import StartParameters
from diagrams.scenario.checks import require
from diagrams.scenario.virtual_fixtures import FixtureParameters
from diagrams.tasks.drawing import SpaceDrawing
from diagrams.tasks.regions_and_guides import make_fixtures, make_guides
from diagrams.tasks.task import StartPoint, Task
from diagrams.tasks.task_geometry import followed_angles, require_joints
from pfsc_drake.control.fixtures.lead import Lead
from pfsc_drake.control.fixtures.parameters import Admittance
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.following.task import Guided
from pfsc_drake.geometry import PiecewisePolynomialCurve, quaternion_to_matrix
from pfsc_drake.geometry.paths.path_warnings import euler_warnings
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.physics.hand_way import Place


class SpaceTask(Task):
    """A tool that moves where a hand leads it, and not into forbidden regions.

    Args:
        parameters: The regions, and the orientation that the tool keeps.
        relative_degree: Relative degree of the law.
        motion: How the tool moves where no region is near.
        lead: What is between the velocity that is asked for and the tool.
        start: Where the tool starts.
        duration: Simulated time [s].
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Attributes:
        fixtures: The regions.
        guides: Paths that attract the tool, by name.
        guided: All that it is led through.

    Raises:
        InputError: If a region cannot be made, or the start is missing or forbidden.
    """

    projector_name = "tool_place"
    place: SpaceManifold
    manifold: SpaceManifold
    guided: Guided
    shape = None

    def __init__(
        self,
        parameters: FixtureParameters,
        relative_degree: int,
        motion: Admittance,
        lead: Lead,
        start: StartParameters,
        duration: float,
        folder: FilePath,
        progress: Progress | None = None,
    ) -> None:
        said = parameters.orientation
        self.place = SpaceManifold(relative_degree, said.quaternion, **followed_angles(said))
        self.manifold = self.place
        given, allowed = start.position, "the tool point where it starts [m], 3 numbers"
        require(bool(given), "start.position", given, allowed)
        self._start, self._rotation_deg = np.array(given, dtype=float), start.rotation_deg
        require(duration > 0.0, "duration", duration, "a positive number [s]")
        self.motion = PiecewisePolynomialCurve([0.0, duration], self._start[None, None])
        self.fixtures, self.warnings = make_fixtures(parameters, self._start, folder, progress)
        self.guides = make_guides(parameters, folder, progress)
        speeds = [fixture.largest_speed(self._start) for fixture in self.fixtures]
        self.guided = Guided(
            self.place, self.fixtures, speeds, motion, lead, parameters, [*self.guides.values()]
        )
        if self.place.is_oriented:
            R_d = self.place.orientation(self.place.point(given)[None])
            self.warnings += euler_warnings(
                self.place.tool.euler, R_d, "fixtures", lambda _: "everywhere"
            )

    def require_joints(self, num_joints: int) -> None:
        """Refuse a robot that cannot follow, or would lose its orientation by oversight."""
        require_joints(self.manifold, num_joints)

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of the true place's manifold next to a tool, shape (size,)."""
        return self.place.point(y_t.tolist())

    @property
    def evaluator(self) -> SpaceManifold:
        """What finds places on the true place's manifold."""
        return self.place

    @property
    def drawing(self) -> SpaceDrawing:
        """How the manifold is drawn."""
        return SpaceDrawing(self.fixtures, self.place, [*self.guides.values()])

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts."""
        y_t, R_d = self._start + shift, None
        if self.place.is_oriented:
            quaternion = self.place.point(y_t)[self.place.layout.quaternion]
            R_d = quaternion_to_matrix(quaternion)
        return StartPoint(self._tool_target(y_t, R_d, self._rotation_deg), y_t)

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start."""
        return self.place.point(start.target.y_t.tolist())

    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions along the way of the tool [m], each (3,), with what to call them.

        Where the hand will lead it nobody knows.
        """
        yield self._start, "start"

    def target(self) -> Place:
        """Return where given coordinates of the manifold are in the world.

        Coordinates are those of the world.
        """
        return lambda coordinates, rates: (coordinates, rates)

    def distances(self, y_t: np.ndarray, clock: np.ndarray) -> np.ndarray:
        """Return how far tool points are from each region [m], shape (samples, M).

        Args:
            y_t: Tool points [m], shape (samples, 3).
            clock: Clock of moving regions at each sample [s], shape (samples,).
        """
        places = zip(y_t.tolist(), clock.tolist(), strict=True)
        return np.array(
            [[fixture.distance(place, time) for fixture in self.fixtures] for place, time in places]
        ).reshape(len(y_t), len(self.fixtures))

    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold; all of space is there."""
