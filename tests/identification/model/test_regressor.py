"""The regression matrix against Drake, against energies and against the laws' own dynamics."""

import time
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject, load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.robot.serial.rotor_coupling import coupling_matrices, full_energy_function

ARMS = ["comau_racer_1_4", "franka_emika_panda"]


def random_motion(dimension, samples=20, seed=0):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (3, samples, dimension))


@pytest.mark.parametrize("robot", ARMS)
def test_torques_of_drakes_inverse_dynamics(robot):
    """With the tool, as in the model file; Drake's torques hold the rotors' own inertia."""
    subject = load_subject(robot, tool=True)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(robot)))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    regressor = Regressor(subject, friction=False, coupling=False)
    motion = random_motion(subject.dimension)
    got = regressor.matrix(*motion) @ true_parameters(subject, friction=False)
    for q, v, a, tau in zip(*motion, got, strict=True):
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        expected = plant.CalcInverseDynamics(context, a, forces)
        np.testing.assert_allclose(tau, expected, rtol=1e-9, atol=1e-6)


def test_torques_of_coupled_rotors(comau):
    """(2.64) with stiff joints: what motors and links feel, together."""
    n, chain = comau.dimension, comau.chain
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    matrices = ca.Function("UC", [q, v], coupling_matrices(chain, comau.mounts, q, v))
    motion = random_motion(n)
    rotors = slice(10 * n, 11 * n)
    Y = Regressor(comau).matrix(*motion) - Regressor(comau, coupling=False).matrix(*motion)
    np.testing.assert_array_equal(np.delete(Y, np.r_[rotors], axis=2), 0.0)
    got = Y @ true_parameters(comau)
    for q, v, a, tau in zip(*motion, got, strict=True):
        U, C_1, C_2 = (np.array(matrix) for matrix in matrices(q, v))
        np.testing.assert_allclose(tau, (U + U.T) @ a + (C_1 + C_2) @ v, rtol=1e-9, atol=1e-9)


def test_torques_are_what_changes_the_energy(comau):
    """Power of all torques against the energy (2.63) of the full model, by finite differences."""
    # unbent springs, whatever their stiffness
    links = tuple(replace(link, stiffness=1.0) for link in comau.chain.links)
    energy = full_energy_function(replace(comau.chain, links=links), comau.mounts)
    regressor = Regressor(comau, friction=False)
    rho = true_parameters(comau, friction=False)
    step = 1e-5
    for q, v, a in zip(*random_motion(comau.dimension, samples=5), strict=True):

        def total(t, q=q, v=v, a=a):
            q_t, v_t = q + t * v + t**2 / 2 * a, v + t * a
            return sum(float(part) for part in energy(np.concatenate([q_t, q_t, v_t, v_t])))

        power = (total(step) - total(-step)) / (2 * step)
        tau = regressor.matrix(q[None], v[None], a[None])[0] @ rho
        assert tau @ v == pytest.approx(power, rel=1e-7, abs=1e-5)


def test_slides_and_slanted_axes():
    """A chain of random poses and both kinds of joints, against the laws' inverse dynamics."""
    rng = np.random.default_rng(1)
    links = []
    for i, kind in enumerate(["revolute", "prismatic", "revolute", "prismatic"]):
        axis, (R, _) = rng.normal(size=3), np.linalg.qr(rng.normal(size=(3, 3)))
        R *= np.linalg.det(R)
        box = np.diag(rng.uniform(0.1, 0.2, 3))
        center, mass = rng.normal(size=3), rng.uniform(1.0, 5.0)
        axis /= np.linalg.norm(axis)
        links.append(ChainLink(f"j{i}", kind, R, rng.normal(size=3), axis, mass, center, box))
    chain = SerialChain(tuple(links), gravity=rng.normal(size=3) * 5.0)
    subject = subject_with(chain)
    motion = random_motion(4)
    got = Regressor(subject, friction=False).matrix(*motion) @ true_parameters(subject, False)
    for k, (q, v, a) in enumerate(zip(*motion, strict=True)):
        jets = [Jet.from_derivatives([ca.SX(x) for x in row]) for row in zip(q, v, a, strict=True)]
        expected = [float(tau.coefficients[0]) for tau in chain.inverse_dynamics(jets)]
        np.testing.assert_allclose(got[k], expected, rtol=1e-10, atol=1e-10)


def subject_with(chain):
    n = chain.dimension
    unlimited = np.full(n, np.inf)
    return Subject(
        name="chain",
        chain=chain,
        delta=None,
        mounts=None,
        gear_ratio=np.ones(n),
        position_limits=chain.gather("position_limits"),
        velocity_limit=unlimited,
        acceleration_limit=unlimited,
        effort_limit=unlimited,
        joint_names=list(chain.names),
        joint_units=["rad" if link.is_revolute else "m" for link in chain.links],
        coulomb=None,
        viscous=None,
    )


