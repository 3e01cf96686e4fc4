"""How a metric depends on a parameter, from made-up tables."""

import numpy as np
import pytest

from experiments.sweep.influence import Influence, find_influence

GRID = [0.8, 0.9, 1.0, 1.1, 1.2]


@pytest.mark.parametrize(
    ("metric", "told"),
    [
        (lambda x: np.abs(x - 1.0), "least near 1"),
        (lambda x: (x - 1.0) ** 2 + 1e-3, "least near 1"),
        (lambda x: 3.0 - np.abs(x - 1.0), "largest near 1"),
        (lambda x: x**3, "rank correlation +1.00"),
        (lambda x: np.exp(-x), "rank correlation -1.00"),
        # grows nearly everywhere
        (lambda x: np.abs(x - 0.86), "rank correlation +0.90"),
        (np.ones_like, ""),
    ],
)
def test_a_few_values_of_one_parameter(metric, told):
    assert str(find_influence(GRID, metric(np.array(GRID)))) == told


@pytest.mark.parametrize("log_scale", [False, True])
def test_a_bend_is_found_in_what_scatters(log_scale):
    random = np.random.default_rng(3)
    u = random.uniform(-1.0, 1.0, 120)
    parameter = 10.0**u if log_scale else u
    values = np.abs(u - 0.2) * np.exp(0.1 * random.normal(size=120)) + 0.03 * random.normal(
        size=120
    )
    found = find_influence(list(parameter), values)
    assert abs(found.rank) < 0.5 < found.bend_rank
    assert found.is_least
    where = np.log10(found.bend) if log_scale else found.bend
    assert where == pytest.approx(0.2, abs=0.15)
    assert found.strength == found.bend_rank > 0.8


def test_what_only_rises_has_no_bend():
    random = np.random.default_rng(4)
    for _ in range(40):
        x = random.uniform(size=60)
        found = find_influence(list(x), np.exp(3.0 * x) + 0.3 * random.normal(size=60))
        assert found.bend is None
        assert found.strength == found.rank > 0.9


@pytest.mark.slow
def test_chance_makes_no_bend():
    random = np.random.default_rng(5)
    found = [
        find_influence(list(random.uniform(size=20)), random.normal(size=20)) for _ in range(100)
    ]
    assert sum(influence.bend is not None for influence in found) <= 2


def test_runs_without_value_and_parameters_without_numbers_do_not_count():
    values = np.array([0.2, 0.1, np.nan, 0.0, 0.1, 0.2])
    assert find_influence([0.8, 0.9, 5.0, 1.0, 1.1, 1.2], values).bend == 1.0
    assert find_influence(["a", "b", "c"], np.arange(3.0)) == Influence()
    assert find_influence([1, 2, 3], np.array([1.0, np.nan, 2.0])) == Influence()
    assert find_influence([2.0] * 4, np.arange(4.0)) == Influence()


def test_a_bend_may_be_at_zero():
    found = find_influence([-2, -1, 0, 1, 2], np.abs(np.arange(-2.0, 3.0)))
    assert found.bend == 0.0
    assert str(found) == "least near 0"
