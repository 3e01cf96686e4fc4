"""Waypoints of a hand-guiding run, a path fitted to them, and the scenario that follows it."""

import copy
import dataclasses as dc
import math
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from diagrams.scenario import Scenario
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.checks import require_between
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller.options.controller_parameters import LawGains
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
from pfsc_drake.yaml.dumping import typed_data
from pfsc_drake.yaml.reading import TAG_KEY, dump_yaml
from pfsc_drake.yaml.typed import load_file


@dc.dataclass(frozen=True)
class TeachingOptions:
    """Options of waypoints, fit and speed of a taught path.

    Attributes:
        spacing: Spacing of the waypoints [m].
        angle_deg: Rotation after which a further waypoint is taken [deg].
        closed: Whether the path is closed.
        tolerance: Largest distance of the path from a waypoint [m].
        tolerance_deg: Largest angle of the path from a waypoint's orientation [deg].
        velocity: Velocity along the path [m/s].
        acceleration: Acceleration along the path [m/s^2].
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
        """Largest rotation between waypoints [rad]."""
        return math.radians(self.angle_deg)


@dc.dataclass(frozen=True)
class Taught:
    """A taught path.

    Attributes:
        settings: Settings of the hand-guiding run.
        log: Log of the run.
        rows: Samples that became waypoints, shape (n,).
        table: Waypoints, measured by the controller.
        path: The fitted path.
    """

    settings: Scenario
    log: RunLog
    rows: np.ndarray
    table: WaypointTable
    path: Path

    @property
    def smoothness(self) -> int:
        """Order k of the class C^k of paths required by the law."""
        return smoothness_of(self.settings)


def read_run(folder: FilePath) -> tuple[Scenario, RunLog]:
    """Return scenario and log of a hand-guiding run.

    Args:
        folder: Folder of a run's results.

    Raises:
        InputError: If it is not the folder of a hand-guiding run.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; allowed: the folder of a run's results")
    settings = load_file(Scenario, folder / "scenario.yaml")
    manifold = settings.controller.manifold
    if manifold != SpaceManifold.name:
        raise InputError(
            f"{folder}: controller.manifold = {manifold}; allowed: {SpaceManifold.name}, a "
            "hand-guiding run"
        )
    return settings, RunLog.read(folder / "log.h5")


