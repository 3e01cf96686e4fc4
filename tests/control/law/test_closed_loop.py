"""The law on Drake's own plant: every virtual output obeys the linear dynamics of its poles.

The plant is Drake's multibody plant with motors, rotors and springs. The continuous controller
closes the loop, the differential equation is integrated tightly, and the result is compared with
``e^(r) + a_r e^(r-1) + ... + a_1 e = 0`` from the initial state on.
"""

import numpy as np
import pytest

from tests.control.law.closed_loop import STEP, ClosedLoop, predicted, simulate, start

# first derivative from nine equidistant values, error h^8 f^(9) / 630
NINE_POINTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


# law, model, joint damping as a fraction of the stiffness [s], orientation, damping of the drives
CASES = {
    "velocity servos": ("velocity_servo", "comau_racer_1_4", 0.0, True, 0.0),
    "rigid": ("rigid", "comau_racer_1_4", 0.0, True, 0.0),
    "visco-elastic": ("visco_elastic", "comau_racer_1_4_elastic", 5e-3, True, 0.0),
    "elastic": ("elastic", "comau_racer_1_4_elastic", 0.0, True, 0.0),
    "elastic, three axes": ("elastic", "comau_racer_1_4_elastic_3r", 0.0, False, 0.0),
    "visco-elastic, three axes": ("visco_elastic", "comau_racer_1_4_elastic_3r", 2e-3, False, 0.0),
    "rigid, damped drives": ("rigid", "comau_racer_1_4", 0.0, True, 20.0),
    "elastic, damped drives": ("elastic", "comau_racer_1_4_elastic_3r", 0.0, False, 30.0),
    "visco-elastic, damped drives": (
        "visco_elastic",
        "comau_racer_1_4_elastic_3r",
        2e-3,
        False,
        30.0,
    ),
    "rigid, joints to spare": ("rigid", "comau_racer_1_4", 0.0, False, 0.0),
    "visco-elastic, joints to spare": (
        "visco_elastic",
        "comau_racer_1_4_elastic",
        5e-3,
        False,
        0.0,
    ),
    "elastic, joints to spare": ("elastic", "comau_racer_1_4_elastic", 0.0, False, 0.0),
    "velocity servos, seven axes": ("velocity_servo", "franka_emika_panda", 0.0, True, 0.0),
    "rigid, seven axes": ("rigid", "franka_emika_panda", 0.0, True, 0.0),
    "visco-elastic, seven axes": ("visco_elastic", "franka_emika_panda_elastic", 5e-3, True, 0.0),
    "elastic, seven axes": ("elastic", "franka_emika_panda_elastic", 0.0, True, 0.0),
}


@pytest.mark.parametrize("case", CASES)
def test_outputs_obey_the_predicted_linear_dynamics(
    case, load_robot, make_law, virtual_output, oriented_path, position_path, small_path
):
    name, model, damping, oriented, viscous = CASES[case]
    robot = load_robot(model)
    rigid = load_robot(model.replace("_elastic", ""))
    if damping or viscous:
        joints = tuple(damping * robot.chain.K_s) if damping else ()
        drives = tuple(viscous / (1.0 + i) for i in range(robot.n)) if viscous else ()
        robot = load_robot(model, joints, drives)
        assert np.array_equal(robot.chain.viscous_damping, drives or np.zeros(robot.n))
    if damping:
        assert np.allclose(robot.chain.K_d, damping * robot.chain.K_s, rtol=1e-12)
    path = oriented_path if oriented else position_path
    if robot.n == 7:
        path = small_path
    theta = 0.7
    law = make_law(robot.chain, name, oriented)
    loop = ClosedLoop(robot, path, law, theta)
    x = start(robot, path, rigid, theta, loop.size)
    loop.middle = x[: robot.n] + 0.05
    times, states = simulate(loop, x)

    results = [loop.evaluate(t, x) for t, x in zip(times, states, strict=True)]
    assert not any(result[law.layout.status][0] for result in results)
    Y = np.array([result[law.layout.manifold_state] for result in results])
    Y = Y.reshape(len(times), loop.r, loop.m)
    v = np.array([result[law.layout.virtual_input] for result in results])
    reference = np.array([loop.reference(t) for t in times])

    # the outputs are what they are called, and every order is the derivative of the one below
    poses = [robot.tool_pose(loop.state(x)) for x in states]
    outputs = np.array([virtual_output(path, *pose) for pose in poses])
    assert np.allclose(Y[:, 0], outputs, rtol=0, atol=1e-10)
    chain = np.concatenate([Y, v[:, None]], axis=1)
    for k in range(loop.r):
        numeric = np.array([np.correlate(y, NINE_POINTS, "valid") for y in chain[:, k].T]).T / STEP
        scale = np.abs(chain[:, k + 1]).max(axis=0)
        assert np.all(scale > 0.0)
        assert np.abs((numeric - chain[4:-4, k + 1]) / scale).max() < 2e-6, f"order {k + 1}"

    # the errors are there at first, the reference moves, and the loop is linear
    initial = Y[0] - reference[0, : loop.r]
    assert np.all(np.abs(initial) > 1e-4)
    assert np.ptp(reference[:, 0, 0]) > 0.05
    expected = reference[:, 0].copy()
    for i in range(loop.m):
        poles = [-20.0 - 3.0 * i - 2.0 * k for k in range(loop.r)]
        expected[:, i] += predicted(initial[:, i], poles)
    deviation = np.abs(outputs - expected).max(axis=0)
    # the integration leaves 1e-13
    assert deviation.max() < 1e-10
