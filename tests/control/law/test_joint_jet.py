"""The joints' highest derivative, as a law asks for it, against Drake's plant that is driven so."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.exact_linearization import ExactLinearization
from pfsc_drake.control.law.joint_jet import JointJet
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from tests.control.law.closed_loop import rest_of_state

CASES = {
    "velocity_servo": ("comau_racer_1_4", True),
    "rigid": ("comau_racer_1_4", True),
    "visco_elastic": ("comau_racer_1_4_elastic_3r", False),
    "elastic": ("comau_racer_1_4_elastic", True),
}
STEP = 1e-5  # s, of a central difference along the plant's motion


@pytest.mark.slow(but=["visco_elastic", "rigid", "velocity_servo"])
@pytest.mark.parametrize("name", CASES)
def test_the_highest_derivative_is_that_of_the_plant(
    name, load_robot, make_law, oriented_path, position_path
):
    model, oriented = CASES[name]
    robot, r = load_robot(model), RELATIVE_DEGREE[name]
    if name == "visco_elastic":
        robot = load_robot(model, tuple(2e-3 * robot.chain.K_s))
    rigid = load_robot(model.replace("_elastic", ""))
    path, n = oriented_path if oriented else position_path, robot.n
    law = make_law(robot.chain, name, oriented)
    y_t = path.position.derivatives(0.7, 0)[0] + 0.005
    R_e = path.orientation.rotation_matrix(0.7) if oriented else None
    q = robot.reach(y_t, R_e)
    x = rest_of_state(robot, rigid, q, {1: n, 2: 2 * n}.get(r, 4 * n))
    x = np.concatenate([x, np.zeros(2 * n - len(x))]) if r == 1 else x
    state = np.tile(x, 4 * n // len(x))
    point = path.evaluator(r)(robot.tool_pose(state)[0].tolist(), 0.7)
    m = law.linearization.num_outputs
    reference = np.zeros((r + 1) * m)
    reference[0] = point[law.linearization.manifold.layout.eta][0]
    result = law.evaluate(state, point, reference, np.zeros(m))

    relation = Stepper(ExactLinearization(law.linearization))
    block = Stepper(JointJet(law.linearization, law.layout))

    def motion(state):
        told = relation.step(joint_state=state, manifold_point=point)["relation"]
        return block.step(relation=told, evaluation=result)["joint_jet"].reshape(r + 1, n)

    jet = motion(state).copy()
    assert np.allclose(jet[0], q, rtol=0, atol=1e-15)
    drive = result[law.layout.drive]
    if r == 1:
        assert np.array_equal(jet[1], drive)
        return
    assert np.array_equal(jet[1], state[n : 2 * n])
    rates = robot.rates(state, drive, np.zeros(n))
    if r > 2:
        assert np.allclose(jet[2], rates[n : 2 * n], rtol=1e-10, atol=1e-9)
    # the (r - 1)-th derivative is a function of the state, whose rate the drives decide
    ahead, behind = (motion(state + sign * STEP * rates)[r - 1] for sign in (1.0, -1.0))
    expected = (ahead - behind) / (2.0 * STEP)
    assert np.abs(jet[r] - expected).max() < 1e-6 * np.abs(expected).max()
