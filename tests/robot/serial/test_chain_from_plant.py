"""Extraction of elastic chains, their coordinates, and what is refused."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    SpatialInertia,
    UnitInertia,
)

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant, state_at_rest


def solid(mass):
    return SpatialInertia(mass, np.zeros(3), UnitInertia.SolidBox(0.3, 0.2, 0.4))


class ElasticPair:
    """A plant with one elastic joint; every argument can break it."""

    def __init__(
        self,
        joint_type=RevoluteJoint,
        flex_type=None,
        rotor_mass=1e-6,
        flex_axis=(0.0, 0.0, 1.0),
        flex_pose=None,
        rest=0.0,
    ):
        self.plant = plant = MultibodyPlant(0.0)
        rotor = plant.AddRigidBody(
            "rotor", SpatialInertia(rotor_mass, np.zeros(3), UnitInertia(0.01, 0.01, 0.01))
        )
        self.link = link = plant.AddRigidBody("link", solid(3.0))
        base = RigidTransform(RollPitchYaw(0.3, -0.2, 0.5), [0.1, 0.2, 0.3])
        frame = plant.AddFrame(FixedOffsetFrame("base", plant.world_frame(), base))
        motor = plant.AddJoint(joint_type("motor", frame, rotor.body_frame(), [0.0, 0.0, 1.0]))
        inboard = rotor.body_frame()
        if flex_pose is not None:
            inboard = plant.AddFrame(FixedOffsetFrame("inboard", inboard, flex_pose))
        kind = flex_type or joint_type
        flex = plant.AddJoint(kind("flex", inboard, link.body_frame(), np.array(flex_axis)))
        flex.set_default_damping(4.0)
        spring = RevoluteSpring if kind is RevoluteJoint else PrismaticSpring
        plant.AddForceElement(spring(flex, rest, 7000.0))
        actuator = plant.AddJointActuator("drive", motor, effort_limit=55.0)
        actuator.set_default_rotor_inertia(2e-4)
        actuator.set_default_gear_ratio(60.0)
        plant.Finalize()

    def extract(self):
        return chain_from_plant(self.plant, self.link.body_frame())


@pytest.mark.parametrize("joint_type", [RevoluteJoint, PrismaticJoint])
def test_motor_and_flex_joint_become_one_elastic_joint(joint_type):
    # along the axis the flex joint may be displaced
    pair = ElasticPair(joint_type, flex_pose=RigidTransform([0.0, 0.0, 0.15]))
    chain, coordinates = pair.extract()
    (link,) = chain.links
    assert chain.is_elastic
    assert (link.stiffness, link.damping, link.effort_limit) == (7000.0, 4.0, 55.0)
    assert link.reflected_inertia == pytest.approx(2e-4 * 3600.0, rel=1e-12)
    # the rotor belongs to the previous link
    assert link.mass == pytest.approx(3.0, rel=1e-12)
    plant, context = pair.plant, pair.plant.CreateDefaultContext()
    X_WL = plant.EvalBodyPoseInWorld(context, pair.link)
    assert np.allclose(link.p_PF, X_WL.translation(), rtol=0, atol=1e-12)
    assert np.allclose(link.R_PF, X_WL.rotation().matrix(), rtol=0, atol=1e-12)

    motor, flex = (plant.GetJointByName(name) for name in ("motor", "flex"))
    x = np.zeros(4)
    x[[motor.position_start(), flex.position_start()]] = [0.5, 0.01]
    x[[2 + motor.velocity_start(), 2 + flex.velocity_start()]] = [-0.7, 0.02]
    assert np.allclose(coordinates.link_rows @ x, [0.51, -0.68], rtol=0, atol=1e-15)
    assert np.allclose(coordinates.motor_rows @ x, [0.5, -0.7], rtol=0, atol=1e-15)
    assert coordinates.actuators.tolist() == [0]
    assert coordinates.num_states == 4


@pytest.mark.parametrize(
    "broken",
    [
        {"rotor_mass": 0.5},
        {"flex_axis": (0.0, 0.6, 0.8)},
        {"flex_type": PrismaticJoint},
        {"flex_pose": RigidTransform([0.05, 0.0, 0.0])},
        {"flex_pose": RigidTransform(RollPitchYaw(0.0, 0.0, 0.4), np.zeros(3))},
    ],
)
def test_pairs_that_are_no_elastic_joint_are_refused(broken):
    with pytest.raises(InputError, match=r"joints 'motor' and 'flex'.*coaxial"):
        ElasticPair(**broken).extract()


@pytest.mark.parametrize("joint_type", [RevoluteJoint, PrismaticJoint])
def test_a_spring_that_does_not_rest_at_zero_is_refused(joint_type):
    with pytest.raises(InputError, match=r"joint 'flex': spring rests at 0.1"):
        ElasticPair(joint_type, rest=0.1).extract()


def test_a_spring_without_motor_is_refused():
    plant = MultibodyPlant(0.0)
    link = plant.AddRigidBody("link", solid(1.0))
    joint = plant.AddJoint(
        RevoluteJoint("hinge", plant.world_frame(), link.body_frame(), [1, 0, 0])
    )
    plant.AddForceElement(RevoluteSpring(joint, 0.0, 100.0))
    plant.Finalize()
    with pytest.raises(InputError, match=r"joint 'hinge': has a spring but no coaxial motor"):
        chain_from_plant(plant, link.body_frame())


class Pendulum:
    """Two hinges without actuators, and a box that floats; arguments change the plant."""

    def __init__(self, *actuators):
        self.plant = plant = MultibodyPlant(0.0)
        parent, box = plant.world_body(), plant.AddRigidBody("box", solid(1.0))
        self.X_WB = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [1.0, -2.0, 3.0])
        plant.SetDefaultFloatingBaseBodyPose(box, self.X_WB)
        for name in ("first", "second"):
            link = plant.AddRigidBody(name, solid(2.0))
            frames = plant.AddFrame(
                FixedOffsetFrame(f"{name}_at", parent.body_frame(), RigidTransform([0.3, 0.0, 0.0]))
            )
            plant.AddJoint(RevoluteJoint(name, frames, link.body_frame(), [0.0, 1.0, 0.0]))
            parent = link
        for number, name in enumerate(actuators):
            plant.AddJointActuator(f"drive_{number}", plant.GetJointByName(name), 9.0)
        plant.Finalize()

    def extract(self):
        return chain_from_plant(self.plant, self.plant.GetFrameByName("second"))


@pytest.mark.parametrize(
    ("actuators", "missing"),
    [((), "'first', 'second'"), (("first",), "'second'"), (("second",), "'first'")],
)
def test_joints_without_actuator_are_named(actuators, missing):
    """The chain is known all the same: velocity servos need no actuators."""
    chain, coordinates = Pendulum(*actuators).extract()
    assert chain.dimension == 2
    with pytest.raises(InputError, match=rf"joints without actuator: {missing}; .*AddJointAct"):
        coordinates.actuation_rows(len(actuators))
    with pytest.raises(InputError, match=rf"joints without actuator: {missing};"):
        coordinates.actuators  # noqa: B018


def test_actuators_in_another_order_than_the_joints():
    _, coordinates = Pendulum("second", "first").extract()
    np.testing.assert_array_equal(coordinates.actuation_rows(2), [[0.0, 1.0], [1.0, 0.0]])
    assert coordinates.undriven == []


def test_a_joint_with_two_actuators_is_refused():
    with pytest.raises(InputError, match=r"joint 'first': actuators 'drive_0', 'drive_2'; allowed"):
        Pendulum("first", "second", "first").extract()


def test_the_state_leaves_everything_else_where_it_is():
    pendulum = Pendulum("first", "second")
    chain, coordinates = pendulum.extract()
    x = state_at_rest(chain, coordinates, np.array([0.4, -0.7]))
    plant, context = pendulum.plant, pendulum.plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, x)
    box = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("box"))
    assert box.IsNearlyEqualTo(pendulum.X_WB, 1e-12)
    angles = [plant.GetJointByName(name).get_angle(context) for name in ("first", "second")]
    assert angles == pytest.approx([0.4, -0.7], abs=1e-15)
    np.testing.assert_allclose(coordinates.link_rows @ x, [0.4, -0.7, 0.0, 0.0], atol=1e-15)


@pytest.fixture(scope="module", params=["", "_3r"], name="arms")
def fixture_arms(request):
    """The rigid and the elastic version of a shipped robot, extracted."""
    extracted = []
    for version in ("", "_elastic"):
        plant = MultibodyPlant(0.0)
        model = resolve_model(f"comau_racer_1_4{version}{request.param}")
        Parser(plant).AddModels(str(model))
        plant.Finalize()
        extracted.append((plant, *chain_from_plant(plant, plant.GetFrameByName("tool_point"))))
    return extracted


def test_rigid_and_elastic_models_give_the_same_links(arms):
    (_, rigid, _), (_, elastic, _) = arms
    assert not rigid.is_elastic and elastic.is_elastic
    for attribute in ("R_PF", "p_PF", "axis", "mass", "p_LC", "I_C", "reflected_inertia"):
        assert np.allclose(
            rigid.gather(attribute), elastic.gather(attribute), rtol=1e-12, atol=1e-12
        ), attribute
    assert np.allclose(rigid.p_LT, elastic.p_LT, rtol=0, atol=1e-14)
    assert np.allclose(rigid.R_LT, elastic.R_LT, rtol=0, atol=1e-14)


def test_elastic_plant_has_the_kinetic_energy_of_the_reduced_model(arms):
    """Drake's elastic plant has v_J' D_E v_J + v_M' D_M v_M, as (2.65) says."""
    (rigid_plant, rigid, _), (plant, elastic, coordinates) = arms
    n, rng = rigid.dimension, np.random.default_rng(2)
    context, rigid_context = plant.CreateDefaultContext(), rigid_plant.CreateDefaultContext()
    for _ in range(5):
        joint_state = rng.uniform(-1.0, 1.0, 4 * n)
        q_J, v_J, _, v_M = joint_state.reshape(4, n)
        plant.SetPositionsAndVelocities(context, coordinates.plant_state(joint_state))
        rigid_plant.SetPositions(rigid_context, q_J)
        D_E = rigid_plant.CalcMassMatrix(rigid_context) - np.diag(rigid.D_M)
        v = plant.GetVelocities(context)
        energy = v @ plant.CalcMassMatrix(context) @ v
        assert energy == pytest.approx(v_J @ D_E @ v_J + elastic.D_M @ v_M**2, rel=1e-9)


