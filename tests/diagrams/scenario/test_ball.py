"""The stiffness of a soft ball, against Drake's contact."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from diagrams.environment.workpieces import add_rigid_surface, add_soft_ball
from diagrams.scenario.workpiece import SoftBall


def contact_force(ball):
    """Return the force of a ball on a plane as a function of the depth [m]."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    plant.set_contact_model(ContactModel.kHydroelastic)
    body = plant.AddRigidBody("tool", SpatialInertia.SolidSphereWithMass(1.0, ball.radius))
    frame = plant.world_frame()
    plant.AddJoint(PrismaticJoint("z", frame, body.body_frame(), [0.0, 0.0, 1.0]))
    centre = RigidTransform([0.0, 0.0, ball.radius])
    add_soft_ball(plant, body.body_frame(), ball, centre.translation())
    corners = 0.1 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0]])
    add_rigid_surface(plant, corners, np.array([[0, 1, 2], [0, 2, 3]]), "flat", ball.friction)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    diagram = builder.Build()

    def force(depth):
        root = diagram.CreateDefaultContext()
        context = plant.GetMyMutableContextFromRoot(root)
        plant.SetPositions(context, [-depth])
        results = plant.get_contact_results_output_port().Eval(context)
        info = results.hydroelastic_contact_info(0)
        return abs(info.F_Ac_W().translational()[2])

    return force


@pytest.mark.parametrize("depth", [6e-4, 1.3e-3])
def test_its_stiffness_is_that_of_contact(depth):
    ball = SoftBall(radius=0.02, modulus=4e6, resolution=2e-3)
    force = contact_force(ball)
    step = 2e-4
    slope = (force(depth + step) - force(depth - step)) / (2.0 * step)
    assert ball.stiffness(force(depth)) == pytest.approx(slope, rel=0.15)


def test_it_is_the_slope_of_the_pressure_over_what_is_touched():
    ball = SoftBall(radius=0.02, modulus=4e6)

    def force(depth):
        h, n = ball.radius - depth, 100_000
        widest = np.sqrt(ball.radius**2 - h**2)
        rho = (np.arange(n) + 0.5) * widest / n
        pressure = ball.modulus * (1.0 - np.hypot(h, rho) / ball.radius)
        return float(np.sum(2.0 * np.pi * rho * pressure) * widest / n)

    for depth in (1e-4, 1.3e-3, 6e-3):
        slope = (force(depth + 1e-6) - force(depth - 1e-6)) / 2e-6
        assert ball.stiffness(force(depth)) == pytest.approx(slope, rel=1e-4)


def test_beyond_half_of_the_way_in_it_is_as_stiff_as_it_can_be():
    ball = SoftBall(radius=0.02, modulus=4e6)
    assert ball.stiffness(1e6) == pytest.approx(np.pi * 4e6 * 0.02 / 2.0)
