"""A robot with a joint that turns and one that slides, and its motion in closed form."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from identification.measurement.record import Record


@dataclass
class TwoJoints:
    """References for records."""

    name: str = "crane"
    joint_names: tuple = ("swing", "lift")
    joint_units: tuple = ("rad", "m")
    position_limits: np.ndarray = field(default_factory=lambda: np.array([[-3.0, 3.0], [0.0, 2.0]]))
    velocity_limit: np.ndarray = field(default_factory=lambda: np.array([8.0, 4.0]))
    effort_limit: np.ndarray = field(default_factory=lambda: np.array([200.0, 500.0]))


class Series:
    """``q = sum A_k sin(k w t + p_k)``, and derivatives."""

    def __init__(self, period=2.0):
        self.period = period
        self.terms = [(1, [1.5, 0.4], [0.3, 1.0]), (3, [0.2, 0.1], [0.0, 2.0])]

    def derivative(self, t, order):
        w = 2.0 * np.pi / self.period
        total = np.zeros((len(t), 2))
        for k, size, phase in self.terms:
            angle = k * w * t[:, None] + np.array(phase) + order * np.pi / 2.0
            total += np.array(size) * (k * w) ** order * np.sin(angle)
        return total + (np.array([0.2, 1.0]) if order == 0 else 0.0)

    def motion(self, t):
        return tuple(self.derivative(t, order) for order in range(3))


@pytest.fixture
def robot():
    return TwoJoints()


@pytest.fixture
def series():
    return Series()


def torques(v, a):
    return 3.0 * a + 2.0 * v + [5.0, 9.0] * np.sign(v)


@pytest.fixture
def record(series, robot):
    t = np.arange(3 * 400) * 0.005
    q, v, a = series.motion(t)
    return Record(t, q, torques(v, a), robot.joint_names, series.period)
