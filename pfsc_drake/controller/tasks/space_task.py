"""Hand guiding of a tool through space, within virtual fixtures (Sec. 5.1.1, 5.2.4)."""

from collections.abc import Iterator, Sequence

import numpy as np

from pfsc_drake.control.fixtures.command_dynamics import CommandDynamics
from pfsc_drake.control.fixtures.fixture_parameters import Admittance, Fixture
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller.options.follower_options import FixtureOptions
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.geometry import PiecewisePolynomialCurve, quaternion_to_matrix
from pfsc_drake.physics.hand_path import CoordinateMap


class SpaceTask(Task):
    """Hand guiding of a tool outside of forbidden regions.

    Args:
        manifold: Space, with the constant orientation of the tool.
        first: Tool point at the start [m], shape (3,).
        fixtures: The M regions.
        admittance: The free motion.
        command_dynamics: Filter between the requested velocity and the tool.
        options: Further options.
        guides: Paths that attract the tool, by name.
        rotation_deg: ZYX angles of the tool at the start from its constant orientation [deg].
        duration: Duration of the run [s], if it is finite.

    Attributes:
        fixtures: The regions.
        speeds: Largest speed of each near the tool's start [m/s].
        admittance: The free motion.
        command_dynamics: Filter between the requested velocity and the tool.
        options: Further options.
        guides: Paths that attract the tool, by name.
    """

    projector_name = "tool_place"
    projected_manifold: SpaceManifold

    def __init__(
        self,
        manifold: SpaceManifold,
        first: np.ndarray,
        fixtures: Sequence[Fixture],
        admittance: Admittance,
        command_dynamics: CommandDynamics,
        options: FixtureOptions,
        guides: dict[str, Guide],
        *,
        rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
        duration: float | None = None,
    ) -> None:
        self.projected_manifold = self.manifold = manifold
        self._first, self._rotation_deg, self.warnings = first, rotation_deg, []
        self.fixtures, self.admittance, self.command_dynamics = (
            fixtures,
            admittance,
            command_dynamics,
        )
        self.options, self.guides = options, guides
        self.speeds = [fixture.largest_speed(first) for fixture in fixtures]
        self.motion = None
        if duration is not None:
            self.motion = PiecewisePolynomialCurve([0.0, duration], first[None, None])

    @property
    def is_planned(self) -> bool:
        """False: the operator commands the motion."""
        return False

    @property
    def projection_block(self) -> Projector:
        """Block that finds the closest point on the manifold."""
        return Projector(self.projected_manifold)

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``projected_manifold`` closest to a tool, shape (size,)."""
        return self.projected_manifold.point(y_t.tolist())

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return the start of the tool."""
        y_t, R_d = self._first + shift, None
        if self.projected_manifold.is_oriented:
            R_d = quaternion_to_matrix(
                self.projected_manifold.point(y_t)[self.projected_manifold.layout.quaternion]
            )
        return StartPoint(self._target(y_t, R_d, self._rotation_deg), y_t)

    def tool_positions(self) -> Iterator[tuple[np.ndarray, str]]:
        """Iterate over the start alone: the operator commands the motion."""
        yield self._first, "start"

    @property
    def target(self) -> CoordinateMap:
        """Identity: coordinates of the manifold are world coordinates."""
        return lambda coordinates, rates: (coordinates, rates)

    def check_coordinates(self, coordinates: np.ndarray, key: str) -> None:
        """Accept all coordinates: the manifold is all of space."""

    def distances(self, y_t: np.ndarray, clock: np.ndarray) -> np.ndarray:
        """Return the distances of tool points from each region [m], shape (samples, M).

        Args:
            y_t: Tool points [m], shape (samples, 3).
            clock: Clock of moving regions at each sample [s], shape (samples,).
        """
        samples = zip(y_t.tolist(), clock.tolist(), strict=True)
        return np.array(
            [
                [fixture.distance(point, time) for fixture in self.fixtures]
                for point, time in samples
            ]
        ).reshape(len(y_t), len(self.fixtures))