def taught_path(settings: Scenario, log: RunLog, options: TeachingOptions) -> Taught:
    """Return the taught path of a hand-guiding run.

    Args:
        settings: Settings of a run with ``controller.manifold: space``.
        log: Log of the run.
        options: Options of waypoints and fit.

    Raises:
        InputError: If nothing was taught, or no path fits.
    """
    positions, rotations = measured_tool(log)
    picked = rotations if keeps_orientation(settings) else None
    rows = pick_waypoints(
        positions, picked, Picking(options.spacing, options.angle, options.closed)
    )
    smoothness = smoothness_of(settings)
    if len(rows) < smoothness + 2:
        length = np.linalg.norm(np.diff(positions[rows], axis=0), axis=1).sum()
        raise InputError(
            f"taught path: {len(rows)} waypoints on {length:.3g} m; the law "
            f"'{settings.controller.law}' needs {smoothness + 2} or more: guide the tool farther, "
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
    """Return the order k of the class C^k of paths required by a scenario's law."""
    return RELATIVE_DEGREE[settings.controller.law] + 1


def keeps_orientation(settings: Scenario) -> bool:
    """Return whether a freely guided tool has an orientation."""
    return settings.fixtures is not None and settings.fixtures.orientation.kind == "given"


def measured_tool(log: RunLog) -> tuple[FloatArray, FloatArray]:
    """Return the tool poses measured by the controller's encoders and nominal model.

    Args:
        log: Log of a run.

    Returns:
        Tool points [m], shape (samples, 3), and orientations, shape (samples, 3, 3).

    Raises:
        InputError: If the log lacks the measured poses.
    """
    suffix = "_measured" if "y_t_measured" in log else ""
    if not suffix and "q_J_measured" in log:
        raise InputError("log.h5: has no y_t_measured; allowed: the log of a run of this version")
    return log[f"y_t{suffix}"].values, log[f"R_e{suffix}"].values.reshape(-1, 3, 3)


def actual_tool(log: RunLog) -> tuple[FloatArray, FloatArray]:
    """Return the actual tool poses; see :func:`measured_tool`."""
    return log["y_t"].values, log["R_e"].values.reshape(-1, 3, 3)


CSV_NAME, YAML_NAME = "taught.csv", "follow.yaml"
TRANSITION, DWELL = 0.3, 0.5  # s
# blocks of the robot, not of the task
_ROBOT_KEYS = (
    "robot",
    "friction",
    "drive_friction",
    "encoders",
    "model_error",
    "controller",
    "servo",
    "simulation",
    "faults",
)
_GRID = 1e-4  # m, to which the end of the motion is rounded


def follow_scenario(taught: Taught, options: TeachingOptions) -> dict[str, Any]:
    """Return the scenario: the same robot, law and gains, on the taught path.

    Without gains for the transversal coordinates the tangential ones are used.

    Args:
        taught: The path, whose waypoints are in ``CSV_NAME`` beside the scenario.
        options: Options of fit and speed.
    """
    settings = taught.settings
    values, default = typed_data(settings), typed_data(Scenario())
    blocks = {
        key: _without_defaults(values[key], default[key]) for key in _ROBOT_KEYS if key in values
    }
    blocks["robot"] |= {key: values["robot"][key] for key in ("model", "tool_frame")}
    controller = blocks["controller"] | {"gains": _gains(settings), "manifold": "path"}
    if settings.controller.external_torque.source == "measured":
        blocks["sensor"] = _without_defaults(values["sensor"], default["sensor"])
    shape = {
        "file": CSV_NAME,
        "closed": options.closed,
        "tolerance": options.tolerance,
        "tolerance_deg": options.tolerance_deg,
        TAG_KEY: "!Waypoints",
    }
    length = taught.path.length if options.closed else _GRID * int(taught.path.length / _GRID)
    return {
        "name": f"{settings.name or 'taught'}_follow",
        "section": "5.3",
        "description": f"Path following along the path taught by hand guiding in {settings.name}.",
        **{key: block for key, block in blocks.items() if block not in ({}, None)},
        "path": {"shape": shape} | _orientation(settings),
        "controller": controller,
        "reference": {
            "points": [0.0, round(length, 6)],
            "velocity": options.velocity,
            "acceleration": options.acceleration,
            "dwell": DWELL,
        },
        "start": {"posture_deg": _posture(taught), "transition": TRANSITION},
    }


def follow_text(taught: Taught, options: TeachingOptions) -> str:
    """Return the scenario as the content of a file."""
    return dump_yaml(follow_scenario(taught, options))


def _without_defaults(values: Any, default: Any) -> Any:
    """Return the entries that differ from their defaults."""
    if not (isinstance(values, dict) and isinstance(default, dict)):
        return values
    if values.get(TAG_KEY) != default.get(TAG_KEY):
        return values
    return {
        key: _without_defaults(value, default.get(key)) if key in default else value
        for key, value in values.items()
        if key not in default or value != default[key]
    }


def _gains(settings: Scenario) -> dict[str, Any]:
    law = settings.controller.law
    gains = _without_defaults(typed_data(settings.controller.gains[law]), typed_data(LawGains()))
    if "xi" not in gains:
        gains["xi"] = copy.deepcopy(gains["eta"])
    return {law: gains}


def _orientation(settings: Scenario) -> dict[str, Any]:
    """Return the orientation task of the path: the one of hand guiding."""
    if not keeps_orientation(settings):
        return {"orientation": {"task": "none"}}
    assert settings.fixtures is not None  # it keeps an orientation
    orientation = settings.fixtures.orientation
    if orientation.task == "full":
        return {}
    axis = {"tool_axis": "tool_axis", "yaw": "yaw_axis"}[orientation.task]
    return {"orientation": {"task": orientation.task, axis: list(getattr(orientation, axis))}}


def _posture(taught: Taught) -> list[float]:
    """Return the joint angles at the first waypoint [deg], or the run's start posture.

    The start posture is used for joints of both kinds, which the log does not distinguish.
    """
    log = taught.log
    signal = log["q_J_measured" if "q_J_measured" in log else "q_J"]
    q_J = signal.values[taught.rows[0]]
    if signal.unit == "m":
        return [round(value, 5) for value in q_J.tolist()]
    if signal.unit != "rad":
        return list(taught.settings.start.posture_deg)
    turns = np.round(np.rad2deg(q_J), 3).tolist()
    return [float(angle) for angle in turns]
