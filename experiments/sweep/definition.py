"""What makes a sweep the sweep it is, and the file that keeps it with its rows."""

import dataclasses
import json
import shlex
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.sweep.worker import RunRow
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import read_text
from reporting.folder import ResultsFolder

RECORD = "sweep.json"

_PROGRAM = ("python", "-m", "experiments")
# no row is older than this when the process is killed [s], or than so many times what writing takes
_OLDEST, _SHARE = 2.0, 20.0
_SPOKEN = {
    "vary": "--vary {}",
    "samples": "--samples {}",
    "seed": "--seed {}",
    "overrides": "--set {}",
    "duration": "--duration {}",
    "content": "another scenario, or one that has changed since",
}


@dataclass(frozen=True)
class SweepDefinition:
    """All that decides what the runs of a sweep are.

    Attributes:
        scenario: As given on the command line.
        vary: Each ``--vary``.
        overrides: Each ``--set``.
        duration: Simulated time [s]; None for the scenario's.
        samples: Number of random draws; None without any.
        seed: Of the draws.
        content: SHA-256 of the scenario with ``overrides`` applied.
    """

    scenario: str
    vary: tuple[str, ...]
    overrides: tuple[str, ...]
    duration: float | None
    samples: int | None
    seed: int
    content: str

    def to_data(self) -> dict[str, Any]:
        """Returns the definition as data for JSON."""
        return json.loads(json.dumps(dataclasses.asdict(self)))

    def command(self) -> str:
        """Returns the command line of the sweep."""
        words = [*_PROGRAM, "sweep", self.scenario]
        for option in self.vary:
            words += ["--vary", option]
        if self.samples is not None:
            words += ["--samples", str(self.samples)]
        words += ["--seed", str(self.seed), *self._common(())]
        return shlex.join(words)

    def run_command(self, overrides: tuple[str, ...]) -> str:
        """Returns the command line that repeats one run.

        Args:
            overrides: Of its sample.
        """
        return shlex.join([*_PROGRAM, "run", self.scenario, *self._common(overrides)])

    def difference(self, other: dict[str, Any]) -> str | None:
        """Returns what another sweep has otherwise, e.g. ``--seed 1``; None if it is the same.

        Args:
            other: From :meth:`to_data`.
        """
        own = self.to_data()
        for name, spoken in _SPOKEN.items():
            if other.get(name) != own[name]:
                return spoken.format(_words(other.get(name)))
        return None

    def _common(self, overrides: tuple[str, ...]) -> list[str]:
        words = []
        for option in (*self.overrides, *overrides):
            words += ["--set", option]
        if self.duration is not None:
            words += ["--duration", repr(self.duration)]
        return words


class SweepRecord:
    """Definition and rows of a sweep, kept in a folder while the rows come in.

    Attributes:
        rows: By number of the sample.
    """

    def __init__(self, results: ResultsFolder, definition: SweepDefinition) -> None:
        """Takes up what the folder holds of the same sweep.

        Raises:
            InputError: If the folder holds rows of another sweep, or its record cannot be read.
        """
        self._results, self._definition = results, definition
        self._written, self._pause = time.monotonic(), _OLDEST
        path = results.path / RECORD
        self.rows = _read(path, results.path, definition) if path.exists() else {}
        self.save()

    def missing(self, count: int) -> list[int]:
        """Returns the numbers of the samples that have no final row yet, of ``count``."""
        return [i for i in range(count) if i not in self.rows or not self.rows[i].is_final]

    def take(self, number: int, row: RunRow) -> None:
        """Takes a row; writes all of them if that was last done some time ago."""
        self.rows[number] = row
        begin = time.monotonic()
        if begin - self._written >= self._pause:
            self.save()
            self._pause = max(_OLDEST, _SHARE * (time.monotonic() - begin))

    def save(self) -> None:
        """Write all rows."""
        rows = {str(i): self.rows[i].to_data() for i in sorted(self.rows)}
        content = {"sweep": self._definition.to_data(), "rows": rows}
        text = json.dumps(content, allow_nan=False, separators=(",", ":"))
        self._results.write(RECORD, text + "\n")
        self._written = time.monotonic()


def _read(path: Path, folder: Path, definition: SweepDefinition) -> dict[int, RunRow]:
    """Rows of an earlier session."""
    try:
        content = json.loads(read_text(path))
        difference = definition.difference(content["sweep"])
        rows = {int(i): RunRow.from_data(row) for i, row in content["rows"].items()}
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{path}: not a readable record of a sweep: {error!r}; allowed: another folder"
        ) from None
    if difference is not None and rows:
        raise InputError(
            f"--out {folder}: it holds another sweep ({difference}); allowed: the same command, "
            "or another folder"
        )
    return {} if difference is not None else rows


def _words(value: Any) -> str:
    """A value as it stood on the command line."""
    if isinstance(value, list):
        return " ".join(str(entry) for entry in value) or "none"
    return "none" if value is None else str(value)
