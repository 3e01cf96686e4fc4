"""What a hand taught in a run: waypoints, as the controller saw them, and a path near them."""

import dataclasses as dc
import math
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario import Scenario
from diagrams.scenario.checks import require_between
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Path,
    Picking,
    Tolerance,
    WaypointTable,
    matrix_to_quaternion,
    path_from_waypoints,
    pick_waypoints,
)
from pfsc_drake.yaml.typed import load_file


@dc.dataclass(frozen=True)
class TeachingOptions:
    """How waypoints are picked, how closely a path fits them, and how fast it is followed.

    Attributes:
        spacing: Of the waypoints [m].
        angle_deg: Turn after which a waypoint is taken before that [deg].
        closed: Whether the tool was led back to where it began.
        tolerance: How far the path may be from a waypoint [m].
        tolerance_deg: The same of the orientation [deg].
        velocity: Along the path [m/s].
        acceleration: Along the path [m/s^2].
    """

    spacing: float = 0.01
    angle_deg: float = 3.0
    closed: bool = False
    tolerance: float = 2e-3
    tolerance_deg: float = 1.0
    velocity: float = 0.1
    acceleration: float = 0.5

    def __post_init__(self) -> None:
        require_between("--spacing", self.spacing, 1e-4, 1.0, "m")
        require_between("--angle", self.angle_deg, 0.1, 20.0, "deg")
        require_between("--tolerance", self.tolerance, 1e-6, 1.0, "m")
        require_between("--tolerance-deg", self.tolerance_deg, 1e-3, 90.0, "deg")
        require_between("--velocity", self.velocity, 1e-6, 1e3, "m/s")
        require_between("--acceleration", self.acceleration, 1e-6, 1e6, "m/s^2")

    @property
    def angle(self) -> float:
        """The angle [rad]."""
        return math.radians(self.angle_deg)


@dc.dataclass(frozen=True)
class Taught:
    """A taught path.

    Attributes:
        settings: Of the run in which a hand led the tool.
        log: Of that run.
        rows: Samples that became waypoints, shape (n,).
        table: The waypoints, where the controller took the tool to be.
        path: Near them.
    """

    settings: Scenario
    log: RunLog
    rows: np.ndarray
    table: WaypointTable
    path: Path

    @property
    def smoothness(self) -> int:
        """Class C^k of paths that the law needs, k."""
        return smoothness_of(self.settings)


def read_run(folder: FilePath) -> tuple[Scenario, RunLog]:
    """Return what was run, and its log.

    Args:
        folder: Of a run's results.

    Raises:
        InputError: If it holds none, or none of a tool that a hand led through space.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; allowed: the folder of a run's results")
    settings = load_file(Scenario, folder / "scenario.yaml")
    manifold = settings.controller.manifold
    if manifold != SpaceManifold.name:
        raise InputError(
            f"{folder}: controller.manifold = {manifold}; allowed: {SpaceManifold.name}, a tool "
            "that a hand led"
        )
    return settings, RunLog.read(folder / "log.h5")


def taught_path(settings: Scenario, log: RunLog, options: TeachingOptions) -> Taught:
    """Return the path that a hand taught.

    Args:
        settings: Of a run with ``controller.manifold: space``.
        log: Of that run.
        options: How waypoints are picked, and how closely the path fits them.

    Raises:
        InputError: If nothing was taught, or no path fits.
    """
    positions, rotations = seen_tool(log)
    picked = rotations if keeps_orientation(settings) else None
    rows = pick_waypoints(
        positions, picked, Picking(options.spacing, options.angle, options.closed)
    )
    smoothness = smoothness_of(settings)
    if len(rows) < smoothness + 2:
        length = np.linalg.norm(np.diff(positions[rows], axis=0), axis=1).sum()
        raise InputError(
            f"taught path: {len(rows)} waypoints on {length:.3g} m; the law "
            f"'{settings.controller.law}' needs {smoothness + 2} or more: lead the tool further, "
            f"or allow a --spacing below {options.spacing:g} m"
        )
    quaternions = None if picked is None else matrix_to_quaternion(picked[rows])
    table = WaypointTable(positions[rows], quaternions)
    path = path_from_waypoints(
        table,
        smoothness=smoothness,
        closed=options.closed,
        tolerance=Tolerance(options.tolerance, math.radians(options.tolerance_deg)),
    )
    return Taught(settings, log, rows, table, path)


def smoothness_of(settings: Scenario) -> int:
    """Return k of the class C^k that a scenario's law needs of a path."""
    return RELATIVE_DEGREE[settings.controller.law] + 1


def keeps_orientation(settings: Scenario) -> bool:
    """Return whether a tool that is led through space has an orientation."""
    return settings.fixtures is not None and settings.fixtures.orientation.kind == "given"


def seen_tool(log: RunLog) -> tuple[FloatArray, FloatArray]:
    """Return where the controller took the tool to be.

    By encoders and the model that it believes, where these are not perfect.

    Args:
        log: Of a run.

    Returns:
        Tool points [m], shape (samples, 3), and orientations, shape (samples, 3, 3).

    Raises:
        InputError: If the run had such encoders, and its log does not tell.
    """
    suffix = "_measured" if "y_t_measured" in log else ""
    if not suffix and "q_J_measured" in log:
        raise InputError("log.h5: has no y_t_measured; allowed: the log of a run of this version")
    return log[f"y_t{suffix}"].values, log[f"R_e{suffix}"].values.reshape(-1, 3, 3)


def true_tool(log: RunLog) -> tuple[FloatArray, FloatArray]:
    """Return where the tool was; see :func:`seen_tool`."""
    return log["y_t"].values, log["R_e"].values.reshape(-1, 3, 3)
