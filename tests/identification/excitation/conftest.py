"""Robots, their regressors and small problems, each made once."""

import numpy as np
import pytest

from identification.excitation.excitation_program import excitation_problem, nominal_parameters
from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.excitation.limits import chosen_limits
from identification.excitation.scene import RobotScene, cell_of
from identification.excitation.verification import verify
from identification.model.base import base_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.robot.models.files import models_directory

THREE_AXES = models_directory() / "comau_racer_1_4" / "comau_racer_1_4_3r.sdf"


@pytest.fixture(scope="session")
def comau():
    return load_subject("comau_racer_1_4")


@pytest.fixture(scope="session")
def comau_cell(comau):
    return cell_of(comau, None)


@pytest.fixture(scope="session")
def comau_scene(comau, comau_cell):
    return RobotScene(comau, comau_cell)


@pytest.fixture(scope="session")
def regressor(comau):
    return Regressor(comau)


@pytest.fixture(scope="session")
def base(regressor):
    return base_parameters(regressor)


@pytest.fixture(scope="session")
def printed():
    """Tab. C.2."""
    return FourierTrajectory.load(shipped_excitation())


@pytest.fixture(scope="session")
def arm():
    """Three axes, 15 inertial base parameters, rotors and friction."""
    return load_subject(THREE_AXES)


@pytest.fixture(scope="session")
def delta():
    return load_subject("festo_expt_45")


@pytest.fixture(scope="session")
def arm_problem(arm):
    return excitation_problem(arm, chosen_limits(arm), period=5.0, harmonics=(1, 2))


@pytest.fixture(scope="session")
def verified():
    """Return the shares of its limits that a robot's motion uses."""

    def tell(subject, motion, limits=None, cell=None):
        around, joints = cell_of(subject, cell), chosen_limits(subject, limits)
        scene = None if subject.block is None else RobotScene(subject, around)
        nominal = nominal_parameters(subject)
        return verify(Regressor(subject), nominal, joints, motion, around, scene)

    return tell


@pytest.fixture
def random_motion():
    """Coefficients of three joints and two harmonics."""
    random = np.random.default_rng(3)
    return random.normal(size=(3, 5)) * 0.4
