"""Base parameters in closed form against those found with numbers."""

from dataclasses import replace

import numpy as np
import pytest

from identification.model.base import base_parameters
from identification.model.dynamic_parameters import link_parameters, transform_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.robot.serial.rotor_coupling import RotorMount
from tests.identification.model.closed_form_base import analytic_base

DOWN = np.array([0.0, 0.0, -9.81])


def projector(matrix):
    return np.linalg.pinv(matrix) @ matrix


def arm(twists, gravity=DOWN, seed=0):
    """An arm with axes z of frames that are twisted about x, at random offsets."""
    rng = np.random.default_rng(seed)
    links = []
    for i, twist in enumerate(np.deg2rad(twists)):
        c, s = np.round([np.cos(twist), np.sin(twist)], 15)
        R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        center, box = rng.normal(size=3), np.diag(rng.uniform(0.1, 0.2, 3))
        p, axis = rng.normal(size=3), np.array([0.0, 0.0, 1.0])
        links.append(ChainLink(f"j{i}", "revolute", R, p, axis, 1.0, center, box, 0.5))
    return SerialChain(tuple(links), gravity=np.asarray(gravity))


def subject_with(chain, mounts=None):
    n = chain.dimension
    unlimited = np.full(n, np.inf)
    return Subject(
        name="arm",
        chain=chain,
        delta=None,
        mounts=mounts,
        gear_ratio=np.arange(5.0, 5.0 + n),
        position_limits=chain.gather("position_limits"),
        velocity_limit=unlimited,
        acceleration_limit=unlimited,
        effort_limit=unlimited,
        joint_names=list(chain.names),
        joint_units=["rad"] * n,
        coulomb=None,
        viscous=None,
    )


@pytest.mark.parametrize("coupling", [False, True])
@pytest.mark.parametrize("robot", ["comau_racer_1_4", "franka_emika_panda", "festo_expt_45"])
def test_both_sets_span_the_same_space(subject_of, robot, coupling):
    subject = subject_of(robot)
    by_numbers = base_parameters(Regressor(subject, coupling=coupling))
    analytic = analytic_base(subject, coupling=coupling)
    assert sorted(analytic.indices) == sorted(by_numbers.indices)
    np.testing.assert_allclose(
        projector(analytic.projection), projector(by_numbers.projection), atol=1e-10
    )


@pytest.mark.parametrize(
    ("twists", "gravity"),
    [
        ([0, 0, 0, 0], DOWN),  # all axes parallel, and to gravity
        ([0, 0, 180, 90], DOWN),
        ([0, 90, 0, -90], DOWN),
        ([0, 90, 0, -90], [3.0, 0.0, -9.0]),  # on a slope
        ([90, 0, 90, 0], DOWN),  # on a wall
        ([0, 0, 90, 90], [0.0, 0.0, 0.0]),
        ([0, 40, -65, 20], DOWN),  # at any angles
    ],
)
def test_any_arm_of_turning_joints(twists, gravity):
    subject = subject_with(arm(twists, gravity))
    by_numbers = base_parameters(Regressor(subject))
    analytic = analytic_base(subject)
    assert analytic.rank == by_numbers.rank
    np.testing.assert_allclose(
        projector(analytic.projection), projector(by_numbers.projection), atol=1e-10
    )


@pytest.mark.slow(
    but=[
        "0-twists0",
        "1-twists1",
        "2-twists2",
        "3-twists0",
        "4-twists1",
        "5-twists2",
        "6-twists0",
        "7-twists1",
    ]
)
@pytest.mark.parametrize("twists", [[0, 90, 0, -90], [0, 0, 90, 90], [0, 40, -65, 20]])
@pytest.mark.parametrize("seed", range(8))
def test_rotors_wherever_they_sit(twists, seed):
    """On the base, on links before and on their own, along coordinate axes or not."""
    rng = np.random.default_rng(seed)
    mounts = []
    for j in range(4):
        axis = np.eye(3)[rng.integers(3)] if seed % 2 else rng.normal(size=3)
        link = int(rng.integers(max(0, j - 1), j + 2))
        mounts.append(RotorMount(link, axis / np.linalg.norm(axis), 5.0 + j))
    subject = subject_with(arm(twists, seed=seed), mounts)
    by_numbers = base_parameters(Regressor(subject))
    analytic = analytic_base(subject)
    assert analytic.rank == by_numbers.rank
    np.testing.assert_allclose(
        projector(analytic.projection), projector(by_numbers.projection), atol=1e-10
    )


def test_parameters_about_another_frame():
    rng = np.random.default_rng(3)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R *= np.linalg.det(R)
    p, center, box = rng.normal(size=3), rng.normal(size=3), np.diag([0.1, 0.15, 0.2])

    def about(point, turned):
        return turned + 2.0 * (point @ point * np.eye(3) - np.outer(point, point))

    there = p + R @ center
    np.testing.assert_allclose(
        transform_parameters(link_parameters(2.0, center, about(center, box)), R, p),
        link_parameters(2.0, there, about(there, R @ box @ R.T)),
        atol=1e-12,
    )


def test_slides_and_other_axes_are_refused():
    chain = arm([0, 90])
    sliding = replace(chain.links[1], kind="prismatic")
    with pytest.raises(InputError, match=r"joint 2 \(j1\) slides; must turn"):
        analytic_base(subject_with(replace(chain, links=(chain.links[0], sliding))))
    turned = replace(chain.links[1], axis=np.array([0.0, 1.0, 0.0]))
    with pytest.raises(InputError, match=r"joint 2 \(j1\) turns about .* must be z"):
        analytic_base(subject_with(replace(chain, links=(chain.links[0], turned))))
