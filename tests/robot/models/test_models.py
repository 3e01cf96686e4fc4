"""The shipped models against their DH tables, (2.65), and the fitted links of the Comau."""

import numpy as np
import pytest
from pydrake.math import RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    JacobianWrtVariable,
    MultibodyForces,
    RevoluteSpring,
)

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters

COMAU = load_parameters("comau_racer_1_4")
ROBOTS = {
    variant.name: robot
    for robot in (COMAU, load_parameters("franka_emika_panda"))
    for variant in robot.variants
}
VARIANTS = {variant.name: variant for robot in ROBOTS.values() for variant in robot.variants}
ELASTIC = [name for name, variant in VARIANTS.items() if variant.elasticity]
RIGID = ["comau_racer_1_4", "franka_emika_panda"]
GRAVITY = 9.81

# The consistent link set once more, as it came out of the fit: frame i fixed to link i with z_i the
# axis of joint i (not i + 1 as in the DH convention). Per link: mass, center of mass, inertia about
# it (xx, yy, zz, xy, xz, yz).
FITTED_LINKS = [
    (50.98078, [0, 0, 0.3749977], [2.039231, 2.039231, 0.3828189, 0, 0, 0]),
    (
        37.39042,
        [0.1072963, -0.01057852, 0.08320182],
        [5.375454, 8.477043, 6.712613, -1.366341, -1.045347, 1.834671],
    ),
    (
        33.54031,
        [0.0829193, -0.142999, -0.007131464],
        [3.706966, 2.150137, 1.841581, -0.1585083, 0.4170672, -0.1963752],
    ),
    (
        4.70154,
        [-0.008455536, 0.002488053, 0.0362748],
        [0.5977699, 0.5885673, 0.06407027, 0.02708542, -0.01470243, -0.003594248],
    ),
    (
        1.672058,
        [0.01962023, -0.02515233, 0.0706409],
        [0.01672911, 0.02220155, 0.01021584, 0.0002293933, 0.003572435, 0.004379544],
    ),
    (
        0.419632,
        [-0.01454639, -0.02458567, 0.001285633],
        [0.0001306099, 0.0001475131, 0.000139242, -3.619456e-06, 1.261144e-05, 2.586848e-06],
    ),
]
# Origin of frame i in frame i - 1 [m] and twist about its x: base, shoulder, elbow, end of the
# forearm at the elbow, wrist centre (twice).
FITTED_ORIGINS = [[0, 0, 0], [0.15, 0, 0.43], [0.59, 0, 0], [0.13, 0, 0], [0, 0, 0.684], [0, 0, 0]]
FITTED_TWISTS_DEG = [0, 90, 0, 90, -90, 90]


def make_plant(name: str, time_step: float = 0.0) -> MultibodyPlant:
    plant = MultibodyPlant(time_step)
    Parser(plant).AddModels(str(resolve_model(name)))
    plant.Finalize()
    return plant


def random_state(axes: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, axes), rng.uniform(-4, 4, axes), rng.uniform(-20, 20, axes)


def set_joints(plant, context, prefix: str, q: np.ndarray, v: np.ndarray) -> None:
    for i in range(len(q)):
        joint = plant.GetJointByName(f"{prefix}_{i + 1}")
        joint.set_angle(context, q[i])
        joint.set_angular_rate(context, v[i])


def velocity_rows(plant, prefix: str, axes: int) -> list[int]:
    names = [f"{prefix}_{i + 1}" for i in range(axes)]
    return [plant.GetJointByName(name).velocity_start() for name in names]


def symmetric(inertia) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def skew(p: np.ndarray) -> np.ndarray:
    return np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0.0]])


