"""Surface following of a user's own plant: one call."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import (
    FollowerOptions,
    StreamLimits,
    add_surface_following,
    rest_to_rest,
    straight_lines,
)
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.robot.models.files import models_directory


@pytest.fixture(scope="module", name="surface")
def fixture_surface():
    return paraboloid([(-0.3, 0.3), (-0.3, 0.3)], 0.5, [0.9, 0.0, 0.7])


def load(builder):
    plant = builder.AddSystem(MultibodyPlant(0.0))
    Parser(plant).AddModels(str(models_directory() / "comau_racer_1_4" / "comau_racer_1_4.sdf"))
    plant.Finalize()
    return plant


def test_a_users_own_plant_follows_a_users_own_surface(surface):
    motion = straight_lines([[0.2, 0.0], [0.3, -0.05]], velocity=0.4, acceleration=4.0)
    builder = DiagramBuilder()
    plant = load(builder)
    follower = add_surface_following(
        builder, plant, "tool_point", surface, motion, "rigid", options=FollowerOptions(30.0)
    )
    builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
    builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(root), follower.start_state)
    simulator.AdvanceTo(0.3)
    context = follower.GetMyContextFromRoot(root)
    assert follower.GetOutputPort("fault").Eval(context)[0] == Fault.NONE
    eta_1, eta_2, xi = follower.GetOutputPort("manifold_state").Eval(context)[:3]
    wanted = motion.derivatives(np.array([0.3]), 0)[0, 0]
    np.testing.assert_allclose([eta_1, eta_2], wanted, rtol=0, atol=1e-4)
    assert abs(xi) < 1e-5
    assert wanted[0] > 0.25


def test_way_points_do_not_stream_on_surfaces(surface):
    builder = DiagramBuilder()
    motion = straight_lines([[0.2, 0.0], [0.3, -0.05]], velocity=0.4, acceleration=4.0)
    options = FollowerOptions(stream=StreamLimits())
    with pytest.raises(InputError, match="stream: given; must be None on surfaces"):
        add_surface_following(
            builder, load(builder), "tool_point", surface, motion, "rigid", options=options
        )


def test_a_motion_of_one_coordinate_is_refused(surface):
    builder = DiagramBuilder()
    motion = rest_to_rest([0.0, 0.1], velocity=0.1, acceleration=1.0)
    with pytest.raises(InputError, match="motion: 1 coordinates; a surface has 2"):
        add_surface_following(builder, load(builder), "tool_point", surface, motion, "rigid")
