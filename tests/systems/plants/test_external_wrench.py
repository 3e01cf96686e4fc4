"""External wrenches on Drake's plants, at the tool point and at the joints."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.plants.applied_wrenches import ExternalWrench

WRENCH = np.array([12.0, -30.0, 20.0, 1.0, -2.0, 3.0])


class Station:
    """A robot with nothing but an external wrench."""

    def __init__(self, model):
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(MultibodyPlant(0.0))
        Parser(self.plant).AddModels(str(resolve_model(model)))
        self.plant.Finalize()
        tool = self.plant.GetFrameByName("tool_point")
        self.chain, self.coordinates = chain_from_plant(self.plant, tool)
        self.system = builder.AddSystem(ExternalWrench(tool, self.chain))
        builder.Connect(
            self.system.GetOutputPort("applied_spatial_force"),
            self.plant.GetInputPort("applied_spatial_force"),
        )
        for name in ("wrench", "joint_state"):
            builder.ExportInput(self.system.GetInputPort(name), name)
        self.diagram = builder.Build()

    def evaluate(self, wrench, joint_state, drive):
        """Return the plant's accelerations and ``tau_ext``."""
        root = self.diagram.CreateDefaultContext()
        self.diagram.GetInputPort("wrench").FixValue(root, wrench)
        self.diagram.GetInputPort("joint_state").FixValue(root, joint_state)
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.plant.SetPositionsAndVelocities(context, self.coordinates.plant_state(joint_state))
        self.plant.get_actuation_input_port().FixValue(context, drive)
        acceleration = self.plant.get_generalized_acceleration_output_port().Eval(context)
        tau_ext = self.system.GetOutputPort("tau_ext").Eval(self.system.GetMyContextFromRoot(root))
        return acceleration.copy(), tau_ext.copy()


@pytest.fixture(scope="module")
def rigid():
    return Station("comau_racer_1_4")


def test_a_wrench_moves_the_robot_like_its_joint_torques(rigid):
    """Two ways into the plant: on the body, and through the drives of rigid joints."""
    random = np.random.default_rng(1)
    for _ in range(5):
        q, v = random.uniform(-1.5, 1.5, (2, 6))
        state, drive = np.concatenate([q, v, q, v]), random.uniform(-50, 50, 6)
        pushed, tau_ext = rigid.evaluate(WRENCH, state, drive)
        driven, _ = rigid.evaluate(np.zeros(6), state, drive + tau_ext)
        assert np.allclose(pushed, driven, rtol=0, atol=1e-9)
        free, none = rigid.evaluate(np.zeros(6), state, drive)
        assert not np.any(none)
        assert np.max(np.abs(pushed - free)) > 1.0


def test_a_push_accelerates_the_tool_in_its_direction(rigid):
    """Mobility is positive: the tool point moves in the direction of the force."""
    q = np.array([0.2, 1.4, -0.5, 0.3, 1.0, -0.4])
    state = np.concatenate([q, np.zeros(6), q, np.zeros(6)])
    for i in range(6):
        wrench = np.eye(6)[i]
        pushed, tau_ext = rigid.evaluate(wrench, state, np.zeros(6))
        free, _ = rigid.evaluate(np.zeros(6), state, np.zeros(6))
        assert tau_ext @ (pushed - free) > 0.0


def test_joint_torques_of_elastic_joints_act_on_the_link_side():
    station = Station("comau_racer_1_4_elastic")
    random = np.random.default_rng(2)
    q = random.uniform(-1.5, 1.5, 6)
    state = np.concatenate([q, np.zeros(6), q + 1e-4, np.zeros(6)])
    pushed, tau_ext = station.evaluate(WRENCH, state, np.zeros(6))
    free, _ = station.evaluate(np.zeros(6), state, np.zeros(6))
    rows = np.vstack([station.coordinates.link_rows, station.coordinates.motor_rows])
    n = station.plant.num_positions()
    link, motor = (rows[6:12, n:], rows[18:, n:])
    # the motors do not feel it at once; rotor bodies of 1e-5 kg are all that disturbs that
    assert np.max(np.abs(motor @ (pushed - free))) < 1e-4 * np.max(np.abs(link @ (pushed - free)))
    _, rigid_tau = Station("comau_racer_1_4").evaluate(WRENCH, state, np.zeros(6))
    assert np.allclose(tau_ext, rigid_tau, rtol=0, atol=1e-10)


def test_the_plant_gets_it_without_the_joint_state():
    station = Station("comau_racer_1_4")
    context = station.system.CreateDefaultContext()
    station.system.GetInputPort("wrench").FixValue(context, WRENCH)
    (applied,) = station.system.GetOutputPort("applied_spatial_force").Eval(context)
    assert applied.body_index == station.plant.GetBodyByName("tool").index()
    assert applied.p_BoBq_B == pytest.approx([0.0, 0.0, 0.12])
    assert applied.F_Bq_W.translational() == pytest.approx(WRENCH[:3])
    assert applied.F_Bq_W.rotational() == pytest.approx(WRENCH[3:])


def test_no_force_is_an_empty_list_and_nan_is_not():
    station = Station("comau_racer_1_4")
    context = station.system.CreateDefaultContext()
    fixed = station.system.GetInputPort("wrench").FixValue(context, np.zeros(6))
    station.system.GetInputPort("joint_state").FixValue(context, np.ones(24))
    applied, tau_ext = (
        station.system.GetOutputPort(name) for name in ("applied_spatial_force", "tau_ext")
    )
    assert applied.Eval(context) == []
    assert not np.any(tau_ext.Eval(context))
    for wrench in (np.where(np.arange(6) == 4, np.nan, 0.0), -WRENCH):
        fixed.GetMutableData().get_mutable_value().SetFromVector(wrench)
        (force,) = applied.Eval(context)
        np.testing.assert_array_equal(force.F_Bq_W.rotational(), wrench[3:])
        np.testing.assert_array_equal(force.F_Bq_W.translational(), wrench[:3])
        assert np.isnan(wrench).any() == np.isnan(tau_ext.Eval(context)).any()
    # what was delivered before is not changed by what came later
    fixed.GetMutableData().get_mutable_value().SetFromVector(np.zeros(6))
    assert applied.Eval(context) == []
    np.testing.assert_array_equal(force.F_Bq_W.rotational(), -WRENCH[3:])
