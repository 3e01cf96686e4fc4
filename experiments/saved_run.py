"""A saved run in its folder, for scripts and notebooks."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from experiments.results.run_log import RunLog, Signal
from experiments.scenario_file import expand_home
from pfsc_drake.errors import InputError, WriteError
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.notebook import in_notebook, page_frame, short_table, show_html
from reporting.provenance import FIGURES, listed_results, read_outcome
from reporting.registry import FIGURES as KNOWN_FIGURES

if TYPE_CHECKING:
    import pandas as pd

    from diagrams.scenario import Scenario
    from reporting.style import Figure

_KIND = "run"


@dataclass
class Run:
    """A saved run: signals, metrics, figures, recording and outcome.

    Results are read when accessed. In a notebook a run is displayed as a short table.

    Attributes:
        folder: Folder of the results.
        fault: Fault that stopped the run, or None.
        missed: Violated requirements, one phrase each.
        warnings: Warnings, one sentence each.
        interrupted: Whether the user stopped it.
    """

    folder: Path
    fault: str | None = None
    missed: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    interrupted: bool = False

    @cached_property
    def log(self) -> RunLog:
        """All signals: ``log.time`` [s], ``log["xi"]`` with ``values``, ``unit``, ``labels``."""
        return RunLog.read(self.folder / "log.h5")

    @cached_property
    def metrics(self) -> Metrics:
        """Metrics by name, each with ``value``, ``unit``, ``target``, ``passed``."""
        return Metrics.read(self.folder / "metrics.json")

    @cached_property
    def figures(self) -> "dict[str, Figure]":
        """Figures by name, each with ``png`` and ``caption``; a notebook shows them."""
        from reporting.style import Figure

        names = [Path(name).stem for name in listed_results(self.folder) if FIGURES in name]
        texts = {name: KNOWN_FIGURES[name].text if name in KNOWN_FIGURES else "" for name in names}
        return {
            name: Figure(name, name.replace("_", " "), texts[name], self._read_figure(name))
            for name in names
        }

    @property
    def scenario(self) -> "Scenario":
        """The resolved scenario, a new object at each access: to be changed and run again."""
        from diagrams.scenario import Scenario
        from pfsc_drake.yaml.typed import load_file

        return load_file(Scenario, self.folder / "scenario.yaml")

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self.log.attributes["scenario"]

    @property
    def report(self) -> Path:
        """Page to open in a browser."""
        return self._file("report.html")

    @property
    def recording(self) -> Path:
        """Page that shows the motion.

        Raises:
            InputError: If nothing was recorded.
        """
        return self._file("recording.html")

    def to_dataframe(self) -> "pd.DataFrame":
        """Return all signals as a pandas table; pandas is not a dependency of this project.

        Its index is the time ``t`` [s], its columns are pairs of a signal and a component, so that
        ``table["xi"]`` has the components of ``xi``. Signals of names (``mode``, ``fault``) are
        categorical, with one component of the signal's own name. Units are in ``attrs["units"]``.
        """
        import pandas as pd

        columns: dict[tuple[str, str], Any] = {}
        for name, signal in self.log.signals.items():
            if _has_names(signal):
                kinds = pd.Categorical.from_codes(signal.values[:, 0], signal.labels)
                columns[name, name] = kinds
                continue
            for label, values in zip(signal.labels, signal.values.T, strict=True):
                columns[name, label] = values
        table = pd.DataFrame(columns, index=pd.Index(self.log.time, name="t"))
        table.attrs["units"] = {name: signal.unit for name, signal in self.log.signals.items()}
        return table

    def show(self, height: int = 480) -> None:
        """Show the recording below a notebook cell; elsewhere print its path.

        Args:
            height: Height of the frame in a notebook [pixels].

        Raises:
            InputError: If nothing was recorded.
        """
        if in_notebook():
            show_html(page_frame(self.recording, height, f"Recording of {self.name}"))
        else:
            Console().print(str(self.recording), soft_wrap=True, highlight=False, markup=False)

    def save(self, folder: str | Path) -> "Run":
        """Copy all results into a folder, and return the copied run.

        Args:
            folder: Target folder; results of an earlier run are replaced.

        Raises:
            InputError: If the folder cannot be used or written.
        """
        target = expand_home(Path(folder))
        names = listed_results(self.folder)
        with open_results(target, _KIND, [self.folder / name for name in names]) as results:
            for name in names:
                results.write(name, (self.folder / name).read_bytes())
            results.tell(read_outcome(self.folder, _KIND))
            problem = results.explain_problems()
        if problem is not None:
            raise WriteError(problem)
        return load(target)

    def _repr_html_(self) -> str:
        """Return the run as a short table."""
        end = self.log.end
        ends = [f"interrupted at t = {end:.3f} s"] if self.interrupted else []
        if self.fault is not None:
            ends.append(f"fault: {self.fault}; stopped at t = {end:.3f} s")
        ends += [f"missed: {phrase}" for phrase in self.missed]
        return short_table(self.name, ends, self.warnings, self.metrics)

    def _read_figure(self, name: str) -> bytes:
        return (self.folder / FIGURES / f"{name}.png").read_bytes()

    def _file(self, name: str) -> Path:
        path = self.folder / name
        if not path.is_file():
            raise InputError(f"{path}: no such file; allowed: a run that has written it")
        return path


def load(folder: str | Path) -> Run:
    """Load a run from its folder.

    Args:
        folder: Folder of a run, written by this module, the command line or a driven robot.

    Raises:
        InputError: If it is not the folder of a run.
    """
    path = expand_home(Path(folder))
    if not path.is_dir():
        raise InputError(f"{path}: no such folder; allowed: the folder of a run")
    outcome = read_outcome(path, _KIND)
    fault = outcome.get("fault")
    return Run(
        path,
        None if fault is None else str(fault),
        [str(phrase) for phrase in outcome.get("missed", [])],
        [str(sentence) for sentence in outcome.get("warnings", [])],
        bool(outcome.get("interrupted", False)),
    )


def _has_names(signal: Signal) -> bool:
    """Return whether the values of a signal are indices of its labels."""
    values = signal.values
    return bool(
        np.issubdtype(values.dtype, np.integer)
        and signal.dim == 1
        and len(set(signal.labels)) == len(signal.labels) > 1
        and values.size
        and 0 <= values.min() <= values.max() < len(signal.labels)
    )
