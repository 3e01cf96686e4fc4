"""The full model (2.62)-(2.64) against Drake's bodies, finite differences and its own structure."""

import casadi as ca
import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.robot_model import bias_torque
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.newton_euler import mass_matrix
from pfsc_drake.robot.serial.rotor_coupling import (
    RotorMount,
    coupling_matrices,
    full_dynamics_function,
    full_energy_function,
    full_mass_matrix_function,
    mounts_from_dh,
    rotor_momentum,
)

# Tab. 2.3: carrying link and last column of R_i^{M,j}, in DH frame i; rotor 1 about z_0, assumed
LINKS = [1, 1, 3, 3, 4, 5]
AXES = np.array([[0, 1, 0], [0, 0, -1], [0, -1, 0], [0, 0, 1], [0, 1, 0], [0, 1, 0]], dtype=float)
ROTORS = load_parameters("comau_racer_1_4").rotors
ALPHA = np.deg2rad(load_parameters("comau_racer_1_4").denavit_hartenberg.alpha_deg)
MOUNTS = mounts_from_dh(LINKS, AXES, ROTORS.gear_ratio, ALPHA)
N = 6


def load(model="comau_racer_1_4_elastic"):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(model)))
    plant.Finalize()
    return plant, *chain_from_plant(plant, plant.GetFrameByName("tool_point"))


@pytest.fixture(scope="module")
def robot():
    return load()


@pytest.fixture(scope="module")
def matrices(robot):
    """Return ``U, C_1, C_2`` as a function of ``q_J, v_J``."""
    q, v = ca.SX.sym("q", N), ca.SX.sym("v", N)
    function = ca.Function("UC", [q, v], list(coupling_matrices(robot[1], MOUNTS, q, v)))
    return lambda q, v: [np.array(m) for m in function(q, v)]