def test_friction_has_the_sign_of_the_velocity(comau):
    q, v, a = random_motion(6)
    Y = Regressor(comau).matrix(q, v, a)[:, :, -12:]
    np.testing.assert_allclose(Y @ np.tile([1.0, 0.0], 6), np.sign(v))
    np.testing.assert_allclose(Y @ np.tile([0.0, 1.0], 6), v)
    smooth = Regressor(comau, sign_width=0.1).matrix(q, v, a)[:, :, -12:]
    np.testing.assert_allclose(smooth @ np.tile([1.0, 0.0], 6), np.tanh(v / 0.1), rtol=1e-12)


def test_no_torque_on_joints_before_a_rotor_without_coupling(comau):
    Y = Regressor(comau, coupling=False).matrix(*random_motion(6))[:, :, 60:66]
    np.testing.assert_array_equal(Y[:, ~np.eye(6, dtype=bool)], 0.0)


def test_delta_robot(delta):
    rng = np.random.default_rng(2)
    q = rng.uniform(0.1, 0.35, (10, 3))
    v, a = rng.normal(size=(2, 10, 3))
    rho = true_parameters(delta)
    got = Regressor(delta).matrix(q, v, a) @ rho
    for k in range(10):
        rows = zip(q[k], v[k], a[k], strict=True)
        jets = [Jet.from_derivatives([ca.SX(x) for x in row]) for row in rows]
        tau = [float(t.coefficients[0]) for t in delta.delta.inverse_dynamics(jets)]
        expected = tau + delta.coulomb * np.sign(v[k]) + delta.viscous * v[k]
        np.testing.assert_allclose(got[k], expected, rtol=1e-12)


def test_delta_robot_whose_slides_differ_in_mass(delta):
    """By the kinetic energy, the drives' power over a short time."""
    regressor = Regressor(delta, friction=False)
    rho = np.array([1.0, 2.0, 3.0, 1.5])
    q, v, a = np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.4, 0.3]), np.array([1.0, -2.0, 0.5])
    robot, step = delta.delta, 1e-5
    rails = robot.parameters.geometry.rails

    def energy(t):
        q_t, v_t = q + t * v + t**2 / 2 * a, v + t * a
        y = robot.tool_position(q_t)
        y_dot = robot.jacobian_at(q_t) @ v_t
        kinetic = rho[:3] @ v_t**2 / 2 + rho[3] * y_dot @ y_dot / 2
        # slide i is at -q_i c_i
        return kinetic - rho[3] * robot.gravity @ y + rho[:3] * q_t @ (rails @ robot.gravity)

    power = (energy(step) - energy(-step)) / (2 * step)
    tau = regressor.matrix(q[None], v[None], a[None])[0] @ rho
    assert tau @ v == pytest.approx(power, rel=1e-7)


def test_function_and_matrix_agree_whatever_the_number_of_samples(comau):
    regressor = Regressor(comau)
    q, v, a = random_motion(6, samples=1003)
    Y = regressor.matrix(q, v, a)
    assert Y.shape == (1003, 6, 78)
    for k in (0, 499, 500, 1002):
        np.testing.assert_array_equal(Y[k], np.array(regressor.function(q[k], v[k], a[k])))
    assert regressor.matrix(q[:0], v[:0], a[:0]).shape == (0, 6, 78)


@pytest.mark.slow
def test_a_minute_of_samples_takes_seconds(comau):
    regressor = Regressor(comau)
    motion = random_motion(6, samples=40_000)
    start = time.process_time()
    regressor.matrix(*motion)
    assert time.process_time() - start < 4.0


def test_bad_motions_are_refused(comau):
    regressor = Regressor(comau)
    q, v, a = random_motion(6)
    with pytest.raises(InputError, match=r"v: shape \(19, 6\); must be \(K, 6\)"):
        regressor.matrix(q, v[1:], a)
    a[3, 1] = np.nan
    with pytest.raises(InputError, match="a: sample 3, joint 2 is nan"):
        regressor.matrix(q, v, a)
    with pytest.raises(InputError, match="sign_width = -1"):
        Regressor(comau, sign_width=-1.0)


def test_rotors_with_unknown_mounts_do_not_couple(comau):
    unknown = replace(comau, mounts=None)
    motion = random_motion(6)
    np.testing.assert_array_equal(
        Regressor(unknown).matrix(*motion), Regressor(comau, coupling=False).matrix(*motion)
    )
