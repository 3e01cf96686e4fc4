"""Definition of a sweep: variations, samples, and the file with definition and rows."""

import dataclasses
import itertools
import json
import re
import shlex
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.sweep.values import Random, column_value, parse_values, split_values
from experiments.sweep.worker import RunRow
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.yaml.reading import read_text
from reporting.folder import ResultsFolder

RECORD = "sweep.json"

_PROGRAM = ("python", "-m", "experiments")
# largest age of unsaved rows [s], or multiple of the time for writing
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
    """Definition of the runs of a sweep.

    Attributes:
        scenario: As given on the command line.
        vary: Each ``--vary``.
        overrides: Each ``--set``.
        duration: Simulated time [s]; None for the scenario's.
        samples: Number of random draws; None without any.
        seed: Seed of the draws.
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
        """Return the definition as data for JSON."""
        return json.loads(json.dumps(dataclasses.asdict(self)))

    def command(self) -> str:
        """Return the command line of the sweep."""
        words = [*_PROGRAM, "sweep", self.scenario]
        for option in self.vary:
            words += ["--vary", option]
        if self.samples is not None:
            words += ["--samples", str(self.samples)]
        words += ["--seed", str(self.seed), *self._common(())]
        return shlex.join(words)

    def run_command(self, overrides: tuple[str, ...]) -> str:
        """Return the command line that repeats one run.

        Args:
            overrides: Overrides of its sample.
        """
        return shlex.join([*_PROGRAM, "run", self.scenario, *self._common(overrides)])

    def difference(self, other: dict[str, Any]) -> str | None:
        """Return the first difference of another sweep, e.g. ``--seed 1``; None if it is the same.

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
    """Definition and rows of a sweep, saved in a folder as runs end.

    Attributes:
        rows: Rows by number of the sample.
    """

    def __init__(self, results: ResultsFolder, definition: SweepDefinition) -> None:
        """Read the rows of the same sweep in the folder.

        Raises:
            InputError: If the folder holds rows of another sweep, or its record cannot be read.
        """
        self._results, self._definition = results, definition
        self._written, self._pause = time.monotonic(), _OLDEST
        path = results.path / RECORD
        self.rows = _read(path, results.path, definition) if path.exists() else {}
        self.save()

    def missing(self, count: int) -> list[int]:
        """Return the numbers of the samples that have no final row yet, of ``count``."""
        return [i for i in range(count) if i not in self.rows or not self.rows[i].is_final]

    def take(self, number: int, row: RunRow) -> None:
        """Add a row, and write all rows after some time."""
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
    """Return the rows of an earlier session."""
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
    """Return a value as on the command line."""
    if isinstance(value, list):
        return " ".join(str(entry) for entry in value) or "none"
    return "none" if value is None else str(value)


MAX_RUNS = 100_000

_INDEX = re.compile(r"\[(\d+)\]")


@dataclass(frozen=True)
class Variation:
    """One ``--vary``.

    Attributes:
        name: The keys as given, which names the columns of the table.
        keys: Dotted paths in the scenario, all of which get the same value.
        values: Their values.
    """

    name: str
    keys: tuple[str, ...]
    values: tuple[str, ...] | Random


@dataclass(frozen=True)
class Sample:
    """One run of a sweep.

    Attributes:
        index: Its index in the sweep, from 0.
        overrides: ``key.path=value`` each, as ``--set`` takes them.
        varied: Varied values by column of the table; numbers or texts.
    """

    index: int
    overrides: tuple[str, ...]
    varied: dict[str, Any]


def parse_variation(option: str) -> Variation:
    """Read one ``--vary KEY=VALUES``.

    Args:
        option: ``KEY`` is a dotted path, with ``.2`` or ``[2]`` for the third element of a list;
            several with ``+`` between them get the same values. ``VALUES``: see
            :mod:`experiments.sweep.values`.

    Raises:
        InputError: If it is malformed.
    """
    source = f"--vary {shorten(option, 100)}"
    name, separator, text = option.partition("=")
    name = name.strip()
    keys = tuple(_INDEX.sub(r".\1", key.strip()) for key in name.split("+"))
    if not separator or not all(part.strip() for key in keys for part in key.split(".")):
        raise InputError(f"{source}: malformed; allowed: key.path=values")
    return Variation(name, keys, parse_values(text, source))


def parse_variations(options: Sequence[str]) -> list[Variation]:
    """Read all ``--vary`` of a sweep.

    Raises:
        InputError: If there is none, one is malformed, or a key is varied twice.
    """
    if not options:
        raise InputError("--vary: missing; allowed: one or more of --vary key.path=values")
    variations = [parse_variation(option) for option in options]
    known: set[str] = set()
    for key in (key for variation in variations for key in variation.keys):
        if key in known:
            raise InputError(f"--vary {shorten(key)}: varied twice; allowed: once")
        known.add(key)
    return variations


def draw_samples(variations: Sequence[Variation], count: int | None, seed: int) -> list[Sample]:
    """Return the samples: every combination of the grids, with every random draw.

    Each random key has its own generator, from the seed and the key's position: the first samples
    are independent of the number of samples, and all combinations of the grids share them.

    Args:
        variations: The variations.
        count: Number of random draws; None if nothing is random.
        seed: Seed of the draws, 0 or more.

    Raises:
        InputError: If ``count`` is missing or useless, or there are more than MAX_RUNS runs.
    """
    grids = [None if isinstance(v.values, Random) else v.values for v in variations]
    randoms = [variation for variation in variations if isinstance(variation.values, Random)]
    if randoms and count is None:
        raise InputError(f"--samples: missing; {shorten(randoms[0].name)} is random")
    if not randoms and count is not None:
        raise InputError(f"--samples {count}: nothing is random; allowed: no --samples")
    if seed < 0:
        raise InputError(f"--seed {seed}: allowed: 0 or more")
    draws = 1 if count is None else count
    if draws < 1:
        raise InputError(f"--samples {draws}: allowed: 1 or more")
    combinations = 1
    for grid in grids:
        combinations *= len(grid) if grid else 1
    if draws * combinations > MAX_RUNS:
        raise InputError(f"{draws * combinations} runs; allowed: up to {MAX_RUNS}")
    generators = [
        np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(k,))))
        for k in range(len(variations))
    ]
    samples: list[Sample] = []
    for _ in range(draws):
        drawn = [
            grid or (_drawn(variation, generator),)
            for grid, variation, generator in zip(grids, variations, generators, strict=True)
        ]
        for texts in itertools.product(*drawn):
            samples.append(_sample(len(samples), variations, texts))
    return samples


def _drawn(variation: Variation, generator: np.random.Generator) -> str:
    assert isinstance(variation.values, Random)
    return variation.values.sample(generator)


def _sample(index: int, variations: Sequence[Variation], texts: Sequence[str]) -> Sample:
    overrides: list[str] = []
    varied: dict[str, Any] = {}
    for variation, text in zip(variations, texts, strict=True):
        overrides += [f"{key}={text}" for key in variation.keys]
        varied |= _columns(variation, text)
    return Sample(index, tuple(overrides), varied)


def _columns(variation: Variation, text: str) -> dict[str, Any]:
    """Return the columns of one variation, one per element of a list of independent draws."""
    values = variation.values
    if not (isinstance(values, Random) and values.length is not None):
        return {variation.name: column_value(text)}
    elements = split_values(text[1:-1], variation.name)
    return {f"{variation.name}[{i}]": column_value(piece) for i, piece in enumerate(elements)}
