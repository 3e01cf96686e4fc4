"""Mounting plates: poses in magazine and frame, and bodies in a plant."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from diagrams.builder import build_station
from diagrams.environment.mounting import add_plate_plant
from diagrams.scenario import Scenario
from diagrams.scenario.plate import CarrierParameters, PlateParameters, RandomMisplacement
from experiments.scenario_file import SCENARIO_DIRECTORY, load_scenario_data
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.yaml.typed import load_typed

SHIFT, TURN = np.array([9.0e-4, -6.3e-4, 0.0]), np.array([7.0e-3, -5.0e-3, 9.8e-3])
EXACT = ("encoders={}", "model_error={}", "friction={}")


def load(*changes, name="plate_mounting"):
    file = SCENARIO_DIRECTORY / f"{name}.yaml"
    return load_typed(Scenario, load_scenario_data(file, list(changes)), str(file))


def build(*changes, name="plate_mounting"):
    return build_station(load(*EXACT, *changes, name=name), SCENARIO_DIRECTORY)


@pytest.fixture(name="station", scope="module")
def fixture_station():
    return build()


def taught(station, eta):
    """Return tool point and orientation at an arc length."""
    path = station.path
    evaluator = path.evaluator(1)
    point = evaluator.evaluate_at(path.arc_length.parameter(eta))
    layout = evaluator.layout
    return point[layout.position][:3], quaternion_to_matrix(point[layout.quaternion][:4])


def test_the_frame_stands_beside_where_it_was_taught(station):
    plate = station.mounting.parameters
    p, R = taught(station, plate.frame.at)
    X_WF = station.mounting.X_WF
    np.testing.assert_allclose(X_WF.translation() - p, R @ SHIFT, atol=1e-12)
    turned = R.T @ X_WF.rotation().matrix()
    np.testing.assert_allclose(Rotation.from_matrix(turned).as_rotvec(), TURN, atol=1e-12)
    assert np.linalg.norm(SHIFT) == pytest.approx(1.1e-3, abs=1e-5)
    assert np.linalg.norm(TURN) == pytest.approx(13e-3, abs=1e-4)


def test_the_magazine_stands_where_it_was_taught(station):
    p, R = taught(station, station.mounting.parameters.magazine.at)
    np.testing.assert_allclose(station.mounting.X_WM.translation(), p, atol=1e-12)
    np.testing.assert_allclose(station.mounting.X_WM.rotation().matrix(), R, atol=1e-12)


def plate_state(station):
    system = station.diagram.GetSubsystemByName("plates")
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    return system.get_state_output_port().Eval(system.GetMyContextFromRoot(root)), root


def held(station, root):
    return station.blocks.output(root, "gripper.held")[0]


def test_a_plate_lies_in_the_magazine_at_the_start(station):
    state, root = plate_state(station)
    np.testing.assert_allclose(state[4:7], station.mounting.X_WM.translation(), atol=1e-12)
    assert held(station, root) == 0.0
    assert not station.blocks.output(root, "gripper.wrench").any()


@pytest.mark.slow
def test_a_plate_that_is_held_is_where_the_tool_is():
    station = build("plate.start=held", "reference.points=[0.5, 0.5]", "start.posture_deg=[]")
    state, root = plate_state(station)
    p, _ = taught(station, 0.5)
    np.testing.assert_allclose(state[4:7], p, atol=1e-9)
    assert held(station, root) == 1.0
    wrench = station.blocks.output(root, "gripper.wrench")
    weight = [0.0, 0.0, -9.81 * station.mounting.parameters.mass]
    np.testing.assert_allclose(wrench, [*weight, 0, 0, 0], atol=1e-3)  # 1e4 N/m and 1e-8 m


@pytest.mark.slow
def test_the_way_back_starts_where_the_frame_stands():
    station = build(name="plate_return")
    state, root = plate_state(station)
    assert len(state) == 26
    np.testing.assert_allclose(state[4:7], station.mounting.X_WF.translation(), atol=1e-12)
    np.testing.assert_allclose(state[11:14], station.mounting.X_WM.translation(), atol=1e-12)
    assert held(station, root) == 1.0
    motion = station.blocks.output(root, "tool_motion.tool_motion")
    np.testing.assert_allclose(motion[:3], station.mounting.X_WF.translation(), atol=1e-7)
    R = station.mounting.X_WF.rotation().matrix()
    np.testing.assert_allclose(motion[3:12].reshape(3, 3), R, atol=1e-7)


def test_random_misplacements_fill_two_balls():
    draws = [RandomMisplacement(seed, 1.5e-3, 0.015).draw() for seed in range(300)]
    for column, radius in ((0, 1.5e-3), (1, 0.015)):
        vectors = np.array([draw[column] for draw in draws])
        sizes = np.linalg.norm(vectors, axis=1)
        assert sizes.max() <= radius
        assert np.mean(sizes**3) == pytest.approx(radius**3 / 2.0, rel=0.1)  # uniform in volume
        assert np.abs(vectors.mean(axis=0)).max() < 0.1 * radius
    frame = CarrierParameters(shift=[1e-3, 0.0, 0.0], random=RandomMisplacement(3, 1e-3, 0.01))
    np.testing.assert_allclose(frame.misplacement()[0] - [1e-3, 0, 0], frame.random.draw()[0])


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ("plate.frame.clearance=0", "clearance = 0.0; allowed: a positive number"),
        ("plate.frame.clearance=-1.0e-4", "clearance = -0.0001; allowed: a positive number"),
        ("plate.frame.size=[0.2, 0.2]", "bores at least frame.ring = 0.016 m inside of frame.size"),
        ("plate.frame.wedges=4", "wedges = 4; allowed: 8 to 64"),
        ("plate.frame.ring=4.0e-3", "frame.ring = 0.004; allowed: more than the radius of a bore"),
        ("plate.frame.shift=[0.1, 0, 0]", "shift = [0.1, 0.0, 0.0]; allowed: a vector of at most"),
        ("plate.frame.turn=[0, 0.3, 0]", "allowed: a vector of at most 0.2 rad"),
        ("plate.frame.at=1.2", "plate.frame.at = 1.2; allowed: 0 to 1.08103 m"),
        ("plate.magazine.at=-0.1", "at = -0.1; allowed: zero or a positive number"),
        ("plate.frame.random.shift=0.1", "shift = 0.1"),
        ("plate.pins.positions=[[0.1, 0.06], [0.2, 0.06]]", "a point on the plate"),
        ("plate.pins.positions=[[0.1, 0.06], [0.08, 0.06]]", "apart"),
        ("plate.pins.length=3.0e-3", "length = 0.003; allowed: more than the radius"),
        ("plate.rests=[[0.1, 0.06], [0.1, -0.06], [-0.1, 0]]", "from every pin"),
        ("plate.start=table", "start = table; allowed: magazine, held, frame"),
        ("plate.start=frame", "plate.start = frame; allowed: frame where"),
        ("plate.mass=0", "mass = 0.0; allowed: 0.001 to 100 kg"),
        ("plate.contact.time_step=7.0e-4", "plate.contact.time_step = 0.0007 s; must be a whole"),
        ("plate.suction.cups=[[0, 0]]", "three or more [x, y] in m"),
        ("plate.operator.task=mend", "task = mend; allowed: mount or return"),
        ("hand=null", "hand = null; allowed: given for plate.operator"),
        ("plate.magazine.shift=[0, 0, -6.0e-3]", "a cup starts 2 mm inside of the plate"),
        ("notch={}", "notch = given; allowed: null where there is a plate"),
        ("path.orientation.task=none", "plate = given: allowed: null unless"),
        ("compliance.tangential.damping=!SlowEnds {least: 9, most: 3}", "most = 3.0; allowed: 9"),
    ],
)
def test_wrong_plates_are_refused(change, part):
    with pytest.raises(InputError) as refusal:
        build(change)
    assert part in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_a_start_with_a_pin_in_the_frame_is_refused():
    changes = ("plate.start=held", "reference.points=[1.07, 1.07]", "start.posture_deg=[]")
    with pytest.raises(InputError, match=r"starts \d.* mm deep in the frame"):
        build(*changes)
    # within the clearance of its bores a plate may start
    build(*changes, "plate.frame.shift=[0, 0, 0]", "plate.frame.turn=[0, 0, 0]")


def test_defaults_are_a_plate_that_fits():
    """Believed to be nearly as heavy as it is; cups, rests and pins on it, pins within bores."""
    plate = PlateParameters()
    half = np.array(plate.size[:2]) / 2.0
    assert plate.nominal_mass == pytest.approx(plate.mass, rel=0.05)
    assert np.all(np.abs(plate.pins.positions) + plate.pins.radius < half)
    assert np.all(np.abs(plate.suction.cups) < half)
    assert 0.0 < plate.frame.clearance < plate.pins.radius
    assert plate.frame.depth > plate.pins.length
    # the seat holds its weight: it lies within the rests
    hull = Delaunay(plate.rests)
    assert hull.find_simplex([0.0, 0.0]) >= 0
    # what rests on the frame is beside the bores
    bores = np.array(plate.pins.positions)[:, None] - np.array(plate.rests)
    assert np.linalg.norm(bores, axis=2).min() > plate.frame.ring
    # and the cups bear it, with room for acceleration
    weight = 9.81 * plate.mass
    assert len(plate.suction.cups) * plate.suction.pull_off > 2.0 * weight


GRAVITY = np.array([0.0, 0.0, -9.81])
DOWN = RotationMatrix.MakeXRotation(np.pi)
X_WF, X_WM = RigidTransform(DOWN, [0.8, 0.3, 0.6]), RigidTransform(DOWN, [0.7, -0.4, 0.5])
PLATE = PlateParameters()
FREE_PLAY = PLATE.frame.clearance / 2.0  # m, to every side
# at the corners between two wedges the bore is wider, m
CORNER = (PLATE.pins.radius + FREE_PLAY) * (1.0 / np.cos(np.pi / PLATE.frame.wedges) - 1.0)
# so deep that cylinders are between the walls, and nothing rests on the frame
INSERTED = RigidTransform([0.0, 0.0, -2e-3])


def world(*poses):
    builder = DiagramBuilder()
    plant, bodies, contact = add_plate_plant(builder, PLATE, X_WM, X_WF, poses, GRAVITY)
    return builder.Build(), plant, bodies, contact


@pytest.fixture(name="depth", scope="module")
def fixture_depth():
    """Return how deep a plate at a pose beside its seat is in something [m]."""
    diagram, plant, bodies, _ = world(X_WF)
    root = diagram.CreateDefaultContext()
    context = plant.GetMyMutableContextFromRoot(root)
    query = plant.get_geometry_query_input_port()

    def depth(X_FP):
        plant.SetFloatingBaseBodyPoseInWorldFrame(context, plant.get_body(bodies[0]), X_WF @ X_FP)
        pairs = query.Eval(context).ComputePointPairPenetration()
        return max((pair.depth for pair in pairs), default=0.0)

    return depth


@pytest.mark.parametrize("angle", np.linspace(0.0, 345.0, 24))
def test_pins_have_half_the_clearance_to_every_side(depth, angle):
    direction = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    assert depth(INSERTED @ RigidTransform(0.98 * FREE_PLAY * direction)) == 0.0
    beyond = FREE_PLAY + CORNER + 2e-5
    assert 1e-5 < depth(INSERTED @ RigidTransform(beyond * direction)) < 1e-4


def test_a_plate_in_its_seat_touches_nothing_but_what_it_lies_on(depth):
    assert depth(RigidTransform()) == pytest.approx(0.0, abs=1e-9)
    assert depth(RigidTransform([0.0, 0.0, 1e-5])) == pytest.approx(1e-5, rel=1e-3)


def test_a_plate_that_is_turned_too_far_does_not_fit(depth):
    """About the bores' direction; the pins are as far from the middle as the lever is long."""
    lever = float(np.linalg.norm(PLATE.pins.positions[0]))
    for turn, fits in ((0.95 * FREE_PLAY, True), (FREE_PLAY + CORNER + 2e-5, False)):
        X_FP = INSERTED @ RigidTransform(RotationMatrix.MakeZRotation(turn / lever), np.zeros(3))
        assert (depth(X_FP) == 0.0) == fits