def test_the_plants_state_from_joint_coordinates_and_back(arms):
    rng = np.random.default_rng(3)
    for _, chain, coordinates in arms:
        joint_state = rng.normal(size=4 * chain.dimension)
        if not chain.is_elastic:
            joint_state = np.tile(joint_state[: 2 * chain.dimension], 2)
        x = coordinates.plant_state(joint_state)
        assert x.shape == (coordinates.num_states,)
        back = np.concatenate([coordinates.link_rows @ x, coordinates.motor_rows @ x])
        assert np.allclose(back, joint_state, rtol=0, atol=1e-12)


def test_actuators_drive_the_motors_in_order(arms):
    for plant, chain, coordinates in arms:
        for i, link in enumerate(chain.links):
            tau = np.zeros(plant.num_actuators())
            tau[coordinates.actuators[i]] = 1.0
            joint = plant.GetJointByName(link.name)
            driven = plant.MakeActuationMatrix() @ tau
            assert driven[joint.velocity_start()] == 1.0
            assert np.count_nonzero(driven) == 1


def test_limits_are_those_of_the_motor_joints(arms):
    for plant, chain, _ in arms:
        for link in chain.links:
            joint = plant.GetJointByName(link.name)
            assert link.position_limits == (
                joint.position_lower_limits()[0],
                joint.position_upper_limits()[0],
            )
            assert link.velocity_limit == joint.velocity_upper_limits()[0]
            assert np.all(np.isfinite([*link.position_limits, link.effort_limit]))
