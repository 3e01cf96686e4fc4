"""Measurements of a simulated robot compared to its parameters."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from identification.excitation.fourier import FourierTrajectory
from identification.measurement.experiment import run_experiment
from identification.measurement.files import read_record, write_record
from identification.measurement.imperfections import Imperfections, shipped_imperfections
from identification.measurement.periods import average, friction_trend
from identification.measurement.servo import Servo
from identification.measurement.synchronization import check_torque_lag, torque_lag
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import FrictionDrift
from pfsc_drake.robot.models.files import resolve_model

ROBOTS = ["comau_racer_1_4", "festo_expt_45", "franka_emika_panda"]
PERIOD, PERIODS = 2.0, 3


def perfect(subject):
    return Imperfections(np.zeros(subject.dimension), np.zeros(subject.dimension))


def excitation(subject, share=0.5, seed=0):
    """Return a motion about the middle that takes a share of one of the limits."""
    lower, upper = subject.position_limits.T
    n, harmonics = subject.dimension, (1, 2)
    a, b = np.random.default_rng(seed).normal(size=(2, n, 2)) * (upper - lower)[:, None]
    middle = 0.5 * (lower + upper)
    trial = FourierTrajectory(middle, a, b, PERIOD, harmonics)
    q, v, acceleration = trial.motion(np.linspace(0.0, PERIOD, 1000))
    limit = np.where(np.isfinite(subject.acceleration_limit), subject.acceleration_limit, 20.0)
    parts = [(q - middle) / (upper - middle), v / subject.velocity_limit, acceleration / limit]
    scale = share / np.max([np.abs(part).max(axis=0) for part in parts], axis=0)[:, None]
    return FourierTrajectory(middle, scale * a, scale * b, PERIOD, harmonics)


@pytest.fixture(scope="module", params=ROBOTS)
def clean(request):
    """A robot without dry friction, and its run without imperfections."""
    subject = load_subject(request.param, tool=True)
    smooth = replace(subject, coulomb=np.zeros(subject.dimension))
    return smooth, run_experiment(smooth, excitation(smooth), perfect(smooth), periods=PERIODS)


@pytest.mark.slow
def test_torques_are_those_of_the_parameters(clean):
    """To what the steps of the feedback at 1 kHz leave."""
    subject, run = clean
    motion = average(run.record)
    expected = Regressor(subject).matrix(motion.q, motion.v, motion.a) @ true_parameters(subject)
    error = np.abs(motion.tau - expected).max(axis=0)
    np.testing.assert_array_less(error, 5e-6 * np.abs(expected).max())
    np.testing.assert_allclose(motion.v, run.v[-2000:], atol=1e-4)


@pytest.mark.slow
def test_the_excitation_is_followed(clean):
    subject, run = clean
    lower, upper = subject.position_limits.T
    assert np.abs((run.q - run.reference) / (upper - lower)).max() < 1e-4
    np.testing.assert_array_equal(run.record.q, run.q)
    assert run.record.period == PERIOD
    np.testing.assert_allclose(run.record.t, np.arange(PERIODS * 2000) * 1e-3, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["comau_racer_1_4", "franka_emika_panda"])
def test_torques_of_drakes_inverse_dynamics(robot):
    """Without the coupling of rotors, which Drake's model does not have."""
    subject = load_subject(robot, tool=True)
    subject = replace(subject, mounts=None, coulomb=np.zeros(subject.dimension))
    motion = average(
        run_experiment(subject, excitation(subject), perfect(subject), periods=PERIODS).record
    )
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(robot)))
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    expected = []
    for q, v, a in zip(motion.q[::50], motion.v[::50], motion.a[::50], strict=True):
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        plant.CalcForceElementsContribution(context, forces)
        expected.append(plant.CalcInverseDynamics(context, a, forces) + subject.viscous * v)
    error = np.abs(motion.tau[::50] - expected).max()
    assert error < 5e-6 * np.abs(expected).max()


@pytest.fixture(scope="module")
def delta():
    return load_subject("festo_expt_45")


@pytest.mark.slow
def test_dry_friction(delta):
    """At reversals alone, within some samples, the torque is anywhere between both signs."""
    motion = average(
        run_experiment(delta, excitation(delta), perfect(delta), periods=PERIODS).record
    )
    expected = Regressor(delta).matrix(motion.q, motion.v, motion.a) @ true_parameters(delta)
    moving = np.abs(motion.v) > 0.05 * np.abs(motion.v).max()
    error = np.abs(motion.tau - expected)[moving]
    assert np.median(error) < 2e-3 * delta.coulomb.max()
    assert np.max(error) < 0.2 * delta.coulomb.max()
    lag = torque_lag(motion, Regressor(delta).matrix(motion.q, motion.v, motion.a))
    assert abs(lag.time) < 5e-4