@pytest.mark.parametrize("make", [RotationMatrix.MakeXRotation, RotationMatrix.MakeYRotation])
def test_a_plate_that_is_tilted_jams(depth, make):
    """The cylinders of its pins stand 6 mm deep in the bores, more than 30 um beside the walls."""
    tilt = 2.0 * (FREE_PLAY + CORNER + 3e-5) / 6e-3
    assert depth(INSERTED @ RigidTransform(make(tilt), [0.0, 0.0, 0.0])) > 1e-5
    assert depth(INSERTED @ RigidTransform(make(1e-3), [0.0, 0.0, 0.0])) == 0.0


def fall(X_FP, duration=0.4):
    diagram, plant, bodies, contact = world(X_WF @ X_FP)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(duration)
    root = simulator.get_context()
    context = plant.GetMyContextFromRoot(root)
    forces = contact.GetOutputPort("forces")
    forces = forces.Eval(contact.GetMyContextFromRoot(root))
    X_WP = plant.GetFreeBodyPose(context, plant.get_body(bodies[0]))
    return X_WF.inverse() @ X_WP, forces


def test_a_plate_that_is_let_go_above_its_seat_falls_into_it():
    """From 8 mm, with the tips of its pins in the bores, it lies flat, and its weight with it."""
    X_FP, forces = fall(RigidTransform([5e-5, -8e-5, -8e-3]))
    sink = PLATE.mass * 9.81 / 4.0 / PLATE.contact.stiffness
    assert X_FP.translation()[2] == pytest.approx(sink, abs=1e-6)
    assert np.linalg.norm(X_FP.translation()[:2]) < FREE_PLAY + CORNER + 1e-5
    np.testing.assert_allclose(forces, [0, 0, PLATE.mass * 9.81, 0, 0, 0], atol=0.05)


def test_a_plate_beside_its_bores_stays_on_the_frame():
    X_FP, forces = fall(RigidTransform([0.0, 9e-3, -PLATE.pins.length - 1e-4]), 0.2)
    assert X_FP.translation()[2] < -0.9 * PLATE.pins.length
    assert forces[2] > 1.0


def test_plates_lie_in_the_magazine():
    diagram, _, _, contact = world(X_WF, X_WM)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.05)
    root = simulator.get_context()
    forces = contact.GetOutputPort("forces")
    weight = [0.0, 0.0, PLATE.mass * 9.81]
    np.testing.assert_allclose(
        forces.Eval(contact.GetMyContextFromRoot(root)), [*weight, *weight], atol=0.1
    )
