"""What a velocity servo does when it is told what is not a number."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from pfsc_drake.control.law.fault import Fault
from pfsc_drake.physics.velocity_servo import VelocityServoLaw, joint_inertia, servo_gains
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.control.can_fail import FailingSystem
from pfsc_drake.systems.physics.velocity_servo import VelocityServo

POSTURE = np.deg2rad([0.0, 96.0, -32.3, 0.0, 71.4, -5.7])
PERIOD = 1e-3
VELOCITY = np.array([0.1, -0.2, 0.3, -0.1, 0.2, 0.4])


class Bench:
    """A servo with inputs that are set by hand."""

    def __init__(self) -> None:
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(str(resolve_model("comau_racer_1_4")))
        self.plant.Finalize()
        chain, _ = chain_from_plant(self.plant, self.plant.GetFrameByName("tool_point"))
        self.gains = servo_gains(joint_inertia(chain, POSTURE), 100.0, PERIOD)
        self.limits = chain.gather("effort_limit")
        self.servo = VelocityServo(chain, VelocityServoLaw(self.gains, self.limits))
        self.simulator = Simulator(self.servo)
        self.context = self.simulator.get_mutable_context()
        self.set()
        self.simulator.Initialize()

    def set(self, q=POSTURE, v=VELOCITY, reference=VELOCITY):
        joint_state = np.concatenate([q, v, q, v])
        self.servo.GetInputPort("joint_state").FixValue(self.context, joint_state)
        self.servo.GetInputPort("velocity_reference").FixValue(self.context, reference)

    def tick(self):
        self.simulator.AdvanceTo(self.context.get_time() + PERIOD)

    @property
    def torque(self):
        return self.servo.GetOutputPort("drive_torque").Eval(self.context)

    @property
    def fault(self):
        flag = Fault(int(self.servo.GetOutputPort("fault").Eval(self.context)[0]))
        assert flag == self.servo.fault(self.context)
        return flag

    def weight(self, q=POSTURE):
        """Return what Drake says holds the arm."""
        context = self.plant.CreateDefaultContext()
        self.plant.SetPositions(context, q)
        return -self.plant.CalcGravityGeneralizedForces(context)

    def safe(self, v=VELOCITY, q=POSTURE):
        return np.clip(self.weight(q) - self.gains.proportional * v, -self.limits, self.limits)


@pytest.fixture
def bench():
    return Bench()


def spoiled(values, index, by=np.nan):
    values = np.array(values)
    values[index] = by
    return values


def test_it_can_fail(bench):
    assert isinstance(bench.servo, FailingSystem)
    assert bench.fault is Fault.NONE
    assert np.abs(bench.torque - bench.safe()).min() > 1.0


@pytest.mark.parametrize("by", [np.nan, np.inf])
def test_without_a_reference_it_holds_and_brakes_at_once(bench, by):
    for _ in range(5):  # the integral part fills
        bench.tick()
    bench.set(reference=spoiled(VELOCITY, 2, by))
    assert bench.fault is Fault.INPUT_NOT_FINITE
    np.testing.assert_allclose(bench.torque, bench.safe(), atol=1e-9)


def test_where_it_saw_the_joints_last(bench):
    q = POSTURE + 0.1
    bench.set(q=q)
    bench.tick()
    bench.tick()
    bench.set(q=spoiled(q, 1))
    assert bench.fault is Fault.INPUT_NOT_FINITE
    np.testing.assert_allclose(bench.torque, bench.safe(q=q), atol=1e-9)
    bench.tick()
    bench.set(q=np.full(6, np.nan), v=np.full(6, np.nan))
    np.testing.assert_allclose(bench.torque, bench.weight(q), atol=1e-9)


def test_it_brakes_with_what_it_knows(bench):
    bench.set(v=spoiled(VELOCITY, 3))
    np.testing.assert_allclose(bench.torque, bench.safe(v=spoiled(VELOCITY, 3, 0.0)), atol=1e-9)


def test_it_stays_in_its_safe_state(bench):
    bench.set(reference=np.full(6, np.nan))
    bench.tick()
    bench.tick()
    bench.set()
    assert bench.fault is Fault.INPUT_NOT_FINITE
    np.testing.assert_allclose(bench.torque, bench.safe(), atol=1e-9)
    bench.simulator.Initialize()
    assert bench.fault is Fault.NONE


def test_a_glitch_between_the_ticks_is_not_remembered(bench):
    bench.tick()
    bench.set(reference=np.full(6, np.nan))
    assert bench.fault is Fault.INPUT_NOT_FINITE
    bench.set()
    assert bench.fault is Fault.NONE


def test_it_keeps_the_limits(bench):
    v = np.full(6, 100.0)
    bench.set(v=v, reference=np.full(6, np.nan))
    np.testing.assert_array_equal(bench.torque, -bench.limits)


def test_a_start_without_measurement(bench):
    bench.set(q=np.full(6, np.nan))
    bench.simulator.Initialize()
    assert bench.fault is Fault.INPUT_NOT_FINITE
    assert np.isfinite(bench.torque).all()
