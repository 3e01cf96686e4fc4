"""Rigid joints with spinning rotors against Drake's bodies, rotors among them."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia, UnitInertia

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.rigid_rotors import (
    rigid_dynamics_function,
    rigid_mass_matrix,
    rigid_torque_function,
)
from pfsc_drake.robot.serial.rotor_coupling import mounts_from_parameters

N = 6
ROTOR_MASS = 1e-3  # kg


@pytest.fixture(scope="module")
def robot():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    return chain, mounts_from_parameters(chain, load_parameters("comau_racer_1_4"))


def spatial_inertia(mass, center, inertia):
    """About the body's origin, from that about the centre of mass."""
    about = inertia + mass * (center @ center * np.eye(3) - np.outer(center, center))
    I_xx, I_yy, I_zz = np.diag(about) / mass
    unit = UnitInertia(I_xx, I_yy, I_zz, about[0, 1] / mass, about[0, 2] / mass, about[1, 2] / mass)
    return SpatialInertia(mass, center, unit)


def with_rotors_as_bodies(chain, mounts):
    """Return a plant of links that have lost their rotors, and the rotors on bearings.

    A rotor is a ball whose centre is the link's centre of mass.
    """
    plant = MultibodyPlant(0.0)
    rotor_inertia = chain.D_M / np.array([mount.gear_ratio for mount in mounts]) ** 2
    bodies, parent = [], plant.world_frame()
    for i, link in enumerate(chain.links, start=1):
        carried = [j for j, mount in enumerate(mounts) if mount.link == i]
        mass = link.mass - ROTOR_MASS * len(carried)
        inertia = link.I_C - sum(rotor_inertia[j] for j in carried) * np.eye(3)
        body = plant.AddRigidBody(f"link_{i}", spatial_inertia(mass, link.p_LC, inertia))
        fixed = RigidTransform(RotationMatrix(link.R_PF), link.p_PF)
        seat = plant.AddFrame(FixedOffsetFrame(f"seat_{i}", parent, fixed))
        plant.AddJoint(RevoluteJoint(f"joint_{i}", seat, body.body_frame(), link.axis))
        bodies.append(body)
        parent = body.body_frame()
    for j, mount in enumerate(mounts):
        ball = spatial_inertia(ROTOR_MASS, np.zeros(3), rotor_inertia[j] * np.eye(3))
        rotor = plant.AddRigidBody(f"rotor_{j + 1}", ball)
        center = RigidTransform(chain.links[mount.link - 1].p_LC)
        carrier = bodies[mount.link - 1].body_frame()
        seat = plant.AddFrame(FixedOffsetFrame(f"bearing_{j + 1}", carrier, center))
        plant.AddJoint(RevoluteJoint(f"spin_{j + 1}", seat, rotor.body_frame(), mount.axis))
    plant.mutable_gravity_field().set_gravity_vector(chain.gravity)
    plant.Finalize()
    return plant


def test_torques_of_links_and_rotors_as_bodies(robot):
    """``tau = N' ID(N q, N v, N a)`` with ``N`` from joints to joints and rotors."""
    chain, mounts = robot
    plant = with_rotors_as_bodies(chain, mounts)
    context = plant.CreateDefaultContext()
    gears = np.zeros((plant.num_velocities(), N))
    for j, mount in enumerate(mounts):
        gears[plant.GetJointByName(f"joint_{j + 1}").velocity_start(), j] = 1.0
        gears[plant.GetJointByName(f"spin_{j + 1}").velocity_start(), j] = mount.gear_ratio
    torque = rigid_torque_function(chain, mounts)
    dynamics = rigid_dynamics_function(chain, mounts)
    for q, v, a in np.random.default_rng(0).uniform(-2.0, 2.0, (10, 3, N)):
        plant.SetPositions(context, gears @ q)
        plant.SetVelocities(context, gears @ v)
        M, bias = plant.CalcMassMatrix(context), plant.CalcBiasTerm(context)
        load = M @ gears @ a + bias - plant.CalcGravityGeneralizedForces(context)
        expected = gears.T @ load
        scale = np.abs(expected).max()
        np.testing.assert_allclose(torque(q, v, a).full().ravel(), expected, atol=1e-9 * scale)
        got = dynamics(np.append(q, v), expected).full().ravel()
        np.testing.assert_allclose(got, a, rtol=1e-7, atol=1e-7)


def test_the_coupling_is_no_small_thing(robot):
    """A missing or turned term would show in the comparison above."""
    chain, mounts = robot
    q = ca.SX.sym("q", N)
    parts = [rigid_mass_matrix(chain, m, q) for m in (mounts, None)]
    D, plain = (np.array(D) for D in ca.Function("D", [q], parts)(np.linspace(0.2, 1.2, N)))
    assert np.abs(D - plain).max() > 0.02
    np.testing.assert_allclose(D, D.T, atol=1e-12)


def test_mounts_of_another_robot(robot):
    chain, mounts = robot
    with pytest.raises(InputError, match="5 mounts given; the robot has 6 joints"):
        rigid_torque_function(chain, mounts[:5])
    wrong = [replace(mounts[0], link=9), *mounts[1:]]
    with pytest.raises(InputError, match="link = 9"):
        rigid_dynamics_function(chain, wrong)
