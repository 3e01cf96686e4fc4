"""A first scenario for a user's own robot and points, tried before it is written."""

import os
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from diagrams.robots.model import is_delta
from experiments.finished_run import RunOutcome
from experiments.new_scenario.arm_choice import ArmChoice, Ask
from experiments.new_scenario.points_choice import PointsChoice
from experiments.new_scenario.scenario_text import ScenarioText
from experiments.scenario_file import SCENARIO_DIRECTORY, ScenarioFile
from experiments.simulated_run import RunOptions, run_scenario
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import parse_yaml
from reporting.progress import ProgressListener

BANDWIDTH = 20.0  # 1/s, of all coordinates
_FASTEST, _LEAST_TIME = 0.2, 4.0  # m/s, and s for the whole path
_SATURATED = 0.05  # of the samples of a trial that stopped
_TRIALS = 3  # each at half the speed of the one before


@dataclass(frozen=True)
class InitOptions:
    """Choices of the user; empty for automatic ones.

    Attributes:
        tool_frame: Frame of the model that follows the points.
        law: Law of the controller.
        unit: Unit of the points.
        orientation: ``down``, ``forward``, ``up`` or ``free``.
        base_position: Position of the robot's base in the world [m], three numbers or none.
    """

    tool_frame: str = ""
    law: str = ""
    unit: str = ""
    orientation: str = ""
    base_position: tuple[float, ...] = ()


class Choice(NamedTuple):
    """A choice of a first scenario.

    Attributes:
        key: Key path.
        value: Value, as shown.
        reason: Reason, one phrase.
    """

    key: str
    value: str
    reason: str


