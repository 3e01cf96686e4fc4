"""The symbolic chain against Drake's kinematics and dynamics."""

import casadi as ca
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JacobianWrtVariable,
    JointActuatorIndex,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)

from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import gravity_torque
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.newton_euler import (
    inverse_dynamics,
    link_motions,
    mass_matrix,
    points_on_links,
    tool_pose,
)


def random_pose(rng):
    rotation = RollPitchYaw(rng.uniform(-3.0, 3.0, size=3)).ToRotationMatrix()
    return RigidTransform(rotation, rng.uniform(-0.4, 0.4, size=3))


def random_inertia(rng):
    box = UnitInertia.SolidBox(*rng.uniform(0.1, 0.6, size=3))
    com = rng.uniform(-0.2, 0.2, size=3)
    return SpatialInertia(rng.uniform(0.5, 5.0), com, box.ShiftFromCenterOfMass(com))


def fixed_frame(name, body, pose):
    return FixedOffsetFrame(name, body.body_frame(), pose)


def random_chain_plant(kinds, seed):
    """A plant with a chain of joints at random poses, welds between them, and a tool frame."""
    rng = np.random.default_rng(seed)
    plant = MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector(rng.normal(size=3) * 5.0)
    base = plant.AddRigidBody("base", random_inertia(rng))
    plant.WeldFrames(plant.world_frame(), base.body_frame(), random_pose(rng))
    parent = base
    for i, kind in enumerate(kinds):
        body = plant.AddRigidBody(f"link_{i}", random_inertia(rng))
        axis = rng.normal(size=3)
        joint_type = RevoluteJoint if kind == "R" else PrismaticJoint
        joint = plant.AddJoint(
            joint_type(
                f"joint_{i}",
                plant.AddFrame(fixed_frame(f"f_{i}", parent, random_pose(rng))),
                plant.AddFrame(fixed_frame(f"m_{i}", body, random_pose(rng))),
                axis / np.linalg.norm(axis),
            )
        )
        actuator = plant.AddJointActuator(f"drive_{i}", joint, effort_limit=100.0 + i)
        actuator.set_default_rotor_inertia(1e-4 * (i + 1))
        actuator.set_default_gear_ratio(50.0)
        parent = body
        if i % 2 == 1:
            load = plant.AddRigidBody(f"load_{i}", random_inertia(rng))
            plant.WeldFrames(body.body_frame(), load.body_frame(), random_pose(rng))
            parent = load
    tool = plant.AddFrame(fixed_frame("tool", parent, random_pose(rng)))
    plant.Finalize()
    return plant, tool


def symbolic_coordinates(n, order):
    """Symbols of the derivatives of q, and the coordinates as jets."""
    derivatives = [ca.SX.sym(f"q{k}", n) for k in range(order + 1)]
    return derivatives, [Jet.from_derivatives([d[i] for d in derivatives]) for i in range(n)]


CHAINS = {
    "seven axes": ("RRRRRRR", 1),
    "with sliding joints": ("PRPRRP", 2),
    "one axis": ("R", 3),
    "gantry": ("PPPRRR", 4),
}


@pytest.fixture(params=CHAINS, name="robot")
def fixture_robot(request):
    kinds, seed = CHAINS[request.param]
    plant, tool = random_chain_plant(kinds, seed)
    chain, coordinates = chain_from_plant(plant, tool)
    return plant, tool, chain, coordinates


def test_tool_pose_and_twist_match_drake(robot):
    plant, tool, chain, _ = robot
    n = chain.dimension
    symbols, q = symbolic_coordinates(n, 2)
    y, R = tool_pose(chain, link_motions(chain, q))
    f = ca.Function("f", symbols, [*y.derivatives(), *R.derivatives()])
    rng = np.random.default_rng(5)
    context = plant.CreateDefaultContext()
    for _ in range(5):
        values = rng.uniform(-1.5, 1.5, size=(3, n))
        plant.SetPositions(context, values[0])
        plant.SetVelocities(context, values[1])
        y0, y1, y2, R0, R1, _ = (np.array(v).squeeze() for v in f(*values))
        X_WT = tool.CalcPoseInWorld(context)
        V_WT = tool.CalcSpatialVelocityInWorld(context)
        J = plant.CalcJacobianSpatialVelocity(
            context,
            JacobianWrtVariable.kV,
            tool,
            [0, 0, 0],
            plant.world_frame(),
            plant.world_frame(),
        )
        bias = plant.CalcBiasSpatialAcceleration(
            context,
            JacobianWrtVariable.kV,
            tool,
            [0, 0, 0],
            plant.world_frame(),
            plant.world_frame(),
        )
        assert np.allclose(y0, X_WT.translation(), atol=1e-12)
        assert np.allclose(R0, X_WT.rotation().matrix(), atol=1e-12)
        assert np.allclose(y1, V_WT.translational(), atol=1e-11)
        assert np.allclose(R1 @ R0.T, ca.skew(ca.DM(V_WT.rotational())).full(), atol=1e-11)
        assert np.allclose(y2, (J @ values[2])[3:] + bias.translational(), atol=1e-10)


