"""The constrained DELTA plant against the analytic one."""

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.multibody import (
    add_delta_plant,
    set_delta_positions,
    slide_state_rows,
)
from pfsc_drake.systems.plants.delta_plant import DeltaPlant

PARAMETERS = load_delta_parameters()
ROBOT = DeltaRobot(PARAMETERS)
START = np.array([0.17, 0.15, 0.16])
HOLD, DURATION = 1e-3, 0.5
TIMES = np.arange(0.0, DURATION + 2 * HOLD, HOLD)
# about the weight, and 20 N to and fro: 0.2 m of motion at up to 1 m/s
FORCES = -13.0 + 20.0 * np.cos(4.0 * np.pi * TIMES + np.array([[0.0], [2.0], [4.0]]))


def constrained(time_step):
    plant = MultibodyPlant(time_step)
    model = add_delta_plant(plant, PARAMETERS)
    plant.Finalize()
    return plant, model


@pytest.fixture(scope="module")
def analytic():
    """End state and tool position of the analytic plant."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(DeltaPlant(ROBOT))
    force = builder.AddSystem(TrajectorySource(PiecewisePolynomial.ZeroOrderHold(TIMES, FORCES)))
    hold = builder.AddSystem(ZeroOrderHold(HOLD, 3))
    builder.Connect(force.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.GetInputPort("actuation"))
    simulator = Simulator(builder.Build())
    ResetIntegratorFromFlags(simulator, "runge_kutta3", HOLD)
    simulator.get_mutable_integrator().set_target_accuracy(1e-9)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.set_state(context, START)
    simulator.AdvanceTo(DURATION)
    return (
        plant.GetOutputPort("state").Eval(context),
        plant.GetOutputPort("tool_position").Eval(context),
    )


def run_constrained(time_step):
    """End state of the slides and tool position of the constrained plant."""
    builder = DiagramBuilder()
    plant, model = constrained(time_step)
    builder.AddSystem(plant)
    # the plant reads its input before a ZeroOrderHold would have been updated
    held = PiecewisePolynomial.ZeroOrderHold(TIMES - 1e-6, FORCES)
    force = builder.AddSystem(TrajectorySource(held))
    builder.Connect(force.get_output_port(), plant.get_actuation_input_port())
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    set_delta_positions(plant, context, model, START)
    simulator.AdvanceTo(DURATION)
    state = slide_state_rows(plant, model) @ plant.GetPositionsAndVelocities(context)
    return state, model.end_effector.EvalPoseInWorld(context).translation()


@pytest.mark.slow
def test_same_forces_same_motion_to_first_order_in_the_step(analytic):
    state, y_t = analytic
    assert np.linalg.norm(y_t - ROBOT.tool_position(START)) > 0.1, "a motion worth the name"
    way, corrected, rods = [], [], []
    for time_step in (1e-3, 5e-4, 2.5e-4):
        x, y = run_constrained(time_step)
        way.append(np.linalg.norm(y - y_t))
        # the step q += dt v_next leads by half a step of velocity and is exact otherwise
        corrected.append(np.max(np.abs(x[:3] - 0.5 * time_step * x[3:] - state[:3])))
        rods.append(np.linalg.norm(y - ROBOT.tool_position(x[:3])))
    assert way[0] < 0.45e-3 and way[1] < 0.23e-3 and way[2] < 0.12e-3
    assert way[0] / way[1] == pytest.approx(2.0, rel=0.03)
    assert way[1] / way[2] == pytest.approx(2.0, rel=0.03)
    assert corrected[0] < 2e-6
    assert corrected[0] / corrected[1] == pytest.approx(4.0, rel=0.1)
    # the constraints are kept to second order
    assert rods[0] < 3e-6
    assert rods[0] / rods[1] == pytest.approx(4.0, rel=0.1)


def test_holding_forces_keep_the_constrained_plant_in_place():
    """Static equilibrium of the analytic model is that of the constrained one."""
    plant, model = constrained(1e-3)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    set_delta_positions(plant, context, model, START)
    J_D = ROBOT.jacobian_at(START)
    sink = PARAMETERS.geometry.h_P / PARAMETERS.geometry.rail_length
    hold = -9.81 * (1.1 * sink + 1.85 * J_D[2])
    plant.get_actuation_input_port().FixValue(context, hold)
    simulator.AdvanceTo(0.2)
    state = slide_state_rows(plant, model) @ plant.GetPositionsAndVelocities(context)
    # as far as the solver converges
    assert np.allclose(state, np.r_[START, 0, 0, 0], rtol=0, atol=1e-8)


def test_the_world_frame_is_the_inertial_frame():
    plant, model = constrained(1e-3)
    context = plant.CreateDefaultContext()
    v = np.array([0.3, -0.2, 0.5])
    set_delta_positions(plant, context, model, START, v)
    y_t = model.end_effector.EvalPoseInWorld(context).translation()
    assert np.allclose(y_t, ROBOT.tool_position(START), rtol=0, atol=1e-14)
    velocity = model.end_effector.EvalSpatialVelocityInWorld(context).translational()
    slope = (ROBOT.tool_position(START + 1e-6 * v) - ROBOT.tool_position(START - 1e-6 * v)) / 2e-6
    assert np.allclose(velocity, slope, rtol=0, atol=1e-8)
    for i, joint in enumerate(model.slides):
        B = joint.child_body().EvalPoseInWorld(context).translation()
        C = y_t + PARAMETERS.geometry.l_EC * PARAMETERS.geometry.directions[i]
        assert np.linalg.norm(C - B) == pytest.approx(0.5, abs=1e-14)
        assert joint.position_lower_limit() == 0.0 and joint.position_upper_limit() == 0.4
    assert plant.gravity_field().gravity_vector()[2] == 9.81


def test_masses_and_drives():
    plant, model = constrained(1e-3)
    assert plant.num_actuators() == len(model.actuators) == 3
    assert plant.get_joint_actuator(model.actuators[1]).effort_limit() == 200.0
    assert model.end_effector.default_mass() == pytest.approx(1.85)
    for joint in model.slides:
        assert joint.child_body().default_mass() == pytest.approx(1.1)
    context = plant.CreateDefaultContext()
    assert plant.CalcTotalMass(context) == pytest.approx(3 * 1.1 + 1.85)


def test_visual_geometry_moves_with_the_right_bodies():
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    model = add_delta_plant(plant, PARAMETERS, visual=True)
    plant.Finalize()
    assert len(plant.GetVisualGeometriesForBody(model.end_effector)) == 4
    for joint in model.slides:
        assert len(plant.GetVisualGeometriesForBody(joint.child_body())) == 2
    # hub, three spokes, beams and rails stand still
    assert len(plant.GetVisualGeometriesForBody(plant.world_body())) == 10
    assert plant.num_collision_geometries() == 0
    assert scene_graph.model_inspector().NumGeometriesWithRole(Role.kIllustration) == 20


def test_unsuitable_plants_are_refused():
    with pytest.raises(InputError, match="time step 0; constraints need a discrete plant"):
        add_delta_plant(MultibodyPlant(0.0), PARAMETERS)
    plant = MultibodyPlant(1e-3)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kTamsi)
    with pytest.raises(InputError, match="TAMSI"):
        add_delta_plant(plant, PARAMETERS)
    plant = MultibodyPlant(1e-3)
    plant.Finalize()
    with pytest.raises(InputError, match="finalized already"):
        add_delta_plant(plant, PARAMETERS)


def test_positions_where_the_rods_cannot_meet_are_refused():
    parameters = load_delta_parameters()
    parameters.geometry.l_BC = 0.3
    plant = MultibodyPlant(1e-3)
    model = add_delta_plant(plant, parameters)
    plant.Finalize()
    with pytest.raises(InputError, match=r"too far apart for rods of 0\.3 m"):
        set_delta_positions(plant, plant.CreateDefaultContext(), model, np.zeros(3))
