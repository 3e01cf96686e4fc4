"""The seven-axis arm against what is published of it, in the frames in which it is published."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.robot_model import joint_resonances
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

PANDA = load_parameters("franka_emika_panda")
USUAL_DEG = [0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0]

# Franka Control Interface, modified DH: a_{i-1} [m], d_i [m], alpha_{i-1} in quarter turns
MODIFIED_DH = [
    (0.0, 0.333, 0),
    (0.0, 0.0, -1),
    (0.0, 0.316, 1),
    (0.0825, 0.0, 1),
    (-0.0825, 0.384, -1),
    (0.0, 0.0, 1),
    (0.088, 0.0, 1),
]
FLANGE = 0.107
# Gaz et al., in those frames: mass, center of mass, inertia about it (xx, xy, xz, yy, yz, zz)
PUBLISHED = [
    (
        4.970684,
        [3.875e-3, 2.081e-3, -0.04762],
        [0.70337, -1.39e-4, 6.772e-3, 0.70661, 1.9169e-2, 9.117e-3],
    ),
    (
        0.646926,
        [-3.141e-3, -2.872e-2, 3.495e-3],
        [7.962e-3, -3.925e-3, 1.0254e-2, 2.811e-2, 7.04e-4, 2.5995e-2],
    ),
    (
        3.228604,
        [2.7518e-2, 3.9252e-2, -6.6502e-2],
        [3.7242e-2, -4.761e-3, -1.1396e-2, 3.6155e-2, -1.2805e-2, 1.083e-2],
    ),
    (
        3.587895,
        [-5.317e-2, 0.104419, 2.7454e-2],
        [2.5853e-2, 7.796e-3, -1.332e-3, 1.9552e-2, 8.641e-3, 2.8323e-2],
    ),
    (
        1.225946,
        [-1.1953e-2, 4.1065e-2, -3.8437e-2],
        [3.5549e-2, -2.117e-3, -4.037e-3, 2.9474e-2, 2.29e-4, 8.627e-3],
    ),
    (
        1.666555,
        [6.0149e-2, -1.4117e-2, -1.0517e-2],
        [1.964e-3, 1.09e-4, -1.158e-3, 4.354e-3, 3.41e-4, 5.433e-3],
    ),
    (
        0.735522,
        [1.0517e-2, -4.252e-3, 6.1597e-2],
        [1.2516e-2, -4.28e-4, -1.196e-3, 1.0027e-2, -7.41e-4, 4.815e-3],
    ),
]


def spatial_inertia(mass, com, xx, xy, xz, yy, yz, zz) -> SpatialInertia:
    """Return what Drake wants; the inertia is about the center of mass."""
    central = RotationalInertia(xx, yy, zz, xy, xz, yz)
    about_origin = central.ShiftFromCenterOfMass(mass=mass, p_BcmQ_E=-np.array(com))
    unit = UnitInertia()
    unit.SetFromRotationalInertia(about_origin, mass)
    return SpatialInertia(mass, com, unit)


@pytest.fixture(scope="module")
def published_plant():
    """The arm as it is published: bodies in modified DH frames, the tool on the flange."""
    plant = MultibodyPlant(0.0)
    parent = plant.world_body()
    for i, (a, d, quarters) in enumerate(MODIFIED_DH):
        mass, com, inertia = PUBLISHED[i]
        body = plant.AddRigidBody(f"body_{i}", spatial_inertia(mass, com, *inertia))
        turn = RotationMatrix.MakeXRotation(quarters * np.pi / 2)
        X_PF = RigidTransform(turn, turn @ np.array([0.0, 0.0, d]) + [a, 0.0, 0.0])
        before = plant.AddFrame(FixedOffsetFrame(f"before_{i}", parent.body_frame(), X_PF))
        plant.AddJoint(RevoluteJoint(f"joint_{i}", before, body.body_frame(), [0, 0, 1]))
        parent = body
    xx, yy, zz, xy, xz, yz = PANDA.tool.inertia
    inertia = spatial_inertia(PANDA.tool.mass, PANDA.tool.center_of_mass, xx, xy, xz, yy, yz, zz)
    tool = plant.AddRigidBody("tool", inertia)
    plant.WeldFrames(parent.body_frame(), tool.body_frame(), RigidTransform([0, 0, FLANGE]))
    plant.Finalize()
    return plant, tool


@pytest.fixture(scope="module")
def shipped_plants():
    """The rigid and the elastic model."""
    plants = []
    for name in ("franka_emika_panda", "franka_emika_panda_elastic"):
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(resolve_model(name)))
        plant.Finalize()
        plants.append(plant)
    return plants


@pytest.mark.parametrize("seed", range(5))
def test_same_arm_as_published(published_plant, shipped_plants, seed):
    """Flange, gravity, mass matrix and velocity terms agree; only the rotors are added."""
    published, tool = published_plant
    shipped = shipped_plants[0]
    rng = np.random.default_rng(seed)
    q, v = rng.uniform(-3.0, 3.0, 7), rng.uniform(-2.0, 2.0, 7)
    expected, found = published.CreateDefaultContext(), shipped.CreateDefaultContext()
    for plant, context in ((published, expected), (shipped, found)):
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
    X_WT = tool.EvalPoseInWorld(expected)
    assert shipped.GetBodyByName("tool").EvalPoseInWorld(found).IsNearlyEqualTo(X_WT, 1e-12)
    np.testing.assert_allclose(
        shipped.CalcGravityGeneralizedForces(found),
        published.CalcGravityGeneralizedForces(expected),
        atol=1e-12,
    )
    rotors = np.diag(PANDA.rotors.reflected_inertia)
    np.testing.assert_allclose(
        shipped.CalcMassMatrix(found) - rotors, published.CalcMassMatrix(expected), atol=1e-12
    )
    np.testing.assert_allclose(
        shipped.CalcBiasTerm(found), published.CalcBiasTerm(expected), atol=1e-12
    )


def test_published_links_have_the_published_gravity_coefficients():
    """Gaz et al. identified these [Nm] first and then retrieved the links from them."""
    m = np.array([mass for mass, _, _ in PUBLISHED])
    x, y, z = (m[:, None] * [com for _, com, _ in PUBLISHED]).T
    beyond = np.cumsum(m[::-1])[::-1]  # of link i and all after it
    found = 9.81 * np.array(
        [
            z[2] - y[1] + 0.316 * beyond[2],  # about axis 2, along the upper arm
            x[2] + 0.0825 * beyond[3],  # across it
            y[3] + z[4] + 0.384 * beyond[4],  # about axis 4, along the forearm
            x[3] - 0.0825 * beyond[4],  # across it
            x[5] + 0.088 * beyond[6],  # about axis 6
            z[6] - y[5],
        ]
    )
    identified = [30.42587, 6.740633, 16.85261, -4.793844, 1.624775, 0.6640253]
    np.testing.assert_allclose(found, identified, rtol=0.02)


def test_published_inertias_are_about_the_centers_of_mass():
    """About the frames' origins links 3, 4 and 6 would have negative principal moments."""
    negative = []
    for i, (mass, com, (xx, xy, xz, yy, yz, zz)) in enumerate(PUBLISHED, start=1):
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        c = np.array(com)
        smallest = np.linalg.eigvalsh(inertia - mass * (c @ c * np.eye(3) - np.outer(c, c)))[0]
        if smallest < 0.0:
            negative.append(i)
    assert negative == [3, 4, 6]


