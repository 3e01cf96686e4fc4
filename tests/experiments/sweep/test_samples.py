"""Samples: combinations, draws, and that they depend on the seed alone."""

import pytest

from experiments.sweep.definition import draw_samples, parse_variations
from pfsc_drake import InputError


def samples(*options, count=None, seed=0):
    return draw_samples(parse_variations(options), count, seed)


def test_all_combinations_of_grids():
    drawn = samples("a=1,2", "b.c=x,y,z")
    assert [sample.overrides for sample in drawn] == [
        (f"a={a}", f"b.c={c}") for a in (1, 2) for c in "xyz"
    ]
    assert [sample.index for sample in drawn] == list(range(6))
    assert drawn[4].varied == {"a": 2, "b.c": "y"}


def test_combinations_share_the_draws():
    drawn = samples("law=elastic,rigid", "mass=0:1", count=3)
    assert len(drawn) == 6
    for one, other in zip(drawn[::2], drawn[1::2], strict=True):
        assert (one.varied["law"], other.varied["law"]) == ("elastic", "rigid")
        assert one.varied["mass"] == other.varied["mass"]
    assert len({sample.varied["mass"] for sample in drawn}) == 3


def test_the_same_seed_gives_the_same_samples_and_more_of_them_begin_alike():
    options = ("a=normal(0, 1)", "b=0:1")
    few, many = samples(*options, count=5, seed=7), samples(*options, count=50, seed=7)
    assert many[:5] == few
    other = samples(*options, count=5, seed=8)
    assert not {s.varied["a"] for s in few} & {s.varied["a"] for s in other}
    # two keys with the same distribution are independent
    twins = samples("a=0:1", "b=0:1", count=3)
    assert all(sample.varied["a"] != sample.varied["b"] for sample in twins)


def test_indices_and_several_keys():
    (first, _) = samples("gains[2]+other.gains[0][1]=3,4")
    assert first.overrides == ("gains.2=3", "other.gains.0.1=3")
    assert first.varied == {"gains[2]+other.gains[0][1]": 3}


def test_a_drawn_list_has_a_column_per_element():
    (sample,) = samples("mass=normal(1, 0.1)*3", count=1)
    assert list(sample.varied) == ["mass[0]", "mass[1]", "mass[2]"]
    texts = ", ".join(repr(value) for value in sample.varied.values())
    assert sample.overrides == (f"mass=[{texts}]",)


@pytest.mark.parametrize(
    ("options", "count", "seed", "reason"),
    [
        ([], None, 0, "--vary: missing"),
        (["a"], None, 0, "--vary a: malformed; allowed: key.path=values"),
        (["a..b=1,2"], None, 0, "malformed"),
        (["=1,2"], None, 0, "malformed"),
        (["a+=1,2"], None, 0, "malformed"),
        (["a=1,2", "a=3,4"], None, 0, "--vary a: varied twice"),
        (["a[1]=1,2", "b+a.1=3,4"], None, 0, "--vary a.1: varied twice"),
        (["a=0:1"], None, 0, "--samples: missing; a is random"),
        (["a=1,2"], 3, 0, "--samples 3: nothing is random"),
        (["a=0:1"], 0, 0, "--samples 0: allowed: 1 or more"),
        (["a=0:1"], 1, -1, "--seed -1: allowed: 0 or more"),
        (["a=0:1"], 10**12, 0, "1000000000000 runs; allowed: up to"),
        (["a=range(1000)", "b=range(1000)"], None, 0, "1000000 runs"),
    ],
)
def test_what_is_wrong_is_named(options, count, seed, reason):
    with pytest.raises(InputError) as caught:
        samples(*options, count=count, seed=seed)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
