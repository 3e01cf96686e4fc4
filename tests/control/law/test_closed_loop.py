"""The law on Drake's own plant: every virtual output obeys the linear dynamics of its poles.

The plant is Drake's multibody plant with motors, rotors and springs. The continuous controller
closes the loop, the differential equation is integrated tightly, and the result is compared with
``e^(r) + a_r e^(r-1) + ... + a_1 e = 0`` from the initial state on.
"""

import numpy as np
import pytest

from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.path import PathManifold
from tests.control.law.closed_loop import ClosedLoop, assert_linear_dynamics, simulate, start
from tests.control.manifolds.surfaces import euler_difference, path_on_cylinder

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


@pytest.mark.slow(but="velocity servos")
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
    check(robot, rigid, path, make_law(robot.chain, name, oriented), virtual_output)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["velocity_servo", "rigid", "visco_elastic", "elastic"])
def test_a_path_on_a_surface(name, load_robot, make_law, virtual_output):
    """Along it, along the surface's normal, and sideways; the frame turns about the tangent."""
    path = path_on_cylinder()
    r, model = RELATIVE_DEGREE[name], "comau_racer_1_4{}_3r"
    rigid = load_robot(model.format(""))
    robot = load_robot(model.format("_elastic")) if r > 2 else rigid
    if name == "visco_elastic":
        robot = load_robot(model.format("_elastic"), tuple(2e-3 * robot.chain.K_s))
    manifold = PathManifold(r, oriented=False, turning=True)
    point = path.evaluator(r).evaluate_at(0.7)
    assert abs(point[manifold.layout.turn][0]) > 0.01
    law = make_law(robot.chain, name, manifold=manifold)
    check(robot, rigid, path, law, virtual_output)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "convention"), [("velocity_servo", "zyx"), ("velocity_servo", "zyz"), ("rigid", "zyx")]
)
def test_euler_angles(name, convention, load_robot, make_law, virtual_output, oriented_path):
    """The law with the analytic Jacobian (2.16): the tool's own angles obey linear dynamics."""
    robot = load_robot("comau_racer_1_4")
    manifold = PathManifold(RELATIVE_DEGREE[name], oriented=True, euler=convention)
    law = make_law(robot.chain, name, manifold=manifold)

    def output(path, y_t, R_e):
        R_d = path.orientation.rotation_matrix(path.nearest(y_t))
        angles = euler_difference(R_e, R_d, convention)
        return np.append(virtual_output(path, y_t, R_e)[:3], angles)

    check(robot, robot, oriented_path, law, output)


def check(robot, rigid, path, law, virtual_output, theta=0.7):
    """Run a robot along a path and compare."""
    loop = ClosedLoop(robot, path, law, theta)
    x = start(robot, path, rigid, theta, loop.size)
    loop.middle = x[: robot.n] + 0.05
    times, states = simulate(loop, x)
    results = [loop.evaluate(t, x) for t, x in zip(times, states, strict=True)]
    assert not any(result[law.layout.status][0] for result in results)
    Y = np.array([result[law.layout.manifold_state] for result in results])
    v = np.array([result[law.layout.virtual_input] for result in results])
    reference = np.array([loop.reference(t) for t in times])
    assert np.ptp(reference[:, 0, 0]) > 0.05
    poses = [robot.tool_pose(loop.state(x)) for x in states]
    outputs = np.array([virtual_output(path, *pose) for pose in poses])
    assert_linear_dynamics(Y.reshape(len(times), loop.r, loop.m), v, outputs, reference)
