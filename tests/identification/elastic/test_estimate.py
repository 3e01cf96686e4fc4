"""Joints whose motion is known in closed form are found within the stated deviations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from identification.elastic.estimate import estimate_joint
from identification.elastic.signals import JointSignals
from pfsc_drake.errors import InputError

STIFFNESS, DAMPING, INERTIA, VISCOUS, LINK = 30e3, 6.0, 0.17, 20.0, 0.6
TORQUE_NOISE, POSITION_NOISE = 0.7, 1e-5
TRUE = {
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "inertia": INERTIA,
    "coulomb": 0.0,
    "lag": 0.0,
    "viscous": VISCOUS,
    "offset": 0.0,
}


def steady_motion(locked, seed=0, lines=60, size=25.0, duration=6.0):
    """Return signals without noise: a sum of sines through the transfer functions."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration * 1000)) * 1e-3
    hertz = np.arange(1, lines + 1) + 0.25
    s = 2j * np.pi * hertz
    joint = STIFFNESS + DAMPING * s
    motor = INERTIA * s**2 + VISCOUS * s + joint
    link = LINK * s**2 + 5.0 * s + joint
    to_motor = 1.0 / motor if locked else 1.0 / (motor - joint**2 / link)
    to_link = 0.0 * joint if locked else to_motor * joint / link
    torque = size * np.sqrt(2.0 / lines) * np.exp(2j * np.pi * rng.uniform(size=lines))
    waves = np.exp(np.outer(t, s)) * torque
    tau, q_M, q_J = (np.sum((waves * gain).real, axis=1) for gain in (1.0, to_motor, to_link))
    return JointSignals("shoulder", t, tau, q_M, q_J)


def noisy(signals, seed, torque=TORQUE_NOISE, position=POSITION_NOISE):
    e = np.random.default_rng(seed).normal(size=(3, signals.t.size))
    return replace(
        signals,
        tau=signals.tau + torque * e[0],
        q_motor=signals.q_motor + position * e[1],
        q=signals.q + position * e[2],
    )


def options(locked):
    return {"locked": True, "viscous": VISCOUS} if locked else {}


@pytest.mark.parametrize("locked", [True, False])
def test_without_noise_all_is_found(locked):
    found = estimate_joint(steady_motion(locked), **options(locked))
    for name in ("stiffness", "damping", "inertia"):
        assert found.value(name) == pytest.approx(TRUE[name], rel=1e-4)
    assert found.residual < 1e-3
    assert found.resonance == pytest.approx(np.sqrt(STIFFNESS / INERTIA) / (2 * np.pi), rel=1e-4)
    assert ("viscous" in found.parameters) is not locked


@pytest.mark.slow(but="True")
@pytest.mark.parametrize("locked", [True, False])
def test_deviations_are_those_stated(locked):
    """Over many runs the squared errors in units of the covariance follow chi-squared."""
    clean, runs, distances = steady_motion(locked), 40, []
    for seed in range(runs):
        found = estimate_joint(noisy(clean, seed), **options(locked))
        chosen = [i for i, name in enumerate(found.parameters) if name != "lag"]
        error = found.values - [TRUE[name] for name in found.parameters]
        covariance = found.covariance[np.ix_(chosen, chosen)]
        distances.append(error[chosen] @ np.linalg.solve(covariance, error[chosen]))
    freedom = runs * len(chosen)
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], freedom)
    # the covariance is itself estimated, from some sixty independent stretches
    assert 0.8 * low < np.sum(distances) < 1.25 * high


def test_noise_of_the_positions_does_not_soften_the_joint():
    """A fit that ignores it takes the torsion for larger, the stiffness for smaller."""
    clean = steady_motion(False, size=2.0)
    runs = [estimate_joint(noisy(clean, seed, 0.05, 1.5e-5)) for seed in range(20)]
    mean = np.mean([run.stiffness for run in runs])
    spread = np.mean([run.deviation("stiffness") for run in runs])
    assert abs(mean - STIFFNESS) < 4.0 * spread / np.sqrt(20)
    torsion = np.std(clean.q_motor - clean.q)
    attenuation = 2.0 * 1.5e-5**2 * 0.3 / torsion**2
    assert attenuation * STIFFNESS > 4.0 * spread / np.sqrt(20)


def test_viscous_friction_of_a_locked_joint_is_no_damping():
    signals = noisy(steady_motion(True), 0)
    sure = estimate_joint(signals, locked=True, viscous=VISCOUS)
    both = estimate_joint(signals, locked=True, viscous=0.0)
    assert both.damping == pytest.approx(sure.damping + VISCOUS)


def refused(message, signals, **options):
    with pytest.raises(InputError, match=message):
        estimate_joint(signals, **options)


def test_a_joint_that_is_not_twisted():
    weak = noisy(steady_motion(False, size=0.02), 1)
    refused("shoulder: not excited as an elastic joint: .* beyond the noise", weak)
    # as rigid as can be, on a motion that is large
    clean = steady_motion(False)
    rigid = noisy(replace(clean, q_motor=clean.q), 2)
    refused("not excited as an elastic joint: torsion of .* is lost in noise", rigid)


def test_one_frequency_does_not_distinguish_all_parameters():
    refused(
        "does not distinguish .* and .*; a motion with more",
        steady_motion(True, lines=1),
        locked=True,
        viscous=0.0,
    )


def test_signals_of_other_kinds():
    signals = steady_motion(False)
    refused(
        "q_motor of shoulder moves by 49.* times q", replace(signals, q_motor=50 * signals.q_motor)
    )
    refused("q_motor of shoulder moves by -", replace(signals, q_motor=-signals.q_motor))
    refused("q is constant", replace(signals, q=0.0 * signals.q))
    refused("stiffness = -.*sign of the torque", replace(signals, tau=-signals.tau))
    refused(
        "samples; at least",
        replace(
            signals,
            t=signals.t[:100],
            tau=signals.tau[:100],
            q=signals.q[:100],
            q_motor=signals.q_motor[:100],
        ),
    )


def test_a_link_that_is_late():
    """A lag of the link looks like a torsion that goes with the velocity, a drive that pushes."""
    signals = noisy(steady_motion(False), 3)
    refused("signals at other instants", replace(signals, q=np.roll(signals.q, 2)))


def test_the_option_for_locked_joints_is_required():
    moving, locked_motion = steady_motion(False), steady_motion(True)
    refused("viscous friction not given; must be for a locked joint", locked_motion, locked=True)
    refused("viscous friction given; must be not", moving, viscous=1.0)
    refused("a locked joint must stand still", moving, locked=True, viscous=1.0)
    refused("or the option for locked joints", locked_motion)


def test_known_noise_of_the_positions():
    signals = noisy(steady_motion(False), 4)
    measured = estimate_joint(signals)
    with_noise = estimate_joint(signals, position_noise=(POSITION_NOISE, POSITION_NOISE))
    np.testing.assert_allclose(with_noise.values, measured.values, rtol=1e-3, atol=1e-2)
    ignored = estimate_joint(signals, position_noise=(0.0, 0.0))
    assert ignored.stiffness < with_noise.stiffness


def test_slow_sampling():
    """At 333 Hz the test function becomes longer."""
    fast = noisy(steady_motion(False, lines=20), 5)
    t = fast.t[::3]
    slow = replace(fast, t=t, tau=fast.tau[::3], q_motor=fast.q_motor[::3], q=fast.q[::3])
    found = estimate_joint(slow)
    assert abs(found.stiffness - STIFFNESS) < 4.0 * found.deviation("stiffness")
    assert abs(found.inertia - INERTIA) < 4.0 * found.deviation("inertia")
