"""The posture reference as a system: where it starts and goes, and what moves it."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from pfsc_drake.control.compliance.null_space_impedance import (
    NullSpaceImpedance,
    NullSpaceImpedanceParameters,
)
from pfsc_drake.control.compliance.yielding_posture import YieldingPosture
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import FourierCurve, Path
from pfsc_drake.systems.control.posture_reference import PostureReference
from tests.control.conftest import BENT_7, Robot

PERIOD, R = 1e-3, 4
Q = np.array(BENT_7)


@pytest.fixture(name="run", scope="module")
def fixture_run():
    """Return a function that runs a posture reference and returns its rows (samples, r + 1, 7)."""
    chain = Robot("franka_emika_panda_elastic").chain
    path = Path(FourierCurve.circle([0.45, 0.0, 0.4], 0.1, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    gains = Stabilization([gains_from_poles([-10.0, -12.0, -15.0, -20.0])] * 7, R, ["q"] * 7)
    impedance = NullSpaceImpedance(NullSpaceImpedanceParameters(1.0, 20.0, 50.0), R, PERIOD)
    law = YieldingPosture(chain, PathManifold(R, oriented=False), Posture(gains, None), impedance)
    point = path.evaluator(R).evaluate_at(0.3)

    def run(duration, goal=None, torque=None):
        builder = DiagramBuilder()
        system = builder.AddSystem(PostureReference(law, 7, len(point), PERIOD, goal))
        values = {"joint_state": np.concatenate([Q, np.zeros(7), Q, np.zeros(7)])}
        values |= {"manifold_point": point} | ({} if torque is None else {"tau_ext": torque})
        for name, value in values.items():
            source = builder.AddSystem(ConstantVectorSource(value))
            builder.Connect(source.get_output_port(), system.GetInputPort(name))
        log = LogVectorOutput(system.GetOutputPort("posture_reference"), builder, PERIOD)
        simulator = Simulator(builder.Build())
        simulator.AdvanceTo(duration)
        return log.FindLog(simulator.get_context()).data().T.reshape(-1, R + 1, 7)

    return run


def test_it_starts_at_rest_where_the_joints_are_and_stays(run):
    rows = run(0.2)
    assert np.array_equal(rows[0, 0], Q)
    assert np.allclose(rows[:, 0], Q, rtol=0, atol=1e-12)
    assert np.abs(rows[:, 1]).max() < 1e-10


def test_it_goes_smoothly_to_its_goal(run):
    goal = Q + 0.3
    rows = run(3.0, goal)
    assert np.array_equal(rows[0, 1:], np.zeros((R, 7)))
    assert np.allclose(rows[-1, 0], goal, atol=2e-3)
    # no derivative that the law follows jumps; the highest rises within some hundredths of a second
    steps = np.abs(np.diff(rows, axis=0)).max(axis=(0, 2)) / np.abs(rows).max(axis=(0, 2))
    assert np.all(steps[:R] < 0.05)
    assert steps[R] < 0.2


def test_it_yields_to_torques(run):
    torque = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0])
    moved = run(1.0, None, torque)[-1, 0] - Q
    assert moved[2] > 0.01
    assert np.array_equal(run(0.1, None, np.full(7, np.nan))[-1, 0], run(0.1)[-1, 0])


def test_its_output_depends_on_its_state_alone():
    chain = Robot("franka_emika_panda").chain
    gains = Stabilization([gains_from_poles([-10.0, -12.0])] * 7, 2, ["q"] * 7)
    impedance = NullSpaceImpedance(NullSpaceImpedanceParameters(), 2, PERIOD)
    manifold = PathManifold(2, oriented=False)
    law = YieldingPosture(chain, manifold, Posture(gains, np.ones(7)), impedance)
    system = PostureReference(law, 7, manifold.layout.size, PERIOD)
    assert not system.HasAnyDirectFeedthrough()