def fitted_inverse_dynamics(q, v, a) -> np.ndarray:
    """Newton-Euler of the fitted links with the tool, independent of Drake and of the DH frames."""
    z = np.array([0.0, 0.0, 1.0])
    omega, alpha, acc = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, GRAVITY])
    X_PL, forces = [], []
    for i, (mass, com, inertia) in enumerate(FITTED_LINKS):
        twist = RotationMatrix.MakeXRotation(np.deg2rad(FITTED_TWISTS_DEG[i]))
        R = (twist @ RotationMatrix.MakeZRotation(q[i])).matrix()
        p = np.array(FITTED_ORIGINS[i], dtype=float)
        acc = R.T @ (acc + np.cross(alpha, p) + np.cross(omega, np.cross(omega, p)))
        omega_P = R.T @ omega
        omega = omega_P + v[i] * z
        alpha = R.T @ alpha + a[i] * z + np.cross(omega_P, v[i] * z)
        bodies = [(mass, np.array(com), symmetric(inertia))]
        if i == 5:  # the flange is d_6 in front of the wrist centre
            flange = np.array([0, 0, COMAU.denavit_hartenberg.d[5]])
            tool = COMAU.tool
            bodies.append((tool.mass, flange + tool.center_of_mass, tool.inertia_matrix()))
        force, moment = np.zeros(3), np.zeros(3)
        for m, c, inertia_c in bodies:
            a_c = acc + np.cross(alpha, c) + np.cross(omega, np.cross(omega, c))
            force += m * a_c
            moment += inertia_c @ alpha + np.cross(omega, inertia_c @ omega) + np.cross(c, m * a_c)
        X_PL.append((R, p))
        forces.append((force, moment))
    tau = np.zeros(6)
    force, moment = np.zeros(3), np.zeros(3)
    for i in reversed(range(6)):
        force, moment = forces[i][0] + force, forces[i][1] + moment
        tau[i] = moment[2]
        R, p = X_PL[i]
        force, moment = R @ force, R @ moment + np.cross(p, R @ force)
    return tau


@pytest.mark.slow(
    but=[
        "0-comau_racer_1_4",
        "1-comau_racer_1_4_elastic",
        "2-comau_racer_1_4_3r",
        "0-comau_racer_1_4_elastic_3r",
        "1-franka_emika_panda",
        "2-franka_emika_panda_elastic",
    ]
)
@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("seed", range(3))
def test_kinematics_are_those_of_the_dh_table(name, seed):
    robot, variant = ROBOTS[name], VARIANTS[name]
    table = robot.denavit_hartenberg.table()
    plant = make_plant(name)
    context = plant.CreateDefaultContext()
    axes = table.axes - variant.fixed_deg.size
    q_J, _, _ = random_state(axes, seed)
    if variant.elasticity:
        flex = np.random.default_rng(seed + 100).uniform(-0.5, 0.5, axes)
        set_joints(plant, context, "motor", q_J - flex, np.zeros(axes))
        set_joints(plant, context, "flex", flex, np.zeros(axes))
    else:
        set_joints(plant, context, "joint", q_J, np.zeros(axes))
    q = np.concatenate([q_J, np.deg2rad(variant.fixed_deg)])
    for i, H in enumerate(table.link_poses(q)):
        body = plant.GetBodyByName(f"link_{i}" if i else "base")
        X_WB = body.EvalPoseInWorld(context)
        np.testing.assert_allclose(X_WB.GetAsMatrix4(), H, atol=1e-12)
    y_t, R_e = table.pose(q, robot.tool.tool_point)
    X_WT = plant.GetFrameByName("tool_point").CalcPoseInWorld(context)
    np.testing.assert_allclose(X_WT.translation(), y_t, atol=1e-12)
    np.testing.assert_allclose(X_WT.rotation().matrix(), R_e, atol=1e-12)