def test_points_on_links_match_drake(robot):
    plant, _, chain, _ = robot
    n = chain.dimension
    rng = np.random.default_rng(8)
    points = [(k, rng.uniform(-0.5, 0.5, size=3)) for k in [*range(n), 0]]
    symbols, q = symbolic_coordinates(n, 2)
    places = points_on_links(chain, q, points)
    jacobian = ca.vertcat(*[ca.jacobian(place.coefficients[0], symbols[0]) for place in places])
    columns = [ca.vertcat(*[place.derivative(k) for place in places]) for k in range(3)]
    f = ca.Function("f", symbols, [*columns, jacobian])
    values = rng.uniform(-1.5, 1.5, size=(3, n))
    position, velocity, acceleration, J = (np.array(v).squeeze() for v in f(*values))
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, values[0])
    plant.SetVelocities(context, values[1])
    world = plant.world_frame()
    for i, (k, point) in enumerate(points):
        rows = slice(3 * i, 3 * i + 3)
        frame = plant.GetJointByName(f"joint_{k}").frame_on_child()
        at = (JacobianWrtVariable.kV, frame, point, world, world)
        expected = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, frame, point, world, world
        )
        bias = plant.CalcBiasTranslationalAcceleration(context, *at).ravel()
        assert np.allclose(position[rows], frame.CalcPoseInWorld(context) @ point, atol=1e-12)
        assert np.allclose(J.reshape(-1, n)[rows], expected, atol=1e-12)
        assert np.allclose(velocity[rows], expected @ values[1], atol=1e-11)
        assert np.allclose(acceleration[rows], expected @ values[2] + bias, atol=1e-10)


def test_point_at_the_tool_is_the_tool_point_to_any_order(robot):
    _, _, chain, _ = robot
    coefficients = np.random.default_rng(9).uniform(-1.0, 1.0, size=(chain.dimension, 5))
    q = [Jet([ca.SX(c) for c in row]) for row in coefficients]
    motions = link_motions(chain, q)
    y, _ = tool_pose(chain, motions)
    (place,) = points_on_links(chain, q, [(chain.dimension - 1, chain.p_LT)], motions)
    for k in range(5):
        expected, found = (np.array(ca.DM(jet.derivative(k))) for jet in (y, place))
        assert np.allclose(found, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())


def test_dynamics_match_drake(robot):
    plant, _, chain, _ = robot
    n = chain.dimension
    symbols, q = symbolic_coordinates(n, 2)
    tau = ca.vertcat(*[t.coefficients[0] for t in inverse_dynamics(chain, q)])
    f = ca.Function(
        "f", symbols, [tau, mass_matrix(chain, symbols[0]), gravity_torque(chain, symbols[0])]
    )
    rng = np.random.default_rng(6)
    context = plant.CreateDefaultContext()
    for _ in range(5):
        values = rng.uniform(-1.5, 1.5, size=(3, n))
        plant.SetPositions(context, values[0])
        plant.SetVelocities(context, values[1])
        torque, D, gravity = (np.array(v) for v in f(*values))
        reflected = np.diag(chain.D_M)
        # Drake counts the reflected rotor inertias to the mass matrix
        expected_mass = plant.CalcMassMatrix(context) - reflected
        expected_gravity = -plant.CalcGravityGeneralizedForces(context)
        expected = expected_mass @ values[2] + plant.CalcBiasTerm(context) + expected_gravity
        assert np.allclose(D, expected_mass, rtol=0, atol=1e-10)
        assert np.allclose(gravity.squeeze(), expected_gravity, rtol=0, atol=1e-10)
        assert np.allclose(torque.squeeze(), expected, rtol=0, atol=1e-10)


