"""Small serial arms of our own."""

import numpy as np
import pytest

from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink

X, Y, Z = np.eye(3)
UPPER_ARM, FOREARM = 0.7, 0.6  # m
ARM = [(Z, [0, 0, 0.4]), (Y, [0, 0, 0]), (Y, [UPPER_ARM, 0, 0])]


@pytest.fixture(scope="session")
def make_chain():
    """Return a function that makes chains of joints, each an axis and where it is.

    Places are seen from the joint before; ``sliding`` are the indices of prismatic joints.
    """

    def make(joints, tool, sliding=()):
        kinds = ["prismatic" if i in sliding else "revolute" for i in range(len(joints))]
        links = [
            ChainLink(f"j{i}", kind, np.eye(3), np.array(p), axis, 1.0, np.zeros(3), np.eye(3))
            for i, (kind, (axis, p)) in enumerate(zip(kinds, joints, strict=True))
        ]
        return SerialChain(tuple(links), p_LT=np.array(tool))

    return make


@pytest.fixture(scope="session")
def shoulder_and_elbow(make_chain):
    """Three axes."""
    return make_chain(ARM, [FOREARM, 0, 0])


@pytest.fixture(scope="session")
def spherical_wrist(make_chain):
    """Six axes: a spherical wrist on the end of the forearm, and a tool in front of it."""
    wrist = [(X, [FOREARM, 0, 0]), (Y, [0, 0, 0]), (X, [0, 0, 0])]
    return make_chain([*ARM, *wrist], [0.2, 0.03, 0])


@pytest.fixture(scope="session")
def offset_wrist(make_chain):
    """Six axes of which the last three miss each other, as those of many light arms do."""
    wrist = [(X, [FOREARM, 0, 0]), (Y, [0.1, 0, 0]), (X, [0, 0.1, 0])]
    return make_chain([*ARM, *wrist], [0.2, 0, 0])
