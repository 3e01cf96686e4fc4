"""What is believed of a chain, against Drake's plant with its own parameters changed."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces, SpatialInertia, UnitInertia

from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain import nominal_chain
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

N = 6


@pytest.fixture(scope="module")
def comau():
    """Return the rigid robot: Drake's plant, its chain, and the tool's mass in it."""
    plant = MultibodyPlant(0.0)
    read_model(plant, resolve_model("comau_racer_1_4"), ModelOptions())
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    context, tool = plant.CreateDefaultContext(), plant.GetBodyByName("tool")
    last = plant.GetJointByName("joint_6").frame_on_child()
    X_LB = plant.CalcRelativeTransform(context, last, tool.body_frame())
    center = X_LB @ tool.CalcCenterOfMassInBodyFrame(context)
    return plant, chain, (tool.get_mass(context), center)


def _torques(chain, q, v, a):
    symbols = [ca.SX.sym(name, chain.dimension) for name in "qva"]
    joints = [Jet.from_derivatives([x[i] for x in symbols]) for i in range(chain.dimension)]
    tau = ca.vertcat(*[t.derivative(0) for t in chain.inverse_dynamics(joints)])
    return np.array(ca.Function("tau", symbols, [tau])(q, v, a)).ravel()


def _drake_torques(plant, context, q, v, a):
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    # the rotors' inertia is no part of the chain's link side
    reflected = [
        plant.get_joint_actuator(i).calc_reflected_inertia(context)
        for i in plant.GetJointActuatorIndices()
    ]
    return plant.CalcInverseDynamics(context, a, forces) - np.array(reflected) * a


def _change(plant, context, name, *, mass=1.0, inertia=1.0, shift=(0.0, 0.0, 0.0), add=0.0):
    """Change a body's parameters in a context; the shift is in its own axes."""
    body = plant.GetBodyByName(name)
    M = body.CalcSpatialInertiaInBodyFrame(context)
    center = M.get_com()
    I_C = M.Shift(center).CalcRotationalInertia().CopyToFullMatrix3() * mass * inertia
    total = M.get_mass() * mass + add
    G = I_C / total
    unit = UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
    about_center = SpatialInertia(total, np.zeros(3), unit)
    body.SetSpatialInertiaInBodyFrame(context, about_center.Shift(-(center + np.array(shift))))


def _state():
    return np.random.default_rng(3).uniform(-1.0, 1.0, (3, N))


def test_masses_and_inertias(comau):
    plant, chain, tool = comau
    mass = np.array([0.9, 1.1, 0.95, 1.3, 0.8, 1.2])
    inertia = np.array([1.1, 0.9, 1.0, 1.2, 1.05, 0.7])
    error = replace(ModelError.none(N), mass=mass, inertia=inertia)
    context = plant.CreateDefaultContext()
    for i in range(N - 1):
        _change(plant, context, f"link_{i + 1}", mass=mass[i], inertia=inertia[i])
    # an inertia about the centre of the last link and its tool together is no sum of their own
    link_6 = replace(error, inertia=np.append(inertia[:-1], 1.0))
    for name in ("link_6", "tool"):
        _change(plant, context, name, mass=mass[-1])
    q, v, a = _state()
    expected = _drake_torques(plant, context, q, v, a)
    np.testing.assert_allclose(
        _torques(nominal_chain(chain, link_6, *tool), q, v, a), expected, rtol=0, atol=1e-9
    )
    last = nominal_chain(chain, error, *tool).links[-1]
    np.testing.assert_allclose(last.I_C, 0.7 * 1.2 * chain.links[-1].I_C, rtol=1e-12)


def test_centres_of_mass(comau):
    plant, chain, tool = comau
    center = np.random.default_rng(1).uniform(-0.02, 0.02, (N, 3))
    center[-1] = 0.0
    context = plant.CreateDefaultContext()
    for i in range(N - 1):
        frame = plant.GetJointByName(f"joint_{i + 1}").frame_on_child()
        body = plant.GetBodyByName(f"link_{i + 1}")
        R_BL = plant.CalcRelativeTransform(context, body.body_frame(), frame).rotation()
        _change(plant, context, f"link_{i + 1}", shift=R_BL @ center[i])
    q, v, a = _state()
    nominal = nominal_chain(chain, replace(ModelError.none(N), center=center), *tool)
    np.testing.assert_allclose(
        _torques(nominal, q, v, a),
        _drake_torques(plant, context, q, v, a),
        rtol=0,
        atol=1e-9,
    )


