"""What a person did since the last reset, and what is left of it."""

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from diagrams.scenario import Streamed
from diagrams.surroundings.operator import Operator, controls_text
from experiments.finished_run import FinishedRun, RunOutcome, write_outcome
from experiments.live.pen import DRAWING
from experiments.preparation import PreparedRun
from experiments.simulation import SimulationResult
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import dump_typed
from reporting.folder import check_folder, open_results
from reporting.progress import ProgressListener

INPUTS = "operator.csv"
_NAME = "take"
_MOST = 10_000


class ControlRecord:
    """The controls from the last reset on, tick by tick; only changes are kept.

    Args:
        operator: Whose controls.
    """

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self._ticks, self._rows = [0], [operator.idle]

    def note(self, tick: int, controls: np.ndarray) -> None:
        """Note what holds from a tick on.

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
        """Return the content of a file, see :mod:`diagrams.surroundings.operator`."""
        return controls_text(
            self._ticks, self._rows, self._operator.regions, self._operator.panel.period
        )


class TakeFolders:
    """Folders for takes, numbered in the order in which they are kept.

    Args:
        out: Where they are made.
        inputs: Files that takes are made from.

    Raises:
        InputError: If they cannot be.
    """

    def __init__(self, out: Path, inputs: list[Path]) -> None:
        self._out, self._inputs = out, inputs
        there = next(path for path in (out.absolute(), *out.absolute().parents) if path.exists())
        if not there.is_dir():
            raise InputError(f"--out {out}: {there} is no folder; allowed: a folder")
        if not os.access(there, os.W_OK | os.X_OK):
            raise InputError(f"--out {out}: {there} cannot be written; allowed: another folder")
        check_folder(self.next(), "run", inputs)

    def next(self) -> Path:
        """Return the next folder, which is not there yet."""
        for number in range(1, _MOST):
            folder = self._out / f"{_NAME}_{number}"
            if not folder.exists():
                return folder
        raise InputError(f"--out {self._out}: {_MOST} takes; allowed: another folder")

    def write(
        self,
        prepared: PreparedRun,
        name: str,
        result: SimulationResult,
        record: ControlRecord,
        progress: ProgressListener,
        interrupted: Callable[[], bool],
        *,
        attributes: dict[str, str],
        figures: bool,
        recording: bool,
        drawing: str | None = None,
    ) -> tuple[Path, RunOutcome]:
        """Keep a take: its inputs, a scenario that repeats it, and what a run leaves.

        Args:
            prepared: The live station.
            name: Name of its scenario.
            result: What came of it; its context is used up.
            record: The controls.
            progress: Told what goes on.
            interrupted: Whether to leave out what takes long.
            attributes: What else to note in the log.
            figures: Whether to draw figures.
            recording: Whether to record the motion.
            drawing: What was drawn, if anybody draws.
        """
        folder = self.next()
        settings = dataclasses.replace(prepared.settings, duration=float(result.root.get_time()))
        assert settings.operator is not None
        settings.operator = dataclasses.replace(settings.operator, inputs=INPUTS)
        if drawing is not None and isinstance(settings.path.shape, Streamed):
            shape = dataclasses.replace(settings.path.shape, inputs=DRAWING)
            settings.path = dataclasses.replace(settings.path, shape=shape)
        taken = dataclasses.replace(prepared, settings=settings, text=dump_typed(settings))
        run = FinishedRun(taken, name, result, attributes=attributes)
        with open_results(folder, "run", self._inputs) as results:
            results.write("scenario.yaml", taken.text)
            results.write(INPUTS, record.text())
            if drawing is not None:
                results.write(DRAWING, drawing)
            outcome = write_outcome(
                run, results, progress, interrupted, figures=figures, recording=recording
            )
        return folder, outcome
