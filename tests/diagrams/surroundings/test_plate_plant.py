"""Plates, pins and bores: what fits, what touches, and that plates fall into their seat."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from diagrams.scenario.plate import PlateParameters
from diagrams.surroundings.plate_plant import add_plate_plant

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
    plates = add_plate_plant(builder, PLATE, X_WM, X_WF, poses, GRAVITY)
    return builder.Build(), plates


@pytest.fixture(name="depth", scope="module")
def fixture_depth():
    """Return how deep a plate at a pose beside its seat is in something [m]."""
    diagram, plates = world(X_WF)
    root = diagram.CreateDefaultContext()
    plant, context = plates.plant, plates.plant.GetMyMutableContextFromRoot(root)
    query = plant.get_geometry_query_input_port()

    def depth(X_FP):
        plant.SetFloatingBaseBodyPoseInWorldFrame(
            context, plant.get_body(plates.bodies[0]), X_WF @ X_FP
        )
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
    diagram, plates = world(X_WF @ X_FP)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(duration)
    root = simulator.get_context()
    plant, context = plates.plant, plates.plant.GetMyContextFromRoot(root)
    forces = plates.contact.GetOutputPort("forces")
    forces = forces.Eval(plates.contact.GetMyContextFromRoot(root))
    X_WP = plant.GetFreeBodyPose(context, plant.get_body(plates.bodies[0]))
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
    diagram, plates = world(X_WF, X_WM)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.05)
    root = simulator.get_context()
    forces = plates.contact.GetOutputPort("forces")
    weight = [0.0, 0.0, PLATE.mass * 9.81]
    np.testing.assert_allclose(
        forces.Eval(plates.contact.GetMyContextFromRoot(root)), [*weight, *weight], atol=0.1
    )