@pytest.mark.parametrize("added", [-0.5, 0.4])
def test_tool(comau, added):
    plant, chain, tool = comau
    shift = np.array([0.01, -0.02, 0.03])
    error = replace(ModelError.none(N), tool_mass=added, tool_center=shift)
    context = plant.CreateDefaultContext()
    body, point = plant.GetBodyByName("tool"), plant.GetFrameByName("tool_point")
    R_BT = plant.CalcRelativeTransform(context, body.body_frame(), point).rotation()
    # the tool's inertia about its own centre stays
    mass = body.get_mass(context)
    _change(plant, context, "tool", add=added, shift=R_BT @ shift)
    assert body.get_mass(context) == pytest.approx(mass + added)
    q, v, a = _state()
    np.testing.assert_allclose(
        _torques(nominal_chain(chain, error, *tool), q, v, a),
        _drake_torques(plant, context, q, v, a),
        rtol=0,
        atol=1e-9,
    )


def test_joint_offsets(comau):
    plant, chain, tool = comau
    offset = np.deg2rad([1.0, -2.0, 3.0, -4.0, 5.0, -6.0])
    nominal = nominal_chain(chain, replace(ModelError.none(N), joint_offset=offset), *tool)
    q, v, a = _state()
    context = plant.CreateDefaultContext()
    np.testing.assert_allclose(
        _torques(nominal, q, v, a),
        _drake_torques(plant, context, q + offset, v, a),
        rtol=0,
        atol=1e-9,
    )
    X_WT: RigidTransform = plant.GetFrameByName("tool_point").CalcPoseInWorld(context)
    pose = np.array(pose_function(nominal)(q)).ravel()
    np.testing.assert_allclose(pose[:3], X_WT.translation(), atol=1e-12)
    np.testing.assert_allclose(pose[3:], X_WT.rotation().matrix().ravel(), atol=1e-12)


def test_link_lengths(shoulder_and_elbow):
    factor = np.array([1.0, 1.02, 0.97])
    error = replace(ModelError.none(3), link_length=factor)
    nominal = nominal_chain(shoulder_and_elbow, error, 0.0, np.zeros(3))
    q = np.array([0.0, 0.4, -0.9])
    pose = np.array(pose_function(nominal)(q)).ravel()
    upper, fore = 0.7 * 1.02, 0.6 * 0.97
    x = upper * np.cos(0.4) + fore * np.cos(-0.5)
    z = 0.4 - upper * np.sin(0.4) - fore * np.sin(-0.5)
    np.testing.assert_allclose(pose[:3], [x, 0.0, z], atol=1e-12)


def test_slides_are_off_along_their_axis(make_chain):
    chain = make_chain([(np.array([1.0, 0.0, 0.0]), [0, 0, 0])], [0.1, 0, 0], sliding=[0])
    error = replace(ModelError.none(1), joint_offset=np.array([0.02]))
    nominal = nominal_chain(chain, error, 0.0, np.zeros(3))
    assert np.array(pose_function(nominal)([0.3]))[0, 0] == pytest.approx(0.42)


def test_drives(comau):
    _, chain, tool = comau
    error = replace(ModelError.none(N), rotor_inertia=np.full(N, 1.1), stiffness=np.full(N, 0.9))
    soft = replace(
        chain,
        links=tuple(replace(link, stiffness=1e4 * (i + 1)) for i, link in enumerate(chain.links)),
    )
    nominal = nominal_chain(soft, error, *tool)
    np.testing.assert_allclose(nominal.D_M, 1.1 * chain.D_M)
    np.testing.assert_allclose(nominal.K_s, 9e3 * np.arange(1, N + 1))
    assert nominal_chain(chain, error, *tool).is_rigid


@pytest.mark.parametrize("added", [-3.0, -1.6])
def test_a_tool_that_weighs_less_than_nothing(comau, added):
    _, chain, tool = comau
    assert tool[0] < 1.6
    with pytest.raises(InputError, match=r"tool_mass = -.* kg; allowed: more than -1\.\d+ kg"):
        nominal_chain(chain, replace(ModelError.none(N), tool_mass=added), *tool)


def test_a_tool_that_no_body_can_be(comau):
    _, chain, _ = comau
    nowhere = 1.5, np.array([0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="principal moments of inertia unlike"):
        nominal_chain(chain, replace(ModelError.none(N), tool_mass=-1.4), *nowhere)
