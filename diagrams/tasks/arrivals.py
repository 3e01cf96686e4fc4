"""Arrival times of the waypoints of a scenario's stream."""

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from diagrams.scenario.recorded_times import TIME, sampling_instants, time_column, time_text
from diagrams.scenario.streamed import Streamed
from pfsc_drake.control.streams.growing_path import POSE, POSITION
from pfsc_drake.control.streams.messages import WaypointLayout, WaypointSender
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import read_waypoints
from pfsc_drake.geometry.files.number_table import check_columns, read_numbers
from pfsc_drake.physics.waypoint_source import Arrivals

_POSITION, _QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
# events of a drawing: a waypoint, the first one of a new path, the end of a line
WAYPOINT, NEW_PATH, END = range(3)
_SOON = 1  # tick


def columns(dimension: int, when: str = TIME) -> list[str]:
    """Return the columns of a file with a drawing.

    Args:
        dimension: 3 or 7.
        when: Name of the column with times.
    """
    return [when, "kind", *_POSITION, *(_QUATERNION if dimension == POSE else ())]


def read_poses(file: FilePath, key: str) -> np.ndarray:
    """Return the waypoints of a file, with their quaternions if there are any, shape (n, d).

    Args:
        file: The file.
        key: Key of the scenario, for messages.

    Raises:
        InputError: If it cannot be read, or has fewer than two.
    """
    try:
        table = read_waypoints(file)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None
    if len(table.positions) < 2:
        raise InputError(f"{key}: {file.name} has {len(table.positions)} waypoints; 2 or more")
    if table.yaw_alone:
        raise InputError(f"{key}: {file.name} has yaw alone; roll and pitch besides are required")
    if table.quaternions is None:
        return table.positions
    return np.hstack([table.positions, table.quaternions])


def read_arrivals(shape: Streamed, folder: FilePath, period: float) -> tuple[np.ndarray, Arrivals]:
    """Return the begin of a stream of files, shape (d,), and the arrival of its waypoints.

    Args:
        shape: Path of the scenario.
        folder: Base folder of relative file names.
        period: Sampling time [s].

    Raises:
        InputError: If a file cannot be read, or they do not go together.
    """
    random = np.random.default_rng(shape.seed)
    poses = read_poses(folder / shape.file, "path.shape.file")
    start, rows, times = poses[0], poses[1:], shape.begin + np.arange(len(poses) - 1) / shape.rate
    new = np.zeros(len(rows))
    for i, path in enumerate(shape.new_paths):
        key = f"path.shape.new_paths[{i}]"
        further = read_poses(folder / path.file, f"{key}.file")
        if further.shape[1] != len(start):
            raise InputError(f"{key}.file: {path.file} has an orientation, or the first file has")
        before = times < path.at
        if not before.any():
            raise InputError(f"{key}.at = {path.at} s: must be later than the waypoints before")
        first = np.arange(len(further)) == 0
        rows, new = np.vstack([rows[before], further]), np.concatenate([new[before], first])
        times = np.concatenate([times[before], path.at + np.arange(len(further)) / shape.rate])
    late = shape.delay + shape.jitter * random.random(len(times))
    # in their order
    come = np.maximum.accumulate(times + late)
    noisy = rows.copy()
    noisy[:, :POSITION] += shape.noise * random.standard_normal((len(rows), POSITION))
    ticks = np.ceil(come / period - 1e-9).astype(int)
    return start, Arrivals(ticks, np.column_stack([noisy, new]), int(ticks[-1]) + _SOON)


class Event(NamedTuple):
    """Event of a drawing by a person.

    Attributes:
        tick: Sampling interval from which on it is sent.
        kind: ``WAYPOINT``, ``NEW_PATH`` or ``END``.
        pose: Waypoint, shape (d,).
    """

    tick: int
    kind: int
    pose: np.ndarray


def send_event(sender: WaypointSender, event: Event) -> None:
    """Send an event.

    Args:
        sender: The sender.
        event: The event.
    """
    if event.kind == END:
        sender.end()
    else:
        sender.add(event.pose, new_path=event.kind == NEW_PATH)


def waypoint_messages(
    events: Sequence[Event], layout: WaypointLayout
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ticks at which messages change, shape (k + 1,), and the messages, (k + 1, size).

    The first is the message before all events, at tick 0.

    Args:
        events: Events of the drawing.
        layout: Layout of the messages.
    """
    sender = WaypointSender(layout)
    ticks, rows = [0], [sender.message]
    for event in events:
        send_event(sender, event)
        ticks.append(event.tick)
        rows.append(sender.message)
    return np.array(ticks), np.array(rows)


def strokes(events: Sequence[Event]) -> list[np.ndarray]:
    """Return the lines of a drawing [m], each (points, 3).

    Args:
        events: Events of the drawing.
    """
    lines: list[list[np.ndarray]] = [[]]
    for event in events:
        if event.kind != WAYPOINT and lines[-1]:
            lines.append([])
        if event.kind != END:
            lines[-1].append(event.pose[:POSITION])
    return [np.array(line) for line in lines if len(line) > 1]


def drawn_text(events: Sequence[Event], dimension: int, period: float) -> str:
    """Return the text of a file that :func:`read_drawn` reads back exactly.

    Args:
        events: Events of the drawing.
        dimension: 3 or 7.
        period: Sampling time [s].
    """
    lines = [",".join(columns(dimension))]
    for tick, kind, pose in events:
        when = time_text(tick, period)
        lines.append(",".join([when, str(kind), *(repr(float(x)) for x in pose)]))
    return "\n".join(lines) + "\n"


def read_drawn(name: str, dimension: int, period: float) -> list[Event]:
    """Read the drawing of a person.

    Args:
        name: The file.
        dimension: 3 or 7.
        period: Sampling time [s].

    Raises:
        InputError: If it cannot be read, or its times decrease.
    """

    def check_header(location: str, header: list[str]) -> None:
        known = columns(dimension, time_column(header))
        check_columns(location, header, known=known, required=known)

    table = read_numbers(name, "events of a drawing", check_header)
    when = time_column(table.header)
    rows = table.rows[:, [table.header.index(label) for label in columns(dimension, when)]]
    ticks = sampling_instants(name, when, rows[:, 0], period)
    if not np.all(np.isin(rows[:, 1], (WAYPOINT, NEW_PATH, END))):
        raise InputError(f"{name}: column 'kind' must be {WAYPOINT}, {NEW_PATH} or {END}")
    return [Event(int(tick), int(row[1]), row[2:]) for tick, row in zip(ticks, rows, strict=True)]
