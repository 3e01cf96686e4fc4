"""Robots, and what is known of them."""

import pytest

from identification.consistency.bounds import load_bounds
from identification.model.analytic_base import analytic_base
from identification.model.regressor import Regressor
from identification.model.subject import load_subject


@pytest.fixture(scope="session")
def comau():
    return load_subject("comau_racer_1_4")


@pytest.fixture(scope="session")
def comau_regressor(comau):
    return Regressor(comau)


@pytest.fixture(scope="session")
def comau_base(comau):
    return analytic_base(comau)


@pytest.fixture
def comau_bounds():
    return load_bounds("comau_racer_1_4")


@pytest.fixture(scope="session")
def panda():
    return load_subject("franka_emika_panda")


@pytest.fixture(scope="session")
def delta():
    return load_subject("festo_expt_45")