class FirstScenario:
    """A first scenario.

    Args:
        model: Name of a shipped model, or a URDF, SDF or MJCF file.
        points: CSV file of points.
        out: YAML file that is to be written.
        options: Choices of the user.
        ask: Returns one of several names, the first being the default.

    Attributes:
        choices: Key, value and reason of each choice.

    Raises:
        InputError: If model or points cannot be read, or do not suit each other.
    """

    def __init__(self, model: str, points: str, out: Path, options: InitOptions, ask: Ask) -> None:
        if is_delta(model):
            raise InputError(f"{model}: a DELTA robot; allowed: the model of a serial arm")
        self._out, self._options, self._model = out, options, model
        self._arm = ArmChoice(model, options.tool_frame, options.law, ask)
        chain = self._arm.arm.chain
        base = chain.links[0].p_PF + np.array(options.base_position or (0.0, 0.0, 0.0))
        self._points = PointsChoice(points, options.unit, base, chain.reach)
        self._speed = float(f"{min(_FASTEST, self._points.length / _LEAST_TIME):.1g}")
        self._orientation: tuple[Mapping[str, object], str] = ({}, "")
        self._slower = ""

    def find(self, progress: ProgressListener) -> RunOutcome:
        """Find an orientation with which it can start, and a speed at which it completes.

        Args:
            progress: Receives the simulated time and the name of the step.

        Returns:
            Outcome of the trial run.

        Raises:
            InputError: If there is none.
        """
        dimension = self._arm.arm.chain.dimension
        fastest, refused, stopped = self._speed, list[str](), ""
        for orientation in self._points.orientations(dimension, self._options.orientation):
            self._orientation, self._speed, self._slower = orientation, fastest, ""
            try:
                outcome, fault = self._slow_down(progress)
            except InputError as error:
                refused.append(str(error))
                continue
            if outcome is not None:
                return outcome
            stopped = stopped or fault
        if stopped:
            raise InputError(
                f"{self._points.file}: the trial run does not complete: {stopped}; allowed: points "
                "that the arm can follow; --orientation, --tool-frame and --base-position choose "
                "otherwise"
            )
        # what is said of a posture that was reached tells more
        refused.sort(key=lambda message: "unreachable" in message)
        raise InputError(
            f"{self._points.file}: {refused[0].removeprefix(f'{self._out}: ')}; "
            "--base-position, --unit, --orientation and --tool-frame choose otherwise"
        )

    def _slow_down(self, progress: ProgressListener) -> tuple[RunOutcome | None, str]:
        """Try slower and slower; return the outcome if one completes, and why the first did not."""
        faults: list[str] = []
        for _ in range(_TRIALS):
            outcome = self._try(progress)
            fault = outcome.fault or "; ".join(outcome.broken)
            if not fault:
                return outcome, ""
            saturated = outcome.metrics.get("saturated_share")
            if saturated is not None and saturated.value > _SATURATED:
                fault += f"; drives at their limit in {saturated.value:.0%} of the samples"
            faults.append(fault)
            self._slower = f"at {self._speed:g} m/s the trial run stops"
            self._speed = float(f"{self._speed / 2.0:.1g}")
            if len(faults) > 1 and _same_position(*faults[-2:]):
                break  # the geometry stops it, not the speed
        return None, faults[0]

    def _try(self, progress: ProgressListener) -> RunOutcome:
        with tempfile.TemporaryDirectory() as folder:
            return run_scenario(
                self._file(),
                out=Path(folder) / "trial",
                options=RunOptions(figures=False, recording=False),
                progress=progress,
            )

    def _file(self) -> ScenarioFile:
        return ScenarioFile(self._out, parse_yaml(self.text(), str(self._out)))

    def _relative(self, file: str) -> str:
        """Return a file as the scenario names it, which looks from its own folder."""
        if not Path(file).suffix or file.startswith("package://"):
            return file
        return os.path.relpath(Path(file).expanduser().resolve(), self._out.resolve().parent)

    @property
    def choices(self) -> list[Choice]:
        """Key, value and reason of each choice."""
        arm, points = self._arm, self._points
        reason = arm.reasons.get("tool_frame", "as requested")
        rows = [Choice("robot.tool_frame", arm.tool_frame, reason)]
        if arm.fixed_joints:
            names = ", ".join(arm.fixed_joints)
            rows.append(Choice("robot.fixed_joints", names, arm.reasons["fixed_joints"]))
        rows.append(Choice("controller.law", arm.law, arm.reasons.get("law", "as requested")))
        unit_reason = points.reasons.get(
            "unit", "as requested" if self._options.unit else "the points are within reach"
        )
        rows.append(Choice("path.shape.unit", points.unit, unit_reason))
        if points.is_closed:
            rows.append(Choice("path.shape.closed", "true", points.reasons["closed"]))
        if points.corner_distance:
            corner = f"{points.corner_distance:g} m", points.reasons["corner_distance"]
            rows.append(Choice("path.shape.corner_distance", *corner))
        if points.tolerance:
            tolerance = f"{points.tolerance:g} m", points.reasons["tolerance"]
            rows.append(Choice("path.shape.tolerance", *tolerance))
        setting, reason = self._orientation
        shown = yaml.safe_dump(dict(setting), default_flow_style=True, width=1000).strip()
        rows.append(Choice("path.orientation", shown if setting else "of the file", reason))
        length = f"{points.length:.4g} m of path"
        rows.append(Choice("reference.velocity", f"{self._speed:g} m/s", self._slower or length))
        return rows

    def text(self) -> str:
        """Return the text of the scenario."""
        arm, points, options = self._arm, self._points, self._options
        reasons = {key: reason for key, _, reason in self.choices}
        schema = os.path.relpath(
            SCENARIO_DIRECTORY / "scenario.schema.json", self._out.resolve().parent
        )
        text = ScenarioText(f"yaml-language-server: $schema={schema}")
        text.add(0, "name", self._out.stem)
        text.add(0, "robot")
        text.add(1, "model", self._relative(self._model))
        text.add(1, "tool_frame", arm.tool_frame, reasons["robot.tool_frame"])
        if arm.fixed_joints:
            text.add(1, "fixed_joints", arm.fixed_joints, reasons["robot.fixed_joints"])
        if options.base_position:
            text.add(1, "base_pose", {"position": list(options.base_position)})
        text.add(0, "path")
        shape: dict[str, object] = {"file": self._relative(points.file)}
        shape |= {"unit": points.unit} if points.unit != "m" else {}
        shape |= {"closed": True} if points.is_closed else {}
        if points.corner_distance:
            shape["corner_distance"] = points.corner_distance
        if points.tolerance:
            shape["tolerance"] = points.tolerance
        text.add(1, "shape", shape, "; ".join(points.reasons.values()), tag="!Waypoints")
        setting, reason = self._orientation
        if setting:
            text.add(1, "orientation", dict(setting), reason)
        text.add(0, "controller")
        text.add(1, "law", arm.law, reasons["controller.law"])
        text.add(1, "gains")
        text.add(2, arm.law)
        gains = {"poles": "auto", "bandwidth": BANDWIDTH}
        for coordinates, words in (("eta", "along"), ("xi", "across"), ("phi", "orientation")):
            if coordinates != "phi" or setting.get("task") != "none":
                text.add(3, coordinates, gains, f"{words}, 1/s")
        text.add(0, "reference")
        text.add(1, "points", [0, "end"], "arc lengths along the path, m")
        text.add(1, "velocity", self._speed, f"m/s; {self._slower}" if self._slower else "m/s")
        text.add(1, "acceleration", float(f"{4.0 * self._speed:.2g}"), "m/s^2")
        return str(text)

    def write(self, *, replace: bool = False) -> None:
        """Write the file.

        Args:
            replace: Whether it may exist.

        Raises:
            InputError: If it exists otherwise, or cannot be written.
        """
        try:
            with self._out.open("w" if replace else "x", encoding="utf-8") as file:
                file.write(self.text())
        except FileExistsError:
            raise InputError(f"{self._out}: exists; allowed: a new file, --out FILE.yaml") from None
        except OSError as error:
            raise InputError(
                f"{self._out}: cannot be written: {error.strerror}; allowed: a folder that is "
                "writable"
            ) from None


def _same_position(one: str, other: str) -> bool:
    """Return whether two faults name the same position on the path."""
    found = [re.search(r"eta = (-?[\d.]+)", fault) for fault in (one, other)]
    if None in found:
        return False
    first, second = (float(match[1]) for match in found if match)
    return abs(first - second) <= 0.02 * max(abs(first), abs(second))
