"""Dependence of a metric on a parameter: monotonic, or with an extremum in between."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata, spearmanr, t

# values of the parameter on each side of an extremum, and share of the runs
_STEPS, _LEAST_SIDE = 2, 0.1
_MOST_BENDS = 60
# probability of each branch by chance; extrema are searched at many values
_CHANCE = 1e-3
_EXACT = 1e-12  # of the sum of squares


@dataclass(frozen=True)
class Influence:
    """Dependence of a metric on a parameter.

    Attributes:
        rank: Spearman's rank correlation; 0 where there is none.
        bend: Value of the parameter at an extremum of the metric; None without one.
        is_least: Whether it is a minimum.
        bend_rank: Correlation of the ranks with the two branches that meet there, 0 to 1.
    """

    rank: float = 0.0
    bend: float | None = None
    is_least: bool = True
    bend_rank: float = 0.0

    @property
    def strength(self) -> float:
        """Share of the metric explained by the parameter, 0 to 1."""
        return max(abs(self.rank), self.bend_rank)

    def __str__(self) -> str:
        if self.bend is not None:
            return f"{'least' if self.is_least else 'largest'} near {self.bend:.3g}"
        return f"rank correlation {self.rank:+.2f}" if self.rank else ""


def find_influence(parameter: list[Any], values: NDArray[Any]) -> Influence:
    """Return the dependence of a metric on a numeric parameter, none for others.

    Two branches that meet at one of the parameter's values are fitted to the ranks of the metric
    over those of the parameter, so that neither scale matters. They count if both slopes are
    significant, or the metric's mean is unimodal without exception; and if they explain more than
    one line.

    Args:
        parameter: Values of the parameter, one a run.
        values: Values of the metric; not finite where a run has none.
    """
    there = np.isfinite(values)
    if not all(isinstance(value, (int, float)) for value in parameter) or there.sum() < 3:
        return Influence()
    numbers, values = np.array(parameter, dtype=float)[there], values[there]
    if np.ptp(numbers) == 0.0 or np.ptp(values) == 0.0:
        return Influence()
    rank = float(spearmanr(numbers, values).statistic)
    x, y = rankdata(numbers), rankdata(values)
    grid = np.unique(numbers)
    side = np.array([min(np.sum(numbers < bend), np.sum(numbers > bend)) for bend in grid])
    side[:_STEPS], side[len(side) - _STEPS :] = 0, 0
    inside = grid[side >= max(1.0, _LEAST_SIDE * len(numbers))]
    if not inside.size:
        return Influence(rank)
    chosen = inside[:: -(-len(inside) // _MOST_BENDS)]
    fits = [_branches(x - x[numbers == bend].mean(), y) for bend in chosen]
    best = int(np.argmin([rest for rest, _, _ in fits]))
    bend, (rest, is_steep, is_least) = float(chosen[best]), fits[best]
    means = np.array([y[numbers == value].mean() for value in grid])
    bend_rank = float(np.sqrt(max(1.0 - rest, 0.0)))
    is_bend = is_steep or _turns_at(means, int(np.searchsorted(grid, bend)))
    if not is_bend or bend_rank <= abs(rank):
        return Influence(rank)
    return Influence(rank, bend, is_least, bend_rank)


def _turns_at(means: NDArray[Any], k: int) -> bool:
    """Return whether values are monotonic up to the k-th, and reversed from there on."""
    steps = np.sign(np.diff(means))
    return bool(steps[0] != 0 and np.all(steps[:k] == steps[0]) and np.all(steps[k:] == -steps[0]))


def _branches(x: NDArray[Any], y: NDArray[Any]) -> tuple[float, bool, bool]:
    """Fit two lines that meet at x = 0.

    Returns:
        Residual sum of squares relative to the total one; whether both rise, or both fall,
        significantly away from the common point; and whether the left one rises.
    """
    A = np.column_stack([np.ones_like(x), np.maximum(-x, 0.0), np.maximum(x, 0.0)])
    found = np.linalg.lstsq(A, y, rcond=None)[0]
    whole, rest = float(np.sum((y - y.mean()) ** 2)), float(np.sum((y - A @ found) ** 2))
    variance = max(rest, _EXACT * whole) / max(len(y) - 3, 1)
    slopes = found[1:] / np.sqrt(variance * np.diag(np.linalg.inv(A.T @ A))[1:])
    least = float(t.isf(_CHANCE, max(len(y) - 3, 1)))
    is_steep = bool(np.all(slopes > least) or np.all(slopes < -least))
    return rest / whole, is_steep, bool(slopes[0] > 0.0)
