"""Base parameters found with numbers."""

import numpy as np
import pytest

from identification.model.base import base_parameters, combination, random_motion
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor


@pytest.mark.parametrize("coupling", [False, True])
def test_ranks_of_the_comau(comau, coupling):
    """(B.2): 36 inertial ones, four rotors, twelve of friction."""
    without = base_parameters(Regressor(comau, friction=False, coupling=coupling))
    inertial = [name for name in without.short_names if name.startswith("link")]
    assert (len(inertial), without.rank) == (36, 40)
    assert base_parameters(Regressor(comau, coupling=coupling)).rank == 52


@pytest.mark.parametrize(("robot", "rank"), [("franka_emika_panda", 62), ("festo_expt_45", 10)])
def test_ranks_of_other_robots(subject_of, robot, rank):
    """Seven axes: 7 N - 6 = 43 (B.2), five rotors, friction; DELTA robot: Sec. 2.4.6."""
    assert base_parameters(Regressor(subject_of(robot))).rank == rank


@pytest.mark.parametrize("robot", ["comau_racer_1_4", "franka_emika_panda", "festo_expt_45"])
def test_torques_of_other_motions_depend_on_them_alone(subject_of, robot):
    subject = subject_of(robot)
    regressor = Regressor(subject)
    base = base_parameters(regressor)
    Y = regressor.matrix(*random_motion(regressor, seed=5))
    rho = true_parameters(subject)
    np.testing.assert_allclose(base.reduce(Y) @ base.values(rho), Y @ rho, rtol=1e-9, atol=1e-7)
    assert np.linalg.matrix_rank(base.reduce(Y).reshape(-1, base.rank)) == base.rank


def test_the_set_does_not_depend_on_the_seed(comau):
    regressor = Regressor(comau)
    one, other = base_parameters(regressor), base_parameters(regressor, seed=7)
    np.testing.assert_array_equal(one.indices, other.indices)
    np.testing.assert_allclose(one.projection, other.projection, rtol=1e-8, atol=1e-8)


def test_combinations_in_words(comau):
    base = base_parameters(Regressor(comau))
    named = dict(zip(base.short_names, base.names, strict=True))
    assert named["link_4.my"] == "link_4.my + link_5.mz"
    assert named["link_2.Ixz"] == "link_2.Ixz - 0.59 link_3.mz"
    assert named["joint_6.I_M"] == "joint_6.I_M"
    assert len(base.names) == len(base.units) == 52
    units = dict(zip(base.short_names, base.units, strict=True))
    assert units["link_2.mx"] == "kg m"


def test_combination_begins_with_the_requested_parameter():
    row = np.array([0.0, -0.5, 1.0, 2.0])
    names = ["a", "b", "c", "d"]
    assert combination(row, names) == "-0.5 b + c + 2 d"
    assert combination(row, names, first=2) == "c - 0.5 b + 2 d"
    assert combination(-row, names, first=2) == "-c + 0.5 b - 2 d"
