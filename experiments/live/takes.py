"""Takes: recorded controls of a person since the last reset, and their results."""

import dataclasses
import os
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np

from diagrams.environment.operator import Operator, controls_text
from diagrams.scenario import Streamed
from diagrams.station import Station
from diagrams.tasks.arrivals import END, NEW_PATH, WAYPOINT, Event, drawn_text, send_event
from diagrams.tasks.drawn_plane import plane_axes
from diagrams.tasks.streaming import ScenarioStream
from experiments.finished_run import FinishedRun, RunOutcome, write_outcome
from experiments.preparation import PreparedRun
from experiments.simulation import SimulationResult
from pfsc_drake.control.streams.growing_path import POSITION
from pfsc_drake.control.streams.messages import StreamStatus, WaypointSender
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.dumping import dump_typed
from reporting.folder import check_folder, open_results
from reporting.progress import ProgressListener

INPUTS, DRAWING = "operator.csv", "drawing.csv"
_NAME = "take"
_MOST = 10_000


class ControlRecord:
    """Record of controls since the last reset; only changes are stored.

    Args:
        operator: The operator.
    """

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self._ticks, self._rows = [0], [operator.idle]

    def note(self, tick: int, controls: np.ndarray) -> None:
        """Record the controls from a tick on.

        Args:
            tick: Number of the sampling interval.
            controls: Shape (size,).
        """
        if controls.tobytes() == self._rows[-1].tobytes():
            return
        if tick == self._ticks[-1]:
            self._rows[-1] = controls.copy()
            return
        self._ticks.append(tick)
        self._rows.append(controls.copy())

    def text(self) -> str:
        """Return the content of a file, see :mod:`diagrams.environment.operator`."""
        return controls_text(
            self._ticks, self._rows, self._operator.regions, self._operator.panel.period
        )


class Pen:
    """Conversion of points in a plane to waypoints, sent as fast as the station accepts them.

    Args:
        task: The streamed path.
    """

    def __init__(self, task: ScenarioStream) -> None:
        assert task.plane is not None
        self._task, self._plane = task, task.plane
        self._axes, self._origin = plane_axes(task.plane), np.array(task.plane.origin)
        self.restart()

    @classmethod
    def of(cls, station: Station) -> "Pen | None":
        """Return the pen of a station with a plane to draw in, or None.

        Args:
            station: The station.
        """
        task = station.task
        return cls(task) if isinstance(task, ScenarioStream) and task.plane is not None else None

    def restart(self) -> None:
        """Begin with an empty plane."""
        self._sender = WaypointSender(self._task.path.messages)
        self._waiting, self._events = deque[tuple[int, np.ndarray]](), list[Event]()

    def draw(self, points: list[list[float]]) -> None:
        """Add drawn points.

        Args:
            points: Each ``[right, up, kind]`` [m, m, 1], relative to the plane's centre.
        """
        half = np.array([self._plane.width, self._plane.height]) / 2.0
        for right, up, kind in points:
            # a pen that leaves the plane draws along its border
            inside = np.clip([right, up], -half, half)
            pose = self._task.path.start.copy()
            pose[:POSITION] = self._origin + inside @ self._axes
            known = int(kind) if kind in (WAYPOINT, NEW_PATH, END) else WAYPOINT
            if known == NEW_PATH:
                # pending waypoints are discarded
                self._waiting.clear()
            self._waiting.append((known, pose))

    def message(self, tick: int, taken: int) -> np.ndarray:
        """Return the message from a tick on, shape (size,).

        Args:
            tick: Number of the sampling interval.
            taken: Number of waypoints accepted by the station.
        """
        while self._waiting and self._sender.total - taken < self._task.path.messages.length:
            kind, pose = self._waiting.popleft()
            event = Event(tick, kind, pose)
            self._events.append(event)
            send_event(self._sender, event)
        return self._sender.message

    def text(self) -> str:
        """Return the content of a file for :func:`~diagrams.tasks.arrivals.read_drawn`."""
        return drawn_text(self._events, len(self._task.path.start), self._task.period)

    def content(self, y_t: np.ndarray, stream: np.ndarray) -> dict[str, object]:
        """Return the state of drawing as JSON content.

        Args:
            y_t: Tool point [m], shape (3,).
            stream: Status of the station's waypoint stream, see
                :class:`~pfsc_drake.control.streams.intake.WaypointIntake`.
        """
        return {
            "size": [self._plane.width, self._plane.height],
            "tool": (self._axes @ (y_t - self._origin)).tolist(),
            "status": StreamStatus(int(stream[0])).words,
            "taken": int(stream[1]),
            "sent": self._sender.total + sum(kind != END for kind, _ in self._waiting),
            "left": float(stream[2]),
        }


class TakeFolders:
    """Folders for takes, numbered in order.

    Args:
        out: Parent folder.
        name: Name of the scenario.
        inputs: Input files of the scenario.
        figures: Whether to draw figures.
        recording: Whether to record the motion.

    Raises:
        InputError: If they cannot be created.
    """

    def __init__(
        self,
        out: Path,
        name: str,
        inputs: list[Path],
        *,
        figures: bool = True,
        recording: bool = True,
    ) -> None:
        self._out, self._name, self._inputs = out, name, inputs
        self._figures, self._recording = figures, recording
        there = next(path for path in (out.absolute(), *out.absolute().parents) if path.exists())
        if not there.is_dir():
            raise InputError(f"--out {out}: {there} is no folder; allowed: a folder")
        if not os.access(there, os.W_OK | os.X_OK):
            raise InputError(f"--out {out}: {there} cannot be written; allowed: another folder")
        check_folder(self.next(), "run", inputs)

    def next(self) -> Path:
        """Return the next folder, which does not exist yet."""
        for number in range(1, _MOST):
            folder = self._out / f"{_NAME}_{number}"
            if not folder.exists():
                return folder
        raise InputError(f"--out {self._out}: {_MOST} takes; allowed: another folder")

    def write(
        self,
        prepared: PreparedRun,
        result: SimulationResult,
        files: dict[str, str],
        attributes: dict[str, str],
        progress: ProgressListener,
        interrupted: Callable[[], bool],
    ) -> tuple[Path, RunOutcome]:
        """Write a take: its inputs, a scenario that replays it, and the results of a run.

        Args:
            prepared: The live station.
            result: Its result; the context is modified.
            files: Contents of INPUTS, and of DRAWING if there is a plane.
            attributes: Further attributes of the log.
            progress: Progress listener.
            interrupted: Whether to skip slow steps.
        """
        folder = self.next()
        settings = dataclasses.replace(prepared.settings, duration=float(result.root.get_time()))
        assert settings.operator is not None
        settings.operator = dataclasses.replace(settings.operator, inputs=INPUTS)
        if DRAWING in files and isinstance(settings.path.shape, Streamed):
            shape = dataclasses.replace(settings.path.shape, inputs=DRAWING)
            settings.path = dataclasses.replace(settings.path, shape=shape)
        taken = dataclasses.replace(prepared, settings=settings, text=dump_typed(settings))
        run = FinishedRun(taken, self._name, result, attributes=attributes)
        with open_results(folder, "run", self._inputs) as results:
            for name, text in ({"scenario.yaml": taken.text} | files).items():
                results.write(name, text)
            outcome = write_outcome(
                run,
                results,
                progress,
                interrupted,
                figures=self._figures,
                recording=self._recording,
            )
        return folder, outcome
