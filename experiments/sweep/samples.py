"""What a sweep varies, and its samples: the same for the same seed, whoever runs them."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.sweep.values import Grid, Random, column_value, parse_values, split_values
from pfsc_drake.errors import InputError, shortened

MAX_RUNS = 100_000

_INDEX = re.compile(r"\[(\d+)\]")


@dataclass(frozen=True)
class Variation:
    """One ``--vary``.

    Attributes:
        name: The keys as given, which names the columns of the table.
        keys: Dotted paths in the scenario, all of which get the same value.
        values: What they get.
    """

    name: str
    keys: tuple[str, ...]
    values: Grid | Random


@dataclass(frozen=True)
class Sample:
    """One run of a sweep.

    Attributes:
        index: Its place in the sweep, from 0.
        overrides: ``key.path=value`` each, as ``--set`` takes them.
        varied: What the table shows of it, by column; numbers or texts.
    """

    index: int
    overrides: tuple[str, ...]
    varied: dict[str, Any]


def parse_variation(option: str) -> Variation:
    """Reads one ``--vary KEY=VALUES``.

    Args:
        option: ``KEY`` is a dotted path, with ``.2`` or ``[2]`` for the third element of a list;
            several with ``+`` between them get the same values. ``VALUES``: see
            :mod:`experiments.sweep.values`.

    Raises:
        InputError: If it is malformed.
    """
    source = f"--vary {shortened(option, 100)}"
    name, separator, text = option.partition("=")
    name = name.strip()
    keys = tuple(_INDEX.sub(r".\1", key.strip()) for key in name.split("+"))
    if not separator or not all(part.strip() for key in keys for part in key.split(".")):
        raise InputError(f"{source}: malformed; allowed: key.path=values")
    return Variation(name, keys, parse_values(text, source))


def parse_variations(options: Sequence[str]) -> list[Variation]:
    """Reads all ``--vary`` of a sweep.

    Raises:
        InputError: If there is none, one is malformed, or a key is varied twice.
    """
    if not options:
        raise InputError("--vary: missing; allowed: one or more of --vary key.path=values")
    variations = [parse_variation(option) for option in options]
    seen: set[str] = set()
    for key in (key for variation in variations for key in variation.keys):
        if key in seen:
            raise InputError(f"--vary {shortened(key)}: varied twice; allowed: once")
        seen.add(key)
    return variations


def draw_samples(variations: Sequence[Variation], count: int | None, seed: int) -> list[Sample]:
    """Returns the samples: every combination of the grids, with every random draw.

    Every random key has a generator of its own, made from the seed and the key's place: the first
    samples are the same however many there are, and all combinations of the grids share them.

    Args:
        variations: What varies.
        count: Number of random draws; None if nothing is random.
        seed: Of the draws, 0 or more.

    Raises:
        InputError: If ``count`` is missing, or there for nothing, or there are more than MAX_RUNS.
    """
    grids = [v.values.values if isinstance(v.values, Grid) else None for v in variations]
    randoms = [variation for variation in variations if isinstance(variation.values, Random)]
    if randoms and count is None:
        raise InputError(f"--samples: missing; {shortened(randoms[0].name)} is random")
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
        np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(place,))))
        for place in range(len(variations))
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
    """Columns of one variation; of a list one each, if its elements are drawn apart."""
    values = variation.values
    if not (isinstance(values, Random) and values.length is not None):
        return {variation.name: column_value(text)}
    elements = split_values(text[1:-1], variation.name)
    return {f"{variation.name}[{i}]": column_value(piece) for i, piece in enumerate(elements)}