@pytest.mark.slow
def test_a_servo_that_knows_nothing(delta):
    """Its joints stick before they reverse: torques are late there, the record is not."""
    plain = Servo(feedforward=0.0, friction=0.0)
    record = run_experiment(delta, excitation(delta), periods=PERIODS, servo=plain).record
    regressor = Regressor(delta)
    found = []
    for shift in (0, 6):
        motion = average(replace(record, tau=np.roll(record.tau, shift, axis=0)))
        Y = regressor.matrix(motion.q, motion.v, motion.a)
        found.append(torque_lag(motion, Y))
        if shift:
            with pytest.raises(InputError, match=r"tau lags the motion by [56]"):
                check_torque_lag(motion, Y)
        else:
            check_torque_lag(motion, Y)
    assert found[1].time - found[0].time == pytest.approx(6e-3, abs=1e-4)


@pytest.mark.slow
def test_noise_and_encoders(delta):
    faults = shipped_imperfections("festo_expt_45")
    run = run_experiment(delta, excitation(delta), faults, periods=5, seed=1)
    # the steps of the encoders, through the servo, come on top
    noise = np.std(run.record.tau - run.tau, axis=0)
    np.testing.assert_allclose(noise, faults.torque_noise, rtol=4.0 / np.sqrt(2.0 * 10_000))
    counts = run.record.q * faults.encoder_increments
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.abs(run.record.q - run.q).max() <= 0.5001 / faults.encoder_increments[0]
    variance = average(run.record).torque_variance
    assert np.all(variance >= 0.9 * faults.torque_noise**2)
    assert np.all(variance <= 1.5 * faults.torque_noise**2)


@pytest.mark.slow
def test_five_percent_of_drift_are_detected(delta):
    faults = shipped_imperfections("festo_expt_45")
    warm = replace(faults, drift=FrictionDrift(factor=1.05, begin=0.0, end=5 * PERIOD))
    detected = []
    for imperfections in (faults, warm):
        record = run_experiment(delta, excitation(delta), imperfections, periods=5).record
        detected.append(friction_trend(average(record)))
    assert not detected[0].changes.any()
    # of the drives together; from the first to the last of four periods
    total = np.sqrt(np.sum(detected[1].significance ** 2))
    assert total > 5.0
    np.testing.assert_array_less(
        np.abs(detected[1].coulomb - 0.03 * delta.coulomb), 4.0 * detected[1].coulomb_deviation
    )


@pytest.mark.slow
def test_runs_differ_by_their_seed_alone(delta):
    faults = shipped_imperfections("festo_expt_45").realistic()
    seeds = [3, 3, 4]
    runs = [run_experiment(delta, excitation(delta), faults, periods=2, seed=k) for k in seeds]
    np.testing.assert_array_equal(runs[0].record.tau, runs[1].record.tau)
    assert np.all(runs[0].coulomb != runs[2].coulomb)
    assert np.all(np.std(runs[0].record.tau - runs[2].record.tau, axis=0) > 1.0)


@pytest.mark.slow
def test_a_record_through_a_file(delta, tmp_path):
    reports = []
    record = run_experiment(
        delta,
        excitation(delta),
        periods=2,
        progress=lambda fraction, what: reports.append((fraction, what)),
    ).record
    assert reports[-1] == (1.0, "simulating the experiment")
    assert np.all(np.diff([fraction for fraction, _ in reports]) > 0.0)
    write_record(tmp_path / "run.csv", record, delta)
    again = read_record(tmp_path / "run.csv", delta)
    np.testing.assert_allclose(again.tau, record.tau, rtol=1e-10, atol=1e-10)


def refused(message, subject, trajectory, imperfections=None, **options):
    with pytest.raises(InputError, match=message):
        run_experiment(subject, trajectory, imperfections, **options)


def test_bad_input(delta):
    motion = excitation(delta)
    refused("friction is not known", replace(delta, viscous=None), motion)
    refused("noise of 'mine': not known", replace(delta, name="mine"), motion)
    far = replace(motion, q_0=motion.q_0 + 1.0)
    refused(r"goes from .* must stay within", delta, far)
    two = FourierTrajectory(motion.q_0[:2], motion.a[:2], motion.b[:2], PERIOD, (1, 2))
    refused("of 2 joints; festo_expt_45 has 3 joints", delta, two)
    refused("torque_noise: 2 values", delta, motion, Imperfections(np.zeros(2), np.zeros(3)))
    odd = replace(motion, period=2.0003)
    refused("period", delta, odd)
    weak = replace(delta, effort_limit=np.full(3, 4.0))
    refused("needs .* N at slide_.; must stay within the drive's 4 N", weak, motion)
