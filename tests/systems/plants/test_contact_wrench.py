"""Contact forces against the weight that they carry."""

import numpy as np
import pytest
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
)
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from pfsc_drake.systems.plants.reactions import ContactWrench

MASS, RADIUS, GRAVITY = 0.5, 0.03, 9.81
TOOL = np.array([0.2, -0.1, 0.4])


def settle(ball_first):
    """Let a soft ball come to rest on a rigid floor, and return the wrench on it."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    plant.set_contact_model(ContactModel.kHydroelastic)
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(MASS, RADIUS))
    soft, rigid = ProximityProperties(), ProximityProperties()
    for properties in (soft, rigid):
        AddContactMaterial(friction=CoulombFriction(0.5, 0.5), properties=properties)
    AddCompliantHydroelasticProperties(
        resolution_hint=0.01, hydroelastic_modulus=1e6, properties=soft
    )
    AddRigidHydroelasticProperties(properties=rigid)

    def add_ball():
        return plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(RADIUS), "ball", soft)

    def add_floor():
        X_WF = RigidTransform([0.0, 0.0, -0.05])
        plant.RegisterCollisionGeometry(plant.world_body(), X_WF, Box(1, 1, 0.1), "floor", rigid)

    if ball_first:
        geometry = add_ball()
        add_floor()
    else:
        add_floor()
        geometry = add_ball()
    plant.Finalize()
    wrench = builder.AddSystem(ContactWrench([geometry]))
    pose = builder.AddSystem(ConstantVectorSource(np.concatenate([TOOL, np.eye(3).ravel()])))
    builder.Connect(plant.get_contact_results_output_port(), wrench.GetInputPort("contact_results"))
    builder.Connect(pose.get_output_port(), wrench.GetInputPort("tool_pose"))
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    plant.SetFreeBodyPose(context, ball, RigidTransform([0.05, 0.02, RADIUS]))
    simulator.AdvanceTo(1.0)
    position = plant.EvalBodyPoseInWorld(context, ball).translation()
    return wrench.GetOutputPort("wrench").Eval(wrench.GetMyContextFromRoot(root)), position


@pytest.mark.slow(but="True")
@pytest.mark.parametrize("ball_first", [True, False])
def test_carries_the_weight(ball_first):
    """Whichever of the two geometries Drake names first."""
    wrench, position = settle(ball_first)
    weight = np.array([0.0, 0.0, MASS * GRAVITY])
    np.testing.assert_allclose(wrench[:3], weight, atol=2e-3)
    # at rest the force's line of action goes through the ball's centre
    np.testing.assert_allclose(wrench[3:], np.cross(position - TOOL, weight), atol=2e-3)


def test_without_contact_there_is_no_wrench():
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    plant.Finalize()
    wrench = builder.AddSystem(ContactWrench([]))
    builder.Connect(plant.get_contact_results_output_port(), wrench.GetInputPort("contact_results"))
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    context = wrench.GetMyContextFromRoot(root)
    wrench.GetInputPort("tool_pose").FixValue(context, np.zeros(12))
    assert not wrench.GetOutputPort("wrench").Eval(context).any()