def states(count=10, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        q_J, v_J, v_M = rng.uniform(-1.5, 1.5, (3, N))
        yield q_J, v_J, q_J + rng.uniform(-1e-3, 1e-3, N), v_M


def test_kinetic_energy_of_drakes_rotors(robot):
    """(2.62): the links' bodies in Drake, with spinning rotors added to each by hand."""
    plant, chain, coordinates = robot
    context = plant.CreateDefaultContext()
    momentum_of = full_energy_function(chain, MOUNTS)
    for q_J, v_J, q_M, v_M in states():
        plant.SetPositionsAndVelocities(
            context, coordinates.plant_state(np.concatenate([q_J, v_J, q_M, v_M]))
        )
        expected = plant.EvalKineticEnergy(context)
        for j in range(N):
            body = plant.GetBodyByName(f"link_{LINKS[j]}")
            V: SpatialVelocity = body.EvalSpatialVelocityInWorld(context)
            axis = body.EvalPoseInWorld(context).rotation().matrix() @ AXES[j]
            spin = ROTORS.gear_ratio[j] * v_M[j]
            expected += ROTORS.inertia[j] * spin * axis @ V.rotational()
        got, _ = momentum_of(np.concatenate([q_J, q_M, v_J, v_M]))
        # the plant's energy already holds D_M: the reflected rotors
        assert np.isclose(float(got), expected, rtol=1e-6, atol=0)


def test_equals_drakes_elastic_plant_without_coupling(robot):
    """Infinite gears at the same ``D_M``: (2.65)."""
    plant, chain, coordinates = robot
    uncoupled = [RotorMount(m.link, m.axis, np.inf) for m in MOUNTS]
    accelerations = full_dynamics_function(chain, uncoupled)
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(3)
    for q_J, v_J, q_M, v_M in states():
        tau_d = rng.uniform(-50.0, 50.0, N)
        plant.SetPositionsAndVelocities(
            context, coordinates.plant_state(np.concatenate([q_J, v_J, q_M, v_M]))
        )
        actuation = np.zeros(N)
        actuation[coordinates.actuators] = tau_d
        plant.get_actuation_input_port().FixValue(context, actuation)
        rates = plant.EvalTimeDerivatives(context).CopyToVector()
        expected = np.concatenate(
            [(coordinates.link_rows @ rates)[N:], (coordinates.motor_rows @ rates)[N:]]
        )
        state = np.concatenate([q_J, q_M, v_J, v_M])
        got = np.array(accelerations(state, tau_d, np.zeros(N))).ravel()
        assert np.allclose(got, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


def test_mass_matrix_is_symmetric_positive_definite(robot):
    _, chain, _ = robot
    D_of = full_mass_matrix_function(chain, MOUNTS)
    for q_J, *_ in states(50):
        D = np.array(D_of(q_J))
        assert np.array_equal(D, D.T)
        assert np.linalg.eigvalsh(D)[0] > 1e-3
        assert np.allclose(np.diag(D)[N:], ROTORS.reflected_inertia, rtol=1e-6)


def test_coupling_is_upper_triangular(matrices):
    """On the diagonal only the rotors that sit on the link they drive: 1 and 3."""
    for q_J, v_J, *_ in states():
        U = matrices(q_J, v_J)[0]
        assert np.array_equal(U, np.triu(U))
        own = np.zeros(N)
        own[[0, 2]] = (ROTORS.inertia * ROTORS.gear_ratio)[[0, 2]] * [1.0, -1.0]
        assert np.allclose(np.diag(U), own, rtol=1e-6, atol=1e-15)


def test_rotors_on_the_link_before_couple_strictly_upper(robot):
    """The usual arrangement, motor j on link j - 1; the base does not turn."""
    _, chain, _ = robot
    mounts = [RotorMount(j, np.array([0.6, 0.0, 0.8]), 50.0) for j in range(N)]
    q, v = ca.SX.sym("q", N), ca.SX.sym("v", N)
    U_of = ca.Function("U", [q], [ca.jacobian(rotor_momentum(chain, mounts, q, v), v).T])
    for q_J, *_ in states():
        U = np.array(U_of(q_J))
        assert np.array_equal(U, np.triu(U, 1))
        assert np.count_nonzero(U) > 10


def test_coriolis_matrices_by_finite_differences(robot, matrices):
    """Lagrange's equations for ``v_J' U(q_J) v_M`` with central differences of U."""
    h = 1e-6
    for q_J, v_J, _, v_M in states(5):
        _, C_1, C_2 = matrices(q_J, v_J)
        slopes = np.array(
            [
                (matrices(q_J + h * e, v_J)[0] - matrices(q_J - h * e, v_J)[0]) / (2.0 * h)
                for e in np.eye(N)
            ]
        )
        U_rate = np.einsum("i,ijk->jk", v_J, slopes)
        on_links = U_rate @ v_M - np.einsum("ijk,j,k->i", slopes, v_J, v_M)
        assert np.allclose(C_1 @ v_M, on_links, rtol=0, atol=1e-9)
        assert np.allclose(C_2 @ v_J, U_rate.T @ v_J, rtol=0, atol=1e-9)


def test_accelerations_solve_the_equations_of_motion(robot, matrices):
    """(2.64) written out with all its matrices."""
    _, chain, _ = robot
    q, v = ca.SX.sym("q", N), ca.SX.sym("v", N)
    link_side = ca.Function("l", [q, v], [mass_matrix(chain, q), bias_torque(chain, q, v)])
    accelerations = full_dynamics_function(chain, MOUNTS)
    rng = np.random.default_rng(4)
    for q_J, v_J, q_M, v_M in states():
        tau_d, tau_ext = rng.uniform(-50.0, 50.0, (2, N))
        state = np.concatenate([q_J, q_M, v_J, v_M])
        a_J, a_M = np.array(accelerations(state, tau_d, tau_ext)).reshape(2, N)
        U, C_1, C_2 = matrices(q_J, v_J)
        D_E, n_E = (np.array(m) for m in link_side(q_J, v_J))
        tau_J = chain.K_s * (q_M - q_J) + chain.K_d * (v_M - v_J)
        links = D_E @ a_J + U @ a_M + n_E.ravel() + C_1 @ v_M - tau_J - tau_ext
        motors = U.T @ a_J + chain.D_M * a_M + C_2 @ v_J - tau_d + tau_J
        assert np.max(np.abs(np.concatenate([links, motors]))) < 1e-8


def test_full_model_differs(robot):
    """The coupling is not nothing: a few percent of an acceleration."""
    _, chain, _ = robot
    uncoupled = [RotorMount(m.link, m.axis, np.inf) for m in MOUNTS]
    state = np.concatenate([*[np.full(N, 0.3)] * 2, np.zeros(2 * N)])
    with_it, without = (
        np.array(full_dynamics_function(chain, m)(state, np.full(N, 20.0), np.zeros(N))).ravel()
        for m in (MOUNTS, uncoupled)
    )
    assert np.max(np.abs(with_it - without)) > 1e-3 * np.max(np.abs(without))


@pytest.mark.parametrize(
    ("position", "mount", "named"),
    [
        (1, RotorMount(7, AXES[0], 50.0), r"rotor 2: link = 7; must be 0 \(base\) to 6"),
        (0, RotorMount(1, np.array([0.0, 2.0, 0.0]), 50.0), r"rotor 1: axis = \[0.0, 2.0, 0.0\]"),
        (5, RotorMount(1, AXES[0], 0.0), "rotor 6: gear_ratio = 0.0; must not be 0"),
        (5, RotorMount(1, AXES[0], np.nan), "rotor 6: gear_ratio = nan"),
    ],
)
def test_wrong_mounts(robot, position, mount, named):
    mounts = list(MOUNTS)
    mounts[position] = mount
    with pytest.raises(InputError, match=named) as error:
        full_mass_matrix_function(robot[1], mounts)
    assert "\n" not in str(error.value)


def test_wrong_robot(robot):
    with pytest.raises(InputError, match="5 mounts given; the robot has 6 joints"):
        full_energy_function(robot[1], MOUNTS[:5])
    _, rigid, _ = load("comau_racer_1_4")
    with pytest.raises(InputError, match="must have finite stiffness"):
        full_dynamics_function(rigid, MOUNTS)
