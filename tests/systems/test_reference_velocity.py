"""The joint velocity of a reference, as an output of the controller."""

import numpy as np
from pydrake.systems.analysis import Simulator

from pfsc_drake.systems.following_controller import FollowingController

PERIOD = 1e-3
V = np.array([0.2, -0.3, 0.4])


def test_the_velocity_of_the_reference(arm, path, make_law):
    """The joints at that velocity have the reference's rate; output a tick later, zero before."""
    law = make_law(has_reference_velocity=True)
    system, theta = FollowingController(law, PERIOD), 0.6
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    q = arm.reach(path.position.derivatives(theta, 0)[0] + np.array([0.004, -0.006, 0.005]))
    point = path.evaluator(2)(arm.pose(q)[:3].tolist(), theta)
    reference = np.zeros(9)
    reference[:6] = [point[1] + 0.01, 0.001, 0.0, 0.4, -0.1, 0.05]

    def fix(v):
        state = np.concatenate([q, v, q, v])
        values = {"joint_state": state, "manifold_point": point, "reference": reference}
        for name, value in values.items():
            system.GetInputPort(name).FixValue(context, value)

    fix(V)
    simulator.Initialize()
    port = system.GetOutputPort("reference_velocity")
    assert not port.Eval(context).any()
    simulator.AdvanceTo(PERIOD)
    expected_velocity = port.Eval(context).copy()
    fix(expected_velocity)
    rate = system.GetOutputPort("manifold_state").Eval(context)[3:]
    np.testing.assert_allclose(rate, reference[3:6], rtol=0, atol=1e-12)
    assert np.abs(expected_velocity - V).min() > 1e-3


def test_a_law_without_reference_velocities_has_no_such_port(make_law):
    assert not FollowingController(make_law(), PERIOD).HasOutputPort("reference_velocity")
