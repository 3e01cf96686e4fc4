"""Signals that a person has mistaken are named; sound ones pass, whatever their noise."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from identification.estimation.wiring import doubtful_signals, find_mistake
from identification.excitation.fourier import FourierTrajectory
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject

JOINTS = 3
NOISE = np.array([3.0, 3.0, 2.0])


@pytest.fixture(name="arm", scope="module")
def fixture_arm():
    """Return regressor, base and true parameters of an arm with three joints."""
    subject = load_subject("comau_racer_1_4_3r")
    regressor = Regressor(subject)
    return regressor, base_parameters(regressor), true_parameters(subject)


@pytest.fixture(name="sound", scope="module")
def fixture_sound(arm, measure_torques):
    """Return a measurement of the arm."""
    regressor, _, truth = arm
    random = np.random.default_rng(3)
    a, b = random.uniform(-0.6, 0.6, (2, JOINTS, 2))
    trajectory = FourierTrajectory([0.2, 1.0, 0.3], a, b, 10.0, (1, 3))
    motion = trajectory.motion(trajectory.sample_times(40.0))
    tau = regressor.matrix(*motion) @ truth
    return measure_torques(motion, tau, NOISE, seed=1)


def times(motion, signal, factors):
    """Return a motion with a signal times factors of the joints."""
    of = {"q": ("q", "v", "a"), "tau": ("tau", "tau_periods")}[signal]
    changed = {name: getattr(motion, name) * factors for name in of}
    if signal == "tau":
        changed["torque_variance"] = motion.torque_variance * np.square(factors)
    return replace(motion, **changed)


def swapped(motion, i, j, *signals):
    """Return a motion with joints exchanged in some signals."""
    order = list(range(motion.q.shape[1]))
    order[i], order[j] = j, i
    of = {"q": ("q", "v", "a"), "tau": ("tau", "tau_periods", "torque_variance")}
    names = [name for signal in signals for name in of[signal]]
    return replace(motion, **{name: getattr(motion, name)[..., order] for name in names})


def only(joint, factor, joints=JOINTS):
    factors = np.ones(joints)
    factors[joint] = factor
    return factors


def causes(arm, motion):
    found = find_mistake(*arm[:2], motion)
    return "" if found is None else found.cause


def test_sound_signals_pass(arm, sound):
    assert causes(arm, sound) == ""


@pytest.mark.parametrize("joint", range(JOINTS))
@pytest.mark.parametrize("signal", ["q", "tau"])
def test_a_wrong_sign_is_named(arm, sound, joint, signal):
    found = find_mistake(*arm[:2], times(sound, signal, only(joint, -1.0)))
    # which of the two it is nothing tells about an upright axis
    assert f"{signal} of joint_{joint + 1} has the wrong sign" in found.cause
    assert joint == 0 or found.cause.startswith(signal)
    assert found.after == pytest.approx(1.0, abs=0.1)


def test_signs_of_several_torques_are_named(arm, sound):
    turned = times(sound, "tau", np.array([-1.0, 1.0, -1.0]))
    assert causes(arm, turned) == "tau of joint_1 and joint_3 have the wrong sign"
    # a model explains these as well as the right ones, but for friction that drives
    found = find_mistake(*arm[:2], times(sound, "tau", -np.ones(JOINTS)))
    assert found.cause == "tau of all joints have the wrong sign"
    assert found.before == pytest.approx(found.after)
    assert "below zero" in found.negative


@pytest.mark.slow(but=["signals0-pair0", "signals1-pair1", "signals2-pair2"])
@pytest.mark.parametrize("pair", list(combinations(range(JOINTS), 2)))
@pytest.mark.parametrize("signals", [("q",), ("tau",), ("q", "tau")])
def test_exchanged_joints_are_named(arm, sound, pair, signals):
    i, j = pair
    expected = f"{' and '.join(signals)} of joint_{i + 1} and joint_{j + 1} are exchanged"
    assert causes(arm, swapped(sound, i, j, *signals)).startswith(expected)


@pytest.mark.parametrize("joint", range(JOINTS))
@pytest.mark.parametrize(("factor", "notes"), [(180.0 / np.pi, "deg"), (np.pi / 180.0, "rad")])
def test_a_unit_of_an_angle_is_named(arm, sound, joint, factor, notes):
    spoilt = times(sound, "q", only(joint, factor))
    assert f"q of joint_{joint + 1} is in {notes}" in causes(arm, spoilt)


@pytest.mark.parametrize("factor", [180.0 / np.pi, np.pi / 180.0])
def test_a_unit_of_all_angles_is_named(arm, sound, factor):
    assert "q of all turning joints is in" in causes(
        arm, times(sound, "q", np.full(JOINTS, factor))
    )


@pytest.mark.parametrize("joint", range(JOINTS))
@pytest.mark.parametrize(("factor", "unit"), [(1e3, "mNm"), (1e-3, "kNm")])
def test_a_unit_of_a_torque_is_named(arm, sound, joint, factor, unit):
    cause = causes(arm, times(sound, "tau", only(joint, factor)))
    assert cause.startswith(f"tau of joint_{joint + 1} must be") and f"in {unit}" in cause


@pytest.mark.parametrize(("factor", "cause"), [(1e3, "t is in ms"), (1e-3, "t is in s, not in ms")])
def test_a_unit_of_time_is_named(arm, sound, factor, cause):
    slow = replace(sound, v=sound.v / factor, a=sound.a / factor**2)
    assert causes(arm, slow).startswith(cause)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_unit_that_torques_cannot_verify_is_reported(arm, sound, factor):
    """All masses times 1,000 move in the same way: the model alone knows better."""
    regressor, base, truth = arm
    other = times(sound, "tau", np.full(JOINTS, factor))
    assert find_mistake(regressor, base, other) is None
    notes = doubtful_signals(regressor, base, other, truth)
    assert any(f"all torques are about {factor:.2g} times" in note for note in notes)


@pytest.mark.parametrize("factor", [1.2, 1.0 / 1.2])
def test_an_undetectable_factor_is_reported_from_the_model(arm, sound, factor):
    """With so much noise that a factor in the last torque does not show in the others."""
    regressor, base, truth = arm
    noise = np.array([300.0, 300.0, 2.0])
    loud = replace(sound, torque_variance=noise**2)
    wrong = times(loud, "tau", only(2, factor))
    assert find_mistake(regressor, base, wrong) is None
    hidden, doubtful = doubtful_signals(regressor, base, wrong, truth)[-2:]
    assert hidden.startswith("a factor of 1.2 in tau of ") and "joint_3" in hidden
    assert doubtful.startswith(f"tau of joint_3 is {factor:.2g} times the model's torque")
    # sound torques are none, and a model without friction does not know
    unknown = np.where(np.arange(len(truth)) < len(truth) - 1, truth, np.nan)
    for notes in (
        doubtful_signals(regressor, base, loud, truth),
        doubtful_signals(regressor, base, wrong, unknown),
    ):
        assert not any(note.startswith("tau of ") for note in notes)


def test_unverifiable_signals_of_a_single_joint_are_reported(measure_torques, tmp_path):
    """A wheel: any factor of its torque, and any unit of its angle, is another inertia."""
    file = tmp_path / "wheel.urdf"
    file.write_text(
        '<robot name="wheel"><link name="base"/><link name="tool_point"><inertial>'
        '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        '</link><joint name="axle" type="revolute"><axis xyz="0 0 1"/><parent link="base"/>'
        '<child link="tool_point"/><limit effort="9" velocity="9" lower="-3" upper="3"/></joint>'
        "</robot>"
    )
    regressor = Regressor(load_subject(file))
    base = base_parameters(regressor)
    t = np.linspace(0.0, 10.0, 400, endpoint=False)[:, None]
    w = 2.0 * np.pi / 10.0
    motion = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    tau = 2.0 * motion[2] + 0.5 * np.sign(motion[1]) + 0.3 * motion[1]
    measured = measure_torques(motion, tau, 0.01)
    notes = " ".join(doubtful_signals(regressor, base, measured, np.zeros(13)))
    assert "q of axle is in deg" in notes
    assert "factor of 1.2 in tau of axle" in notes
    # a sign makes friction negative even here
    found = find_mistake(regressor, base, times(measured, "tau", -1.0))
    assert "tau of all joints" in found.cause and "joint_1.f_" in found.negative


@pytest.mark.slow(but="1")
@pytest.mark.parametrize("joint", range(6))
def test_signs_of_the_comau(comau, measure, joint):
    """The last axis hardly acts on the others: friction below zero shows it."""
    found = find_mistake(comau.regressor, comau.base, times(measure(), "tau", only(joint, -1.0, 6)))
    assert found.cause.startswith(f"tau of joint_{joint + 1} has the wrong sign")


@pytest.mark.slow
def test_exchanged_wrist_torques_of_the_comau(comau, measure):
    found = find_mistake(comau.regressor, comau.base, swapped(measure(), 3, 4, "tau"))
    assert found.cause == "tau of joint_4 and joint_5 are exchanged"


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("options", [{}, {"noise": 5.0}, {"noise": 0.1}, {"colour": 0.9}], ids=str)
def test_noise_is_no_mistake(comau, measure, seed, options):
    assert find_mistake(comau.regressor, comau.base, measure(seed, **options)) is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["offset", "stribeck", "quadratic", "ripple", "payload"])
def test_what_a_model_lacks_is_no_mistake_of_signals(comau, measure, kind):
    q, v, _ = comau.motion
    share, friction = v / np.abs(v).max(axis=0), 5.0 * comau.noise
    extra = {
        "offset": friction * np.ones_like(v),
        "stribeck": friction * np.sign(v) * np.exp(-((share / 0.1) ** 2)),
        "quadratic": friction * share * np.abs(share),
        "ripple": friction * np.sin(30.0 * q),
        "payload": friction * np.sin(q),
    }[kind]
    assert find_mistake(comau.regressor, comau.base, measure(extra=extra)) is None
