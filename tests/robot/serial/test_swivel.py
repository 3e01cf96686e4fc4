"""The swivel angle, against its definition by vectors."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.jets import Jet
from pfsc_drake.robot.serial.swivel import swivel_angle, upward_direction
from pfsc_drake.robot.singular_posture import joint_axes
from tests.control.conftest import BENT_7, Robot

JOINTS = (1, 3, 5)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(name="chain", scope="module")
def fixture_chain():
    return Robot("franka_emika_panda").chain


def angle(chain, q, upward=UP):
    jets = [Jet([value, 0.0]) for value in q]
    return float(swivel_angle(chain, jets, JOINTS, upward).coefficients[0])


def test_it_is_the_angle_between_two_planes(chain):
    rng = np.random.default_rng(3)
    for _ in range(10):
        q = np.array(BENT_7) + rng.uniform(-0.5, 0.5, 7)
        shoulder, elbow, wrist = joint_axes(chain, q)[0][list(JOINTS)]
        line = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        across = [x - (x @ line) * line for x in (UP, elbow - shoulder)]
        start, end = (x / np.linalg.norm(x) for x in across)
        turned = Rotation.from_rotvec(angle(chain, q) * line).apply(start)
        assert np.allclose(turned, end, atol=1e-12)


def test_its_derivatives_are_those_of_a_motion(chain):
    """Along a motion of third order, against differences of the angle itself."""
    rng = np.random.default_rng(4)
    c = np.array([np.array(BENT_7), *rng.uniform(-0.5, 0.5, (3, 7))])

    def at(t):
        return angle(chain, c[0] + c[1] * t + c[2] * t**2 + c[3] * t**3)

    jet = swivel_angle(chain, [Jet(list(column)) for column in c.T], JOINTS, UP)
    h = 1e-2
    samples = np.array([at(k * h) for k in range(-4, 5)])
    first = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
    second = [-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]
    assert float(jet.derivative(1)) == pytest.approx(first @ samples / h, abs=1e-9)
    assert float(jet.derivative(2)) == pytest.approx(second @ samples / h**2, abs=1e-6)


def test_the_direction_it_is_counted_from(chain):
    assert np.allclose(upward_direction(chain, np.array(BENT_7), JOINTS), UP)
    # stretched out upwards: gravity is along the arm
    upright = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 1.0, 0.0])
    across = upward_direction(chain, upright, JOINTS)
    assert abs(across @ UP) < 0.5
    weightless = dataclasses.replace(chain, gravity=np.zeros(3))
    assert np.linalg.norm(upward_direction(weightless, np.array(BENT_7), JOINTS)) == 1.0
