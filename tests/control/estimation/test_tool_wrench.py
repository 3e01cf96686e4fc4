"""Wrenches from joint torques, against Drake's Jacobian."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.external_forces import ToolWrench
from pfsc_drake.errors import InputError

WRENCH = np.array([12.0, -7.0, 30.0, 1.5, -0.8, 0.6])
Q = np.array([0.3, 1.2, -0.5, 0.4, 0.9, -0.2])


def torques(robot, q, wrench):
    """Return ``J^T wrench``; Drake's rows are angular, then linear."""
    J = robot.jacobian(q)
    return J[3:].T @ wrench[:3] + J[:3].T @ wrench[3:]


def wrench_of(block, q, tau):
    n = len(q)
    state = np.concatenate([q, np.ones(n), np.full(2 * n, np.nan)])
    return Stepper(block).step(joint_state=state, tau_ext=tau)["wrench"]


def test_the_wrench_of_six_torques(load_robot):
    robot = load_robot("comau_racer_1_4")
    found = wrench_of(ToolWrench(robot.chain), Q, torques(robot, Q, WRENCH))
    np.testing.assert_allclose(found, WRENCH, rtol=0, atol=1e-9)


def test_the_force_of_three_torques(load_robot):
    robot, force = load_robot("comau_racer_1_4_3r"), np.append(WRENCH[:3], np.zeros(3))
    found = wrench_of(ToolWrench(robot.chain), Q[:3], torques(robot, Q[:3], force))
    np.testing.assert_allclose(found, force, rtol=0, atol=1e-9)


def test_damping_keeps_a_singular_posture_from_blowing_up(load_robot):
    """A straight wrist: torques in its singular direction cause no large wrench."""
    robot, straight = load_robot("comau_racer_1_4"), Q.copy()
    straight[4] = 1e-6
    noise = 0.1 * np.array([1.0, -1.0, 1.0, 1.0, 1.0, -1.0])
    tau = torques(robot, straight, WRENCH) + noise
    wild, tame = (
        np.abs(wrench_of(ToolWrench(robot.chain, damping), straight, tau)).max()
        for damping in (0.0, 0.02)
    )
    assert wild > 1e3
    assert tame < 2.0 * np.abs(WRENCH).max()


def test_dead_bands_shorten(load_robot):
    robot = load_robot("comau_racer_1_4")
    block = ToolWrench(robot.chain, dead_bands=(10.0, 5.0))
    found = wrench_of(block, Q, torques(robot, Q, WRENCH))
    size = np.linalg.norm(WRENCH[:3])
    np.testing.assert_allclose(found[:3], WRENCH[:3] * (size - 10.0) / size, atol=1e-9)
    assert not found[3:].any()


def test_refused(load_robot):
    chain = load_robot("comau_racer_1_4").chain
    with pytest.raises(InputError, match="damping = -1"):
        ToolWrench(chain, -1.0)
    with pytest.raises(InputError, match="dead bands = nan"):
        ToolWrench(chain, dead_bands=(np.nan, 0.0))
    four = type(chain)(chain.links[:4])
    with pytest.raises(InputError, match="torques in 4 joints"):
        ToolWrench(four)


def test_force_and_torque_have_dead_bands_of_their_own(load_robot):
    robot = load_robot("comau_racer_1_4")
    block = ToolWrench(robot.chain, dead_bands=(10.0, 0.5))
    found = wrench_of(block, Q, torques(robot, Q, WRENCH))
    for part, width in ((slice(0, 3), 10.0), (slice(3, 6), 0.5)):
        size = np.linalg.norm(WRENCH[part])
        np.testing.assert_allclose(found[part], WRENCH[part] * (size - width) / size, atol=1e-9)
