"""Robots, their bounds, and the consistent set nearest to Tab. C.3."""

import numpy as np
import pytest

from identification.consistency.bounds import load_bounds
from identification.consistency.nearest import Prediction, nearest_consistent
from identification.consistency.semidefinite_program import PRIOR_WEIGHT
from identification.excitation.fourier import FourierTrajectory
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.robot.models.files import models_directory
from tests.identification.model.closed_form_base import analytic_base, load_printed_identification

# for how many measurements the motion of Tab. C.2 counts: its torques then are nearer to those of
# Tab. C.3 by a quarter to a half, for 1 % more of chi squared
TORQUE_WEIGHT = 100.0


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
def set_of_table(comau_base, comau_regressor):
    """With the shipped bounds; torques on the motion of Tab. C.2 count in the noise of Tab. C.4."""
    printed = load_printed_identification()
    table, folder = printed.base_parameters, models_directory() / printed.name
    trajectory = FourierTrajectory.load(folder / "excitation.yaml")
    Y = comau_base.reduce(
        comau_regressor.matrix(*trajectory.motion(trajectory.sample_times(100.0)))
    )
    return nearest_consistent(
        comau_base,
        table.mean,
        np.diag(table.standard_deviation**2),
        load_bounds(printed.name),
        prior_weight=PRIOR_WEIGHT,
        prediction=Prediction(Y, printed.torque.noise_level, TORQUE_WEIGHT),
    )


@pytest.fixture(scope="session")
def panda():
    return load_subject("franka_emika_panda")


@pytest.fixture(scope="session")
def delta():
    return load_subject("festo_expt_45")