@pytest.mark.parametrize("name", RIGID)
def test_mass_properties_are_those_of_the_parameters(name):
    plant, robot = make_plant(name), ROBOTS[name]
    for body in [*robot.links, robot.tool]:
        M = plant.GetBodyByName(body.name).default_spatial_inertia()
        assert M.get_mass() == pytest.approx(body.mass, rel=1e-12)
        np.testing.assert_allclose(M.get_com(), body.center_of_mass, atol=1e-12)
        I_c = M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        np.testing.assert_allclose(I_c, body.inertia_matrix(), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_rigid_inverse_dynamics_are_those_of_the_fitted_links(seed):
    plant = make_plant("comau_racer_1_4")
    context = plant.CreateDefaultContext()
    q, v, a = random_state(6, seed)
    set_joints(plant, context, "joint", q, v)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    tau = plant.CalcInverseDynamics(context, a, forces)
    expected = fitted_inverse_dynamics(q, v, a) + COMAU.rotors.reflected_inertia * a
    np.testing.assert_allclose(tau, expected, atol=1e-9)


@pytest.mark.parametrize("name", VARIANTS)
def test_drives_have_reflected_inertia_and_limits(name):
    plant = make_plant(name)
    robot, variant = ROBOTS[name], VARIANTS[name]
    limits, D_M = robot.joint_limits, robot.rotors.reflected_inertia
    axes = len(robot.links) - variant.fixed_deg.size
    prefix = "motor" if variant.elasticity else "joint"
    assert plant.num_actuators() == axes
    for i in range(axes):
        actuator = plant.GetJointActuatorByName(f"{prefix}_{i + 1}")
        joint = actuator.joint()
        assert actuator.default_reflected_inertia() == pytest.approx(D_M[i], rel=1e-12)
        assert actuator.effort_limit() == limits.effort[i]
        assert joint.position_lower_limit() == pytest.approx(limits.position_lower[i], rel=1e-15)
        assert joint.position_upper_limit() == pytest.approx(limits.position_upper[i], rel=1e-15)
        assert joint.velocity_upper_limits()[0] == pytest.approx(limits.velocity[i], rel=1e-15)
        assert joint.acceleration_upper_limits()[0] == pytest.approx(limits.acceleration[i])
        assert joint.default_damping() == 0.0


@pytest.mark.parametrize("name", ELASTIC)
def test_flexible_joints_have_springs_dampers_and_no_limits(name):
    plant = make_plant(name)
    elasticity = ROBOTS[name].elasticities[VARIANTS[name].elasticity]
    springs = {}
    for index in range(plant.num_force_elements()):
        element = plant.get_force_element(ForceElementIndex(index))
        if isinstance(element, RevoluteSpring):
            springs[element.joint().name()] = element
    assert sorted(springs) == [f"flex_{i + 1}" for i in range(elasticity.stiffness.size)]
    for i in range(elasticity.stiffness.size):
        spring = springs[f"flex_{i + 1}"]
        assert spring.default_stiffness() == elasticity.stiffness[i]
        assert spring.default_nominal_angle() == 0.0
        assert spring.joint().default_damping() == elasticity.damping[i]
        assert np.isinf(spring.joint().position_upper_limit())


@pytest.mark.slow(
    but=[
        "0-comau_racer_1_4_elastic_3r",
        "1-comau_racer_1_4_elastic",
        "2-franka_emika_panda_elastic",
    ]
)
@pytest.mark.parametrize("elastic", ELASTIC)
@pytest.mark.parametrize("seed", range(3))
def test_elastic_plant_obeys_the_equations_of_elastic_joints(elastic, seed):
    """(2.65) with (2.67): D_E and n_E are those of the rigid plant without rotors."""
    plant, rigid_plant = make_plant(elastic), make_plant(elastic.replace("_elastic", ""))
    context, rigid_context = plant.CreateDefaultContext(), rigid_plant.CreateDefaultContext()
    n = rigid_plant.num_positions()
    robot = ROBOTS[elastic]
    K_s = robot.elasticities[VARIANTS[elastic].elasticity].stiffness
    D_M = robot.rotors.reflected_inertia[:n]
    q_J, v_J, _ = random_state(n, seed)
    rng = np.random.default_rng(seed + 50)
    q_M, v_M = q_J + rng.uniform(-0.02, 0.02, n), v_J + rng.uniform(-1, 1, n)
    set_joints(plant, context, "motor", q_M, v_M)
    set_joints(plant, context, "flex", q_J - q_M, v_J - v_M)
    set_joints(rigid_plant, rigid_context, "joint", q_J, v_J)

    D_E = rigid_plant.CalcMassMatrix(rigid_context) - np.diag(D_M)
    gravity = rigid_plant.CalcGravityGeneralizedForces(rigid_context)
    n_E = rigid_plant.CalcBiasTerm(rigid_context) - gravity
    # velocities in the order (v_M, v_flex), v_J = v_M + v_flex
    rows = velocity_rows(plant, "motor", n) + velocity_rows(plant, "flex", n)
    M = plant.CalcMassMatrix(context)[np.ix_(rows, rows)]
    expected = np.block([[D_E + np.diag(D_M), D_E], [D_E, D_E]])
    np.testing.assert_allclose(M, expected, atol=1e-9)

    tau_d = rng.uniform(-1, 1, n) * robot.joint_limits.effort[:n]
    plant.get_actuation_input_port().FixValue(context, tau_d)
    tau_J = K_s * (q_M - q_J)
    a_J = np.linalg.solve(D_E, tau_J - n_E)
    a_M = (tau_d - tau_J) / D_M
    # What is left of (2.65) for the accelerations that Drake finds
    acceleration = plant.get_generalized_acceleration_output_port().Eval(context)[rows]
    found_a_M, found_a_J = acceleration[:n], acceleration[:n] + acceleration[n:]
    residual = D_E @ found_a_J + n_E - tau_J
    np.testing.assert_allclose(residual, 0.0, atol=1e-9 * np.abs(tau_J).max())
    np.testing.assert_allclose(found_a_M, a_M, rtol=1e-9)
    np.testing.assert_allclose(found_a_J, a_J, rtol=1e-9, atol=1e-9 * np.abs(a_J).max())


@pytest.mark.parametrize("name", RIGID)
def test_rotor_bodies_do_not_change_the_mass(name):
    rigid, elastic = make_plant(name), make_plant(f"{name}_elastic")
    masses = [p.CalcTotalMass(p.CreateDefaultContext()) for p in (rigid, elastic)]
    # the first rotor stands on the base, whose mass is not modelled
    assert masses[1] - masses[0] == pytest.approx(ROBOTS[name].rotors.body_mass, rel=1e-6)


@pytest.mark.parametrize("name", ["comau_racer_1_4_3r", "comau_racer_1_4_elastic_3r"])
def test_3r_arm_follows_the_bent_lemniscate(name):
    """(3.87): within the limits, elbow up, condition of the position Jacobian below 15."""
    theta_5, dh = np.deg2rad(VARIANTS[name].fixed_deg[1]), COMAU.denavit_hartenberg
    lower, upper = COMAU.joint_limits.position_lower[:3], COMAU.joint_limits.position_upper[:3]
    plant = make_plant("comau_racer_1_4_3r")
    context = plant.CreateDefaultContext()
    tool_point, world = plant.GetFrameByName("tool_point"), plant.world_frame()
    q = np.deg2rad([15.0, 110.0, -10.0])
    conditions = []
    for theta in np.linspace(0, 2 * np.pi, 200):
        sigma = [
            0.25 * np.cos(theta) + 0.7,
            0.25 * np.sin(theta) * np.cos(theta) + 0.2,
            0.1 * np.sin(theta) ** 2 + 1.103,
        ]
        for _ in range(20):  # Newton, warm started from the last point
            plant.SetPositions(context, q)
            J = plant.CalcJacobianTranslationalVelocity(
                context, JacobianWrtVariable.kV, tool_point, np.zeros(3), world, world
            )
            miss = sigma - tool_point.CalcPoseInWorld(context).translation()
            if np.abs(miss).max() < 1e-12:
                break
            q = q + np.linalg.solve(J, miss)
        np.testing.assert_allclose(miss, 0.0, atol=1e-11)
        assert np.all((q > lower + np.deg2rad(30)) & (q < upper - np.deg2rad(30)))
        forearm = dh.d[3] + 0.22 * np.cos(theta_5), dh.a[2] + 0.22 * np.sin(theta_5)
        bend = q[2] + np.arctan2(forearm[1], forearm[0])
        assert -np.pi / 2 < bend < np.pi / 2  # elbow up, (2.10c)
        conditions.append(np.linalg.cond(J))
    assert max(conditions) < 3.5
