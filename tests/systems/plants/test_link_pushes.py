"""Wrenches on links of Drake's plants, at bodies and at joints, against Drake's Jacobians."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.link_points import link_frames, point_on_link
from pfsc_drake.systems.plants.applied_wrenches import LinkPushes

# links and frames, and points in their axes [m]
POINTS = {
    "link_3": [0.1, -0.2, 0.05],
    "link_1": [0.0, 0.3, 0.0],
    "tool_point": [0.02, 0.01, -0.1],
    "link_5": [0.0, 0.0, 0.0],
}
WRENCHES = np.random.default_rng(3).uniform(-30.0, 30.0, 24)


class Station:
    """A robot with nothing but wrenches on its links."""

    def __init__(self, model):
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(MultibodyPlant(0.0))
        Parser(self.plant).AddModels(str(resolve_model(model)))
        self.plant.Finalize()
        tool = self.plant.GetFrameByName("tool_point")
        self.chain, self.coordinates = chain_from_plant(self.plant, tool)
        points = [self.locate(name, point) for name, point in POINTS.items()]
        self.system = builder.AddSystem(LinkPushes(self.chain, points))
        builder.Connect(
            self.system.GetOutputPort("applied_spatial_force"),
            self.plant.get_applied_spatial_force_input_port(),
        )
        for name in ("wrenches", "joint_state"):
            builder.ExportInput(self.system.GetInputPort(name), name)
        self.diagram = builder.Build()

    def locate(self, name, point):
        return point_on_link(self.plant, self.coordinates, name, point)

    def contexts(self, wrenches, joint_state):
        root = self.diagram.CreateDefaultContext()
        self.diagram.GetInputPort("wrenches").FixValue(root, wrenches)
        self.diagram.GetInputPort("joint_state").FixValue(root, joint_state)
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.plant.SetPositionsAndVelocities(context, self.coordinates.plant_state(joint_state))
        self.plant.get_actuation_input_port().FixValue(context, np.zeros(6))
        return context, self.system.GetMyContextFromRoot(root)

    def jacobian(self, context, name):
        """Return Drake's ``[w; v]`` of a point by all velocities of the plant."""
        world, frame = self.plant.world_frame(), self.plant.GetFrameByName(name)
        return self.plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, frame, POINTS[name], world, world
        )


@pytest.fixture(scope="module", params=["comau_racer_1_4", "comau_racer_1_4_elastic"])
def station(request):
    return Station(request.param)


@pytest.fixture(scope="module")
def state():
    q, v = np.random.default_rng(4).uniform(-1.5, 1.5, (2, 6))
    return np.concatenate([q, v, q, v])


def test_joint_torques_match_drake(station, state):
    context, own = station.contexts(WRENCHES, state)
    expected = np.zeros(station.plant.num_velocities())
    for name, wrench in zip(POINTS, WRENCHES.reshape(-1, 6), strict=True):
        expected += station.jacobian(context, name).T @ np.concatenate([wrench[3:], wrench[:3]])
    rows = station.coordinates.link_rows[6:, station.plant.num_positions() :]
    # the generalized force of motor and flex joint are one, the first column of each pair
    link_side = np.linalg.pinv(rows.T) @ expected
    tau_ext = station.system.GetOutputPort("tau_ext").Eval(own)
    assert np.allclose(tau_ext, link_side, rtol=0, atol=1e-11 * np.abs(link_side).max())
    assert np.abs(tau_ext).min() > 0.1


def test_bodies_move_as_by_drakes_generalized_forces(station, state):
    pushed, _ = station.contexts(WRENCHES, state)
    free, _ = station.contexts(np.zeros(24), state)
    forces = sum(
        station.jacobian(free, name).T @ np.concatenate([wrench[3:], wrench[:3]])
        for name, wrench in zip(POINTS, WRENCHES.reshape(-1, 6), strict=True)
    )
    station.plant.get_applied_generalized_force_input_port().FixValue(free, forces)
    accelerations = [
        station.plant.get_generalized_acceleration_output_port().Eval(context)
        for context in (pushed, free)
    ]
    scale = np.abs(accelerations[1]).max()
    assert np.allclose(*accelerations, rtol=0, atol=1e-9 * scale)


def test_where_nothing_acts_nothing_is_applied(station, state):
    wrenches = np.zeros(24)
    wrenches[6:9] = [1.0, 2.0, 3.0]
    _, own = station.contexts(wrenches, state)
    (applied,) = station.system.GetOutputPort("applied_spatial_force").Eval(own)
    assert applied.body_index == station.plant.GetBodyByName("link_1").index()
    assert applied.F_Bq_W.translational() == pytest.approx([1.0, 2.0, 3.0])
    tau_ext = station.system.GetOutputPort("tau_ext").Eval(own)
    # what is beyond the pushed link bears nothing
    assert tau_ext[0] != 0.0
    assert not tau_ext[1:].any()
    _, still = station.contexts(np.zeros(24), state)
    assert not station.system.GetOutputPort("tau_ext").Eval(still).any()


def test_link_frames_are_those_of_the_links_not_of_the_motors(station):
    names = [frame.body().name() for frame in link_frames(station.plant, station.coordinates)]
    assert names == [f"link_{i + 1}" for i in range(6)]


@pytest.mark.parametrize("name", ["elbow", "base", "rotor_3", ""])
def test_what_does_not_move_with_a_link_is_refused(name):
    with pytest.raises(InputError) as caught:
        Station("comau_racer_1_4_elastic").locate(name, np.zeros(3))
    assert str(caught.value).startswith(f"'{name}' ")
    assert "allowed: link_1, link_2, link_3, link_4, link_5, link_6, tool" in str(caught.value)
