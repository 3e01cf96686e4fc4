"""The Comau on the excitation of Tab. C.2, at 100 samples per second, with made-up noise."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.excitation.fourier import FourierTrajectory, shipped_excitation
from identification.measurement.periods import average
from identification.measurement.record import Record
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from tests.identification.model.closed_form_base import load_printed_identification

RATE = 100.0


@pytest.fixture(scope="session")
def comau():
    """Robot, regressor, base parameters, true parameters, noise of Tab. C.4 and Tab. C.2."""
    subject = load_subject("comau_racer_1_4")
    regressor = Regressor(subject)
    trajectory = FourierTrajectory.load(shipped_excitation())
    truth = true_parameters(subject)
    base = base_parameters(regressor)
    return SimpleNamespace(
        subject=subject,
        regressor=regressor,
        base=base,
        parameters=truth,
        truth=base.values(truth),
        noise=load_printed_identification().torque.noise_level,
        trajectory=trajectory,
        motion=trajectory.motion(trajectory.sample_times(RATE)),
    )


@pytest.fixture(scope="session")
def other_trajectory(comau):
    """A motion like the one of Tab. C.2, within the same limits, with joints exchanged in time."""
    excitation = comau.trajectory
    return FourierTrajectory(
        excitation.q_0, -excitation.b, excitation.a, excitation.period, excitation.harmonics
    )


def measured(motion, tau, noise, period=10.0, periods=4, seed=0, colour=0.0):
    """Return the average over periods of torques with noise, exact positions."""
    q, random = motion[0], np.random.default_rng(seed)
    e = lfilter([1.0], [1.0, -colour], random.normal(size=(periods * len(q), q.shape[1])), axis=0)
    record = Record(
        np.arange(len(e)) * period / len(q),
        np.tile(q, (periods, 1)),
        np.tile(tau, (periods, 1)) + np.sqrt(1.0 - colour**2) * noise * e,
        tuple(f"joint_{j + 1}" for j in range(q.shape[1])),
        period,
    )
    return average(record, skip=0)


@pytest.fixture(scope="session")
def measure(comau):
    """Return a function that returns a measurement of the Comau on a motion."""

    def of_motion(seed=0, motion=None, extra=0.0, noise=1.0, **options):
        motion = comau.motion if motion is None else motion
        tau = comau.regressor.matrix(*motion) @ comau.parameters + extra
        return measured(motion, tau, noise * comau.noise, seed=seed, **options)

    return of_motion


@pytest.fixture(scope="session")
def measure_torques():
    """Return a function that returns a measurement of torques."""
    return measured