@pytest.mark.slow(but=["with sliding joints", "one axis"])
def test_higher_orders_are_time_derivatives(robot):
    """Torque and pose jets of order 4 against differentiation along a polynomial motion."""
    _, _, chain, _ = robot
    n, order = chain.dimension, 4
    t = ca.SX.sym("t")
    coefficients = np.random.default_rng(7).uniform(-1.0, 1.0, size=(n, order + 1))
    motion = [sum(float(c) * t**k for k, c in enumerate(row)) for row in coefficients]
    q = [Jet([ca.SX(c) for c in row]) for row in coefficients]
    torque_jets = inverse_dynamics(chain, q)
    y, R = tool_pose(chain, link_motions(chain, q))

    symbols, q_symbolic = symbolic_coordinates(n, 2)
    y_s, R_s = tool_pose(chain, link_motions(chain, q_symbolic))
    expression = ca.vertcat(
        y_s.coefficients[0],
        ca.vec(R_s.coefficients[0]),
        *[tau.coefficients[0] for tau in inverse_dynamics(chain, q_symbolic)],
    )
    along = ca.vertcat(*motion)
    rates = [along, ca.jacobian(along, t), ca.jacobian(ca.jacobian(along, t), t)]
    expression = ca.substitute([expression], symbols, rates)[0]
    for k in range(order + 1):
        expected = np.array(ca.Function("f", [t], [expression])(0.0)).squeeze()
        pose = ca.vertcat(y.derivative(k), ca.vec(R.derivative(k)))
        scale = 1.0 + np.abs(expected).max()
        assert np.allclose(np.array(ca.DM(pose)).squeeze(), expected[:12], atol=1e-11 * scale)
        if k <= order - 2:
            torque = np.array([float(ca.DM(tau.derivative(k))) for tau in torque_jets])
            assert np.allclose(torque, expected[12:], atol=1e-11 * scale)
        expression = ca.jacobian(expression, t)


def test_reflected_inertia_and_limits_are_read(robot):
    plant, _, chain, coordinates = robot
    n = chain.dimension
    expected = [1e-4 * (i + 1) * 2500.0 for i in range(n)]
    assert np.allclose(chain.D_M, expected, rtol=1e-12)
    assert np.allclose(chain.gather("effort_limit"), [100.0 + i for i in range(n)])
    assert not chain.is_elastic
    x = np.arange(2.0 * n)
    assert np.array_equal(coordinates.link_rows @ x, x)
    assert [plant.get_joint_actuator(JointActuatorIndex(i)).name() for i in coordinates.actuators]


def test_a_branch_is_refused():
    plant = MultibodyPlant(0.0)
    rng = np.random.default_rng(0)
    trunk = plant.AddRigidBody("trunk", random_inertia(rng))
    plant.AddJoint(RevoluteJoint("waist", plant.world_frame(), trunk.body_frame(), [0, 0, 1]))
    arms = [plant.AddRigidBody(f"arm_{i}", random_inertia(rng)) for i in range(2)]
    for i, arm in enumerate(arms):
        plant.AddJoint(
            RevoluteJoint(f"shoulder_{i}", trunk.body_frame(), arm.body_frame(), [1, 0, 0])
        )
    plant.Finalize()
    with pytest.raises(
        InputError, match=r"shoulder_1.*branches off.*'arm_0'.*name a tool frame behind it"
    ):
        chain_from_plant(plant, arms[0].body_frame())


def test_a_free_body_and_a_fixed_tool_are_refused():
    plant = MultibodyPlant(0.0)
    body = plant.AddRigidBody("floating", random_inertia(np.random.default_rng(0)))
    with pytest.raises(InputError, match="not finalized"):
        chain_from_plant(plant, body.body_frame())
    plant.Finalize()
    with pytest.raises(InputError, match=r"type 'quaternion_floating'"):
        chain_from_plant(plant, body.body_frame())
    with pytest.raises(InputError, match="no moving joint"):
        chain_from_plant(plant, plant.world_frame())
