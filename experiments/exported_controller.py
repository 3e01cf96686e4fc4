"""Controllers in C from scripts and notebooks."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from diagrams.scenario import Scenario
from experiments.calls import only_own_words, read_given, shown_progress
from experiments.export import export_scenario
from experiments.kept_run import Run
from experiments.replay import Commands, Replay, check_export, missing_tool, replay_log
from experiments.scenario_file import expand_home
from pfsc_drake.checks import require_positive
from pfsc_drake.errors import InputError


@dataclass(frozen=True)
class ExportedController:
    """A controller as C99, in a folder.

    Attributes:
        folder: Where it is.
        files: All that was written.
        check: What it made of a recorded run, ``check.differing`` ticks of ``check.ticks``; None if
            that was not asked for.
    """

    folder: Path
    files: list[Path]
    check: Replay | None = None

    @cached_property
    def interface(self) -> dict[str, Any]:
        """Inputs and outputs with sizes and units, state in bytes, sampling time [s]."""
        content: dict[str, Any] = json.loads((self.folder / "interface.json").read_text("utf-8"))
        return content

    def replay(self, log: Run | str | Path, *, quiet: bool = False) -> Commands:
        """Return what it would have told the drives, tick by tick; needs gcc and make.

        Args:
            log: A run, its ``log.h5``, or a CSV file of a robot with columns ``t``, ``q_1``, ..,
                ``v_1``, ..
            quiet: Whether to show no progress.

        Raises:
            InputError: If it cannot be compiled, or the log does not tell what it needs.
        """
        file = log.folder / "log.h5" if isinstance(log, Run) else expand_home(Path(log))
        with shown_progress(self.folder.name, None, quiet, paced=False) as progress:
            return replay_log(self.folder, file, progress)


def export_controller(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    out: str | Path,
    check: bool = False,
    duration: float = 1.0,
    quiet: bool = False,
) -> ExportedController:
    """Write the controller of a scenario as C99, with the record of a run beside it.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        out: Folder for the files.
        check: Whether to compile it, let it repeat the run and compare; needs gcc and make.
        duration: Simulated time of that run [s].
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario or an argument is wrong, something in the controller is no
            block, or there is no compiler for a check.
    """
    require_positive("duration", duration)
    lacking = missing_tool() if check else None
    if lacking is not None:
        raise InputError(f"check = True: there is no {lacking} here; allowed: check = False")
    loaded, folder = read_given(scenario, changes or {}), expand_home(Path(out))
    with only_own_words(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        written = export_scenario(loaded, folder, duration, progress)
        replay = check_export(folder, progress) if check else None
    return ExportedController(folder, written.files, replay)