def test_elbow_is_the_origin_of_link_3(shipped_plants):
    """It stays where it is when axis 4 turns, and moves with axis 3."""
    plant = shipped_plants[0]
    context = plant.CreateDefaultContext()
    elbow, wrist = (plant.GetBodyByName(f"link_{i}") for i in (3, 5))
    places = []
    for turn in (0.0, 0.5):
        plant.SetPositions(context, np.deg2rad(USUAL_DEG) + turn * np.eye(7)[3])
        places.append([b.EvalPoseInWorld(context).translation() for b in (elbow, wrist)])
    np.testing.assert_allclose(places[0][0], places[1][0], atol=1e-15)
    reach = np.hypot(0.384, 0.0825)
    for at_elbow, at_wrist in places:
        assert np.linalg.norm(at_wrist - at_elbow) == pytest.approx(reach, rel=1e-12)


def test_limits_are_those_of_the_interface():
    limits = PANDA.joint_limits
    upper = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
    lower = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    np.testing.assert_allclose(limits.position_upper, upper, atol=1e-4)
    np.testing.assert_allclose(limits.position_lower, lower, atol=1e-4)
    np.testing.assert_allclose(limits.velocity, [2.175] * 4 + [2.61] * 3, rtol=1e-6)
    np.testing.assert_allclose(limits.acceleration, [15, 7.5, 10, 12.5, 15, 20, 20], rtol=1e-6)


def test_rotors_have_the_published_reflected_inertia():
    expected = [0.605721456] * 2 + [0.462474144] * 2 + [0.205544064] * 3
    np.testing.assert_allclose(PANDA.rotors.reflected_inertia, expected, rtol=1e-9)


def test_friction_is_the_fit_to_the_published_sigmoids():
    phi_1 = np.array([0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489])
    phi_2 = np.array([5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336])
    phi_3 = np.array([0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526])
    v = np.linspace(0.1, 1.0, 91)[:, None]
    rising, falling = (phi_1 / (1.0 + np.exp(-phi_2 * (w + phi_3))) for w in (v, -v))
    odd = (rising - falling) / 2.0
    lines = np.hstack([np.ones_like(v), v])
    (coulomb, viscous), *_ = np.linalg.lstsq(lines, odd, rcond=None)
    np.testing.assert_allclose(PANDA.friction.coulomb, coulomb, atol=1e-4)
    np.testing.assert_allclose(PANDA.friction.viscous, viscous, atol=1e-4)
    misfit = PANDA.friction.coulomb + PANDA.friction.viscous * v - odd
    assert np.sqrt(np.mean(misfit**2, axis=0)).max() < 0.06


def test_resonances_suit_the_exact_law_at_1_khz(shipped_plants):
    """In a usual posture below one radian per sampling interval, 159 Hz."""
    plant = shipped_plants[1]
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    hertz = joint_resonances(chain, np.deg2rad(USUAL_DEG)) / (2.0 * np.pi)
    assert hertz[0] == pytest.approx(20.1, abs=0.1)
    assert hertz[-1] == pytest.approx(134.4, abs=0.1)
