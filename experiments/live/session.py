"""Live session: loop of operator, simulation in real time, and saved takes."""

import gc
from collections.abc import Callable
from pathlib import Path

from diagrams.live_view import LiveView
from experiments.finished_run import RunOutcome
from experiments.live.controls import tuned_parameters
from experiments.live.live_simulation import LiveSimulation, RealTimeClock
from experiments.live.page_server import Pages
from experiments.live.panel import Command, Panel, Scene
from experiments.live.status import LiveStatus
from experiments.live.takes import DRAWING, INPUTS, ControlRecord, Pen, TakeFolders
from experiments.preparation import PreparedRun
from reporting.progress import ProgressListener

# steps between two frames, and frames between two updates of the speed message
_FRAME, _STATUS = 4, 8
# real-time factors below and above which a change is reported
_SLOW, _AT_REAL_TIME = 0.9, 0.97


class LiveSession:
    """Simulation of a station in real time, controlled by a person.

    Simulated time is synchronized with a clock and pauses while results are written. A fault stops
    it until a reset. Controls since the last reset are saved as a take when a recording stops, or
    when the session ends.

    Args:
        prepared: A station with an operator.
        pages: Input of the controlling page.
        status: Current status, which is updated.
        folders: Folders of the takes.
        notify: Receives lines about events.
        clock: Synchronization of simulated time; real time by default.

    Attributes:
        status: See above.
        takes: Outcomes of saved takes by folder, the last one at the end of the session.
        interrupted: Whether the user stopped it.
    """

    def __init__(
        self,
        prepared: PreparedRun,
        pages: Pages,
        status: LiveStatus,
        folders: TakeFolders,
        notify: Callable[[str], None],
        clock: RealTimeClock | None = None,
    ) -> None:
        station, settings = prepared.station, prepared.settings
        assert station.operator is not None
        assert settings.operator is not None
        self._prepared, self._folders, self._notify = prepared, folders, notify
        self._station, self._operator = station, station.operator
        self.status, self.takes, self.interrupted = status, dict[Path, RunOutcome](), False
        self._simulation, self._clock = LiveSimulation(station, settings), clock or RealTimeClock()
        self._record, self._pen = ControlRecord(station.operator), Pen.of(station)
        limit = settings.operator.hand.force_limit
        tuned, drags = tuned_parameters(settings, station), settings.teleoperation is not None
        self._panel = Panel(pages, limit, tuned, self._operator.regions, drags=drags)
        self._frame = self._simulation.frame(self._simulation.signals())
        self._scene = Scene(
            lambda first, meshcat: LiveView(station, prepared.drawing, first, meshcat, limit),
            self._frame,
            notify,
        )
        self._steps, self._slow = 0, False

    @property
    def fault(self) -> str | None:
        """Fault that stopped the simulation, or None."""
        found = self._simulation.fault
        return None if found is None else found.sentence

    @property
    def end(self) -> float:
        """Current simulated time [s]."""
        return self._simulation.time

    def run(self, interrupted: Callable[[], bool], progress: ProgressListener) -> None:
        """Run until the person ends it, the end of the duration, or an interruption.

        Args:
            interrupted: Whether the user has stopped it.
            progress: Progress listener.
        """
        gc.collect()
        gc.freeze()
        try:
            self._loop(interrupted, progress)
        finally:
            # save the take, also after an exception
            try:
                self._keep(interrupted, progress)
            finally:
                gc.unfreeze()
                self.status.phase, self.interrupted = "ended", interrupted()

    def _loop(self, interrupted: Callable[[], bool], progress: ProgressListener) -> None:
        self._restart()
        while not interrupted():
            self._panel.look()
            for command in self._panel.commands():
                if command is Command.END:
                    return
                if command is Command.RESET:
                    self._reset(interrupted, progress)
                elif command is Command.RECORD:
                    self._toggle_recording(interrupted, progress)
            if self.status.phase == "fault":
                self._rest()
                continue
            self._step()
            if self._simulation.fault is None and self._is_over():
                self._notify(f"the session's duration is over, t = {self._simulation.time:.1f} s")
                return

    def _is_over(self) -> bool:
        last = self._prepared.settings.duration - 0.5 * self._station.controller.period
        return self._simulation.time > last

    def _restart(self) -> None:
        """Restart the clock, and update the status."""
        self.status.phase, self.status.message = "running", ""
        self._clock.restart(self._simulation.time)

    def _step(self) -> None:
        """Read the controls, advance, wait for the clock, update drawing and status."""
        simulation = self._simulation
        controls = self._panel.read(self._frame.hand)
        self._record.note(simulation.tick, controls)
        simulation.set(controls)
        if self._pen is not None:
            self._pen.draw(self._panel.take_strokes())
            simulation.send_waypoints(self._pen)
        simulation.step()
        self._clock.wait_until(simulation.time)
        self._steps += 1
        if self._steps % _FRAME == 0:
            self._show(whole=self._steps % (_STATUS * _FRAME) == 0)
        if simulation.fault is not None:
            self._stop()

    def _show(self, *, whole: bool) -> None:
        """Draw, and update the status; report the speed if ``whole``."""
        signals = self._simulation.signals()
        self._frame = self._simulation.frame(signals)
        self.status.time, self.status.factor = self._simulation.time, self._clock.factor
        self._draw()
        self.status.observe(self._station, signals)
        self.status.tool_point = self._frame.tool_pose[:3].tolist()
        self.status.controls = self._panel.content()
        if self._pen is not None:
            self.status.plane = self._pen.content(self._frame.tool_pose[:3], signals["stream"])
        if whole:
            self._report_speed()

    def _draw(self, *, interrupted: bool = False) -> None:
        self._scene.draw(self._frame, self.status.factor, interrupted=interrupted)
        self.status.scene = self._scene.url

    def _report_speed(self) -> None:
        """Report changes between real time and slower simulation."""
        factor = self.status.factor
        slow = factor < (_AT_REAL_TIME if self._slow else _SLOW)
        if slow != self._slow:
            how = f"slower than real time: {factor:.2f} x" if slow else "at real time"
            self._notify(f"t = {self._simulation.time:.1f} s: {how}")
        self._slow = slow

    def _stop(self) -> None:
        """Stop the simulation after a fault."""
        fault = self._simulation.fault
        assert fault is not None
        self._show(whole=False)
        self.status.phase = "fault"
        self.status.message = f"Fault: {fault.sentence}. Press X to reset."
        self._notify(f"fault: {fault.sentence}; stopped at t = {self._simulation.time:.3f} s")

    def _rest(self) -> None:
        """Wait a moment while the simulation is stopped."""
        self._clock.wait()
        self.status.controls = self._panel.content()

    def _reset(self, interrupted: Callable[[], bool], progress: ProgressListener) -> None:
        """Reset the simulation; unrecorded controls are discarded."""
        if self.status.recording is not None:
            self._keep(interrupted, progress)
        self._panel.let_go()
        self._simulation.restart()
        self._record = ControlRecord(self._operator)
        if self._pen is not None:
            self._panel.take_strokes()
            self._pen.restart()
        self.status.recording = None
        self._frame = self._simulation.frame(self._simulation.signals())
        self._draw(interrupted=True)
        self._notify("reset")
        self._restart()

    def _toggle_recording(
        self, interrupted: Callable[[], bool], progress: ProgressListener
    ) -> None:
        if self.status.recording is None:
            self.status.recording = self._simulation.time
            self._notify(f"recording from t = {self._simulation.time:.1f} s")
            return
        self._keep(interrupted, progress)
        if self._simulation.fault is None:
            self._restart()
        else:
            self.status.phase = "fault"

    def _keep(self, interrupted: Callable[[], bool], progress: ProgressListener) -> None:
        """Write a take since the last reset, if any; simulated time pauses meanwhile."""
        if self._simulation.tick == 0:
            return
        message = self.status.message
        self.status.phase, self.status.message = (
            "saving",
            "Simulation paused while results are written.",
        )
        attributes = {}
        if self.status.recording is not None:
            attributes["recorded_from"] = f"{self.status.recording:.3f} s"
        self.status.recording = None
        files = {INPUTS: self._record.text()}
        if self._pen is not None:
            files[DRAWING] = self._pen.text()
        result = self._simulation.result()
        folder, outcome = self._folders.write(
            self._prepared, result, files, attributes, progress, interrupted
        )
        self.takes[folder] = outcome
        self.status.takes = [str(path) for path in self.takes]
        self.status.message = message
        self._notify(f"take written to {folder}")
