"""Compiled linearizations: what they refuse, and the composite law against Drake's matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import decoupling_function, linearize
from pfsc_drake.control.manifolds.moving_point import MovingPoint
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix

# central differences of order eight, k = 1..4
FIRST = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([8 / 5, -1 / 5, 8 / 315, -1 / 560])


@pytest.mark.parametrize("oriented", [True, False])
def test_singular_perturbation_law_is_slow_plus_fast(
    oriented, load_robot, make_law, virtual_output, oriented_path, position_path
):
    """(3.70) + (3.71), mass matrix and bias from Drake, the path Jacobian by differences."""
    suffix, path = ("", oriented_path) if oriented else ("_3r", position_path)
    robot = load_robot(f"comau_racer_1_4_elastic{suffix}")
    rigid = load_robot(f"comau_racer_1_4{suffix}")
    n, rng = robot.n, np.random.default_rng(1)
    damping = rng.uniform(0.01, 0.1, n)
    theta = 0.4
    R_e = None
    if oriented:
        R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
        R_e = R_d @ Rotation.from_euler("ZYX", [0.1, -0.05, 0.08]).as_matrix()
    q = robot.reach(path.position.derivatives(theta, 0)[0] + [0.01, 0.01, -0.02] * np.ones(3), R_e)
    v, tau_ext = rng.uniform(-0.3, 0.3, n), rng.uniform(-20.0, 20.0, n)
    q_M, v_M = q + rng.uniform(-1e-3, 1e-3, n), v + rng.uniform(-0.01, 0.01, n)

    def outputs(q):
        return virtual_output(path, *rigid.tool_pose(np.concatenate([q, np.zeros(n)])))

    def around(direction, h):
        return np.array(
            [[outputs(q + side * k * h * direction) for k in range(1, 5)] for side in (1, -1)]
        )

    h = 2e-3
    columns = [around(axis, h) for axis in np.eye(n)]
    jacobian = np.array([FIRST @ (plus - minus) / h for plus, minus in columns]).T
    plus, minus = around(v, h)
    convective = SECOND @ (plus + minus - 2 * outputs(q)) / h**2

    law = make_law(robot.chain, "singular_perturbation", oriented, boundary_layer_damping=damping)
    point = path.evaluator(2)(rigid.tool_pose(np.concatenate([q, v]))[0].tolist(), theta)
    reference = rng.uniform(-0.01, 0.01, (3, n))
    reference[0, 0] += point[1]
    result = law.evaluate(
        np.concatenate([q, v, q_M, v_M]), point, reference.ravel(), np.zeros(n), tau_ext=tau_ext
    )

    error, rate = outputs(q) - reference[0], jacobian @ v - reference[1]
    gains = law.stabilization.proportional
    v_p = reference[2] - gains[1] * rate - gains[0] * error
    D_E, n_E = rigid.link_dynamics(q, v)
    slow = n_E - tau_ext
    slow += (D_E + np.diag(rigid.chain.D_M)) @ np.linalg.solve(jacobian, v_p - convective)
    fast = -damping * robot.chain.K_s * (v_M - v)
    assert np.abs(fast).max() > 1.0
    assert np.allclose(result[law.layout.virtual_input], v_p, rtol=0, atol=1e-8)
    assert np.allclose(result[law.layout.drive], slow + fast, rtol=0, atol=1e-5)


def test_relative_degrees_are_the_dissertations():
    assert RELATIVE_DEGREE == {
        "velocity_servo": 1,
        "rigid": 2,
        "singular_perturbation": 2,
        "visco_elastic": 3,
        "elastic": 4,
    }


@pytest.mark.parametrize("law", ["velocity_servo", "rigid", "visco_elastic", "elastic"])
def test_shapes(law, load_robot):
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    linearization = linearize(chain, law, PathManifold(RELATIVE_DEGREE[law], oriented=False))
    r = RELATIVE_DEGREE[law]
    function = linearization.function
    assert linearization.relative_degree == r == linearization.manifold.layout.order
    assert (linearization.num_joints, linearization.num_outputs) == (3, 3)
    assert [function.size_in(i)[0] for i in range(3)] == [
        12,
        3 * max(r - 1, 0),
        linearization.manifold.layout.size,
    ]
    assert [function.size_out(i) for i in range(6)] == [
        (3, r),
        (3, 3),
        (3, 1),
        (3, 3),
        (3, 1),
        (3, 1),
    ]


@pytest.mark.slow
def test_only_sampled_laws_for_elastic_joints_are_extrapolated(load_robot):
    chain = load_robot("comau_racer_1_4_elastic_3r", (10.0,) * 3).chain
    for law in ("rigid", "visco_elastic", "elastic"):
        for sampling_time in (0.0, 1e-3):
            options = ActuationOptions(sampling_time)
            linearization = linearize(
                chain, law, PathManifold(RELATIVE_DEGREE[law], oriented=False), options
            )
            lead = {"elastic": 0.5, "visco_elastic": 1.0}.get(law, 0.0)
            assert linearization.lead == (lead if sampling_time > 0.0 else 0.0)


def test_torques_of_rigid_joints_lead_if_that_is_chosen(load_robot):
    chain, manifold = load_robot("comau_racer_1_4_3r").chain, PathManifold(2, oriented=False)
    for sampling_time, lead in ((0.0, 0.0), (1e-3, 0.5)):
        options = ActuationOptions(sampling_time, leads_torque=True)
        assert linearize(chain, "rigid", manifold, options).lead == lead
    with pytest.raises(InputError, match="law 'velocity_servo': torques lead with the law 'rigid'"):
        linearize(chain, "velocity_servo", PathManifold(1, oriented=False), options)


@pytest.mark.parametrize(
    ("law", "oriented", "message"),
    [
        ("flexible", False, r"law 'flexible': unknown; allowed are velocity_servo, rigid"),
        ("rigid", True, r"law 'rigid': 3 joints for 6 outputs \(eta, xi_1, .*as many or more"),
        ("elastic", False, r"law 'elastic': needs a robot with elastic joints"),
    ],
)
def test_laws_that_do_not_suit_are_refused(law, oriented, message, load_robot):
    manifold = PathManifold(RELATIVE_DEGREE.get(law, 2), oriented=oriented)
    with pytest.raises(InputError, match=message):
        linearize(load_robot("comau_racer_1_4_3r").chain, law, manifold)


def test_a_manifold_of_another_order_is_refused(load_robot):
    with pytest.raises(InputError, match=r"law 'rigid': manifold of order 3; must be 2"):
        linearize(load_robot("comau_racer_1_4_3r").chain, "rigid", PathManifold(3, oriented=False))


@pytest.mark.slow(but=["rigid", "velocity_servo"])
@pytest.mark.parametrize("law", ["velocity_servo", "rigid", "elastic"])
def test_the_decoupling_matrix_alone_is_that_of_the_law(law, load_robot, oriented_path):
    chain = load_robot("comau_racer_1_4_elastic").chain
    order = RELATIVE_DEGREE[law]
    for manifold in (PathManifold(order, oriented=True), MovingPoint(order, oriented=True)):
        point = oriented_path.evaluator(order).evaluate_at(0.7)
        state = np.random.default_rng(2).uniform(-0.5, 0.5, 24)
        q = state[12:18] if law == "rigid" else state[:6]
        progress = [np.arange(order + 1.0)] if manifold.follows_time else []
        whole = linearize(chain, law, manifold, ActuationOptions(0.0)).function(
            state, np.zeros(6 * max(order - 1, 0)), point, *progress
        )
        alone = np.array(decoupling_function(chain, manifold)(q, point))
        assert np.allclose(alone, np.array(whole[1]), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "damping", [None, np.ones(2), np.array([0.1, 0.0, 0.1]), np.array([0.1, np.nan, 0.1])]
)
def test_boundary_layer_damping_is_checked(damping, load_robot):
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    options = ActuationOptions(boundary_layer_damping=damping)
    with pytest.raises(InputError, match=r"boundary_layer_damping.*3 positive values"):
        linearize(
            chain,
            "singular_perturbation",
            PathManifold(RELATIVE_DEGREE["singular_perturbation"], oriented=False),
            options,
        )


@pytest.mark.parametrize("law", ["elastic", "visco_elastic"])
@pytest.mark.parametrize("sampling_time", [-1e-3, np.nan, np.inf])
def test_sampling_time_is_checked(law, sampling_time, load_robot):
    chain = load_robot("comau_racer_1_4_elastic_3r", (10.0,) * 3).chain
    with pytest.raises(InputError, match="sampling_time"):
        linearize(
            chain,
            law,
            PathManifold(RELATIVE_DEGREE[law], oriented=False),
            ActuationOptions(sampling_time),
        )


def test_a_continuous_visco_elastic_law_needs_damping(load_robot):
    """(3.58) divides by K_d; with a hold it does not."""
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    linearize(
        chain,
        "visco_elastic",
        PathManifold(RELATIVE_DEGREE["visco_elastic"], oriented=False),
        ActuationOptions(1e-3),
    )
    with pytest.raises(InputError, match="damping"):
        linearize(
            chain,
            "visco_elastic",
            PathManifold(RELATIVE_DEGREE["visco_elastic"], oriented=False),
            ActuationOptions(0.0),
        )
