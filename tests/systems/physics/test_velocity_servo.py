"""The joint velocity servo on Drake's rigid six-axis robot, with friction and gravity."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    LogVectorOutput,
    MatrixGain,
    ZeroOrderHold,
)

from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import bristles_for_step
from pfsc_drake.physics.velocity_servo import VelocityServoLaw, joint_inertia, servo_gains
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.physics.joint_friction import JointFriction
from pfsc_drake.systems.physics.velocity_servo import VelocityServo

POSTURE = np.deg2rad([0.0, 96.0, -32.3, 0.0, 71.4, -5.7])
FRICTION = load_parameters("comau_racer_1_4").friction
BANDWIDTH = 100.0


class Station:
    """The robot under velocity control with a constant reference."""

    def __init__(self, reference, period=0.25e-3, friction=True, limits=None):
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(MultibodyPlant(0.0))
        Parser(self.plant).AddModels(str(resolve_model("comau_racer_1_4")))
        self.plant.Finalize()
        chain, coordinates = chain_from_plant(self.plant, self.plant.GetFrameByName("tool_point"))
        self.chain, self.coordinates, n = chain, coordinates, chain.dimension
        gains = servo_gains(joint_inertia(chain, POSTURE), BANDWIDTH, period)
        law = VelocityServoLaw(gains, chain.gather("effort_limit") if limits is None else limits)
        servo = builder.AddSystem(VelocityServo(chain, law))
        rows = np.vstack([coordinates.link_rows, coordinates.motor_rows])
        encoders = builder.AddSystem(MatrixGain(rows))
        velocities = builder.AddSystem(MatrixGain(coordinates.motor_rows[n:]))
        state = self.plant.get_state_output_port()
        builder.Connect(state, encoders.get_input_port())
        builder.Connect(state, velocities.get_input_port())
        builder.Connect(encoders.get_output_port(), servo.GetInputPort("joint_state"))
        source = builder.AddSystem(ConstantVectorSource(reference))
        builder.Connect(source.get_output_port(), servo.GetInputPort("velocity_reference"))
        hold = builder.AddSystem(ZeroOrderHold(period, n))
        builder.Connect(servo.GetOutputPort("drive_torque"), hold.get_input_port())
        builder.Connect(hold.get_output_port(), self.plant.get_actuation_input_port())
        f_c = FRICTION.coulomb if friction else np.zeros(n)
        f_v = FRICTION.viscous if friction else np.zeros(n)
        dry = builder.AddSystem(JointFriction(bristles_for_step(f_c, f_v, chain.D_M, 1e-3)))
        builder.Connect(velocities.get_output_port(), dry.GetInputPort("velocity"))
        builder.Connect(
            dry.GetOutputPort("resistance"),
            self.plant.get_applied_generalized_force_input_port(),
        )
        self.log_v = LogVectorOutput(velocities.get_output_port(), builder, 1e-3)
        self.log_u = LogVectorOutput(hold.get_output_port(), builder, 1e-3)
        self.simulator = Simulator(builder.Build())
        ResetIntegratorFromFlags(self.simulator, "runge_kutta3", 1e-3).set_fixed_step_mode(True)

    def run(self, duration):
        """Return times, velocities and drive torques, by rows."""
        root = self.simulator.get_mutable_context()
        joint_state = np.concatenate([POSTURE, np.zeros(6), POSTURE, np.zeros(6)])
        self.plant.SetPositionsAndVelocities(
            self.plant.GetMyMutableContextFromRoot(root),
            self.coordinates.plant_state(joint_state),
        )
        self.simulator.AdvanceTo(duration)
        v, u = self.log_v.FindLog(root), self.log_u.FindLog(root)
        return v.sample_times(), v.data().T, u.data().T


@pytest.mark.slow(but="4")
@pytest.mark.parametrize("axis", range(6))
def test_step_within_the_bandwidth(axis):
    """63 % after one time constant, no overshoot; the other axes come back to rest."""
    reference = np.zeros(6)
    reference[axis] = 0.2
    t, v, _ = Station(reference, friction=False).run(0.15)
    rise = t[np.argmax(v[:, axis] > 0.2 * (1.0 - np.exp(-1.0)))]
    assert np.isclose(rise, 1.0 / BANDWIDTH, rtol=0, atol=2e-3)
    assert np.max(v[:, axis]) < 0.2 * 1.01
    assert np.isclose(v[-1, axis], 0.2, rtol=0, atol=2e-4)
    steady = t > 10.0 / BANDWIDTH
    assert np.max(np.abs(np.delete(v, axis, axis=1)[steady])) < 0.02


@pytest.mark.slow
def test_no_steady_error_under_gravity_and_friction():
    reference = np.array([0.15, -0.1, 0.1, 0.2, -0.2, 0.3])
    _, v, u = Station(reference).run(1.0)
    assert np.allclose(v[-1], reference, rtol=0, atol=2e-5)
    friction = FRICTION.coulomb * np.sign(reference) + FRICTION.viscous * reference
    # what the drives give is at least friction: axis 1 has no gravity to carry
    assert np.isclose(u[-1, 0], friction[0], rtol=0.2, atol=0)


@pytest.mark.slow
def test_rests_at_the_start():
    """Nothing moves when servo and robot begin at rest: gravity is fed forward."""
    _, v, u = Station(np.zeros(6)).run(0.3)
    assert np.max(np.abs(v)) < 1e-12
    assert np.max(np.abs(u[1])) > 50.0


@pytest.mark.slow
def test_saturates_without_windup():
    """Little torque beyond gravity: slow, but no overshoot when it arrives."""
    weight = Station(np.zeros(6)).run(0.01)[2][-1]
    limits = np.abs(weight) + np.array([100.0, 120.0, 60.0, 8.0, 6.0, 5.0])
    reference = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    t, v, u = Station(reference, friction=False, limits=limits).run(1.0)
    assert np.all(np.abs(u) <= limits + 1e-9)
    assert np.count_nonzero(np.abs(u[:, 0]) == limits[0]) > 20
    assert np.max(v[:, 0]) < 0.5 * 1.05
    assert np.isclose(v[-1, 0], 0.5, rtol=0, atol=0.005)
    assert t[np.argmax(v[:, 0] > 0.45)] > 3.0 / BANDWIDTH


@pytest.mark.slow
def test_one_millisecond():
    _, v, _ = Station(np.full(6, 0.1), period=1e-3).run(1.0)
    assert np.allclose(v[-1], 0.1, rtol=0, atol=2e-5)


def test_ports_and_errors():
    station = Station(np.zeros(6))
    law = VelocityServoLaw(servo_gains(np.ones(6), 50.0, 1e-3), np.full(6, 10.0))
    servo = VelocityServo(station.chain, law)
    assert servo.GetInputPort("joint_state").size() == 24
    assert servo.GetInputPort("velocity_reference").size() == 6
    assert servo.GetOutputPort("drive_torque").size() == 6
    few = VelocityServoLaw(servo_gains(np.ones(2), 50.0, 1e-3), np.full(2, 10.0))
    with pytest.raises(InputError, match="gains for 2 joints; the robot has 6 joints"):
        VelocityServo(station.chain, few)
