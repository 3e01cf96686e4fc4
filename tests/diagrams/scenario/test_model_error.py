"""Model errors of a scenario."""

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import ModelErrorParameters, RandomModelError, Scenario
from experiments.scenario_file import read_scenario
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed

TURNING = np.array([True, True, False])


def _load(**data):
    return load_typed(ModelErrorParameters, data, "here.yaml")


def test_nothing_is_wrong_by_default():
    assert not ModelErrorParameters().is_given
    assert not _load(random={"seed": 7}).is_given
    error = ModelErrorParameters().error(TURNING)
    assert not error.moves_tool
    for name in ("mass", "inertia", "rotor_inertia", "stiffness", "link_length"):
        np.testing.assert_array_equal(getattr(error, name), np.ones(3))
    np.testing.assert_array_equal(error.friction, np.ones((2, 3)))


def test_one_number_is_for_all_links():
    error = _load(mass=0.95, stiffness=[1.0, 1.1, 1.2], joint_offset_deg=[0.0, 1.0, 0.002])
    assert error.is_given
    drawn = error.error(TURNING)
    np.testing.assert_array_equal(drawn.mass, np.full(3, 0.95))
    np.testing.assert_array_equal(drawn.stiffness, [1.0, 1.1, 1.2])
    # what slides is off by metres
    np.testing.assert_allclose(drawn.joint_offset, [0.0, np.pi / 180.0, 0.002])
    assert drawn.moves_tool


def test_random_errors_have_their_deviation():
    many = np.full(4000, True)
    error = _load(mass=0.9, random={"mass": 0.05, "friction": 0.1, "center": 0.01}).error(many)
    assert error.mass.mean() == pytest.approx(0.9, abs=0.003)
    assert error.mass.std() == pytest.approx(0.045, rel=0.05)
    assert error.friction.std(axis=1) == pytest.approx([0.1, 0.1], rel=0.05)
    assert abs(np.corrcoef(error.friction)[0, 1]) < 0.05
    assert error.center.std() == pytest.approx(0.01, rel=0.05)
    np.testing.assert_array_equal(error.stiffness, np.ones(4000))


def test_a_seed_draws_the_same_whatever_else_is_drawn():
    alone = _load(random={"seed": 3, "mass": 0.05}).error(TURNING)
    beside = _load(random={"seed": 3, "mass": 0.05, "stiffness": 0.1}).error(TURNING)
    other = _load(random={"seed": 4, "mass": 0.05}).error(TURNING)
    np.testing.assert_array_equal(alone.mass, beside.mass)
    assert np.all(alone.mass != other.mass)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"mass": 0.0}, "mass = .*; allowed: factors from 0\\.001 to 1000"),
        ({"friction": [-1.0]}, "friction = .*; allowed: factors"),
        ({"stiffness": []}, "stiffness = .*; allowed: factors"),
        ({"joint_offset_deg": 200}, "joint_offset_deg = .*; allowed: numbers of at most 90 deg"),
        ({"tool_mass": float("inf")}, "tool_mass = inf; allowed: -1000 to 1000 kg"),
        ({"tool_center": [1.0]}, "tool_center = .*; allowed: 3 finite numbers"),
        (
            {"tool_center": [0, 0, 99]},
            "tool_center = .*; allowed: 3 finite .* at most 10 m",
        ),
        ({"random": {"mass": -0.1}}, "mass = -0.1; allowed: 0 to 1 as a fraction"),
        ({"random": {"seed": -1}}, "seed = -1; allowed: zero or a positive integer"),
        ({"weight": 1.0}, "weight"),
    ],
)
def test_wrong_values_are_refused(data, message):
    with pytest.raises(InputError, match=message):
        _load(**data)


def test_as_many_as_links():
    message = r"^model_error\.mass: 2 values; allowed: one, or one for each of the robot's 3 links"
    with pytest.raises(InputError, match=message):
        _load(mass=[1.0, 1.0]).error(TURNING)


def test_draws_that_leave_nothing():
    message = r"^model_error\.random\.mass = 1: with seed 0 it draws a factor of -"
    with pytest.raises(InputError, match=message):
        _load(random=RandomModelError(mass=1.0).__dict__).error(np.full(50, True))


@pytest.mark.parametrize(
    ("data", "parts"),
    [
        ({"mass": 0.05}, ["mass = 0.05 is a factor", "0.95 is 5 % too low"]),
        ({"stiffness": [1.0, 1.0, 10.0]}, ["stiffness = 10 is a factor"]),
        ({"link_length": 0.001}, ["link_length = 0.001 is a factor"]),
    ],
)
def test_factors_that_may_be_meant_as_errors(data, parts):
    (warning,) = _load(**data).warnings
    assert all(part in warning for part in parts)


def test_factors_that_a_person_would_set_are_taken_without_a_word():
    assert _load(mass=0.95, friction=[0.5, 2.0, 1.0], joint_offset_deg=20.0).warnings == []


@pytest.mark.slow
def test_a_run_says_that_an_error_is_a_factor():
    scenario = read_scenario("pfc_elastic_3r", ["model_error.mass=0.05"])
    settings = load_typed(Scenario, scenario.data, "x")
    station = build_station(settings, scenario.path.parent)
    assert any("model_error.mass = 0.05 is a factor" in said for said in station.warnings)
