"""Velocity servo with inputs that are not finite."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.safe_stop import SafeState, SafeStop
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.physics.velocity_servo import VelocityServoLaw, joint_inertia, servo_gains
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.fuse import BlockAccess, fuse
from pfsc_drake.systems.physics.velocity_servo import ServoAccess, VelocityServo

POSTURE = np.deg2rad([0.0, 96.0, -32.3, 0.0, 71.4, -5.7])
PERIOD = 1e-3
VELOCITY = np.array([0.1, -0.2, 0.3, -0.1, 0.2, 0.4])


def diagram_of(system, *, open_port=None):
    """Return a diagram of a system alone, with the same ports but one that is left open."""
    builder = DiagramBuilder()
    builder.AddSystem(system)
    for port in (system.get_input_port(i) for i in range(system.num_input_ports())):
        if port.get_name() != open_port:
            builder.ExportInput(port, port.get_name())
    for port in (system.get_output_port(i) for i in range(system.num_output_ports())):
        builder.ExportOutput(port, port.get_name())
    return builder.Build()


class Bench:
    """A servo, fused or not, with inputs that are set by hand."""

    def __init__(self, fused=False, silence=None, **options) -> None:
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(str(resolve_model("comau_racer_1_4")))
        self.plant.Finalize()
        self.chain, _ = chain_from_plant(self.plant, self.plant.GetFrameByName("tool_point"))
        self.gains = servo_gains(joint_inertia(self.chain, POSTURE), 100.0, PERIOD)
        self.limits = self.chain.gather("effort_limit")
        servo = VelocityServo(self.chain, VelocityServoLaw(self.gains, self.limits), **options)
        servo.set_name("servo")
        self.access = ServoAccess(servo)
        self.servo = diagram_of(servo, open_port="silence" if silence is None else None)
        if fused:
            self.servo = diagram_of(fuse(self.servo))
        self.blocks = BlockAccess(self.servo)
        self.simulator = Simulator(self.servo)
        self.context = self.simulator.get_mutable_context()
        if silence is not None:
            self.servo.GetInputPort("silence").FixValue(self.context, [silence])
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
        assert flag == self.access.fault(self.blocks, self.context)
        return flag

    def weight(self, q=POSTURE):
        """Return what Drake says holds the arm."""
        context = self.plant.CreateDefaultContext()
        self.plant.SetPositions(context, q)
        return -self.plant.CalcGravityGeneralizedForces(context)


@pytest.fixture(params=[False, True], ids=["blocks", "fused"])
def bench(request):
    return Bench(fused=request.param)


def spoiled(values, index, by=np.nan):
    values = np.array(values)
    values[index] = by
    return values


def test_the_first_ticks(bench):
    """``g + K_w v_ref - K_p v``, and the integral part from the second one on."""
    gains = bench.gains
    assert bench.fault is Fault.NONE
    reference = VELOCITY + 0.01
    bench.set(reference=reference)
    expected = bench.weight() + gains.reference * reference - gains.proportional * VELOCITY
    np.testing.assert_allclose(bench.torque, expected, rtol=1e-12, atol=1e-9)
    bench.tick()
    integral = 0.01 * PERIOD * gains.integral
    np.testing.assert_allclose(bench.torque, expected + integral, rtol=1e-12, atol=1e-9)
    assert not bench.access.suspects(bench.blocks, bench.context).any()
    np.testing.assert_array_equal(bench.access.limits, bench.limits)


@pytest.mark.parametrize("by", [np.nan, np.inf])
def test_without_a_reference_it_stops(bench, by):
    """The joints' motion is followed exactly: only the inverse dynamics of the stop remain."""
    for _ in range(5):  # the integral part fills
        bench.tick()
    bench.set(reference=spoiled(VELOCITY, 2, by))
    assert bench.fault is Fault.INPUT_NOT_FINITE
    settings = SafeState(np.zeros(6))
    stop = Stepper(SafeStop(bench.chain, bench.limits, settings, PERIOD))
    state = np.concatenate([POSTURE, VELOCITY, POSTURE, VELOCITY])
    expected = stop.step(joint_state=state, fault=1.0, suspects=np.zeros(24))["torque"]
    np.testing.assert_allclose(bench.torque, expected, atol=1e-9)


def test_a_joint_without_valid_measurement_is_supported(bench):
    rest = np.zeros(6)
    bench.set(v=rest, reference=rest)
    bench.tick()
    bench.set(q=np.full(6, np.nan), v=np.full(6, np.nan))
    np.testing.assert_allclose(bench.torque, bench.weight(), atol=1e-9)
    for _ in range(100):
        bench.tick()
    np.testing.assert_allclose(bench.torque, bench.weight(), atol=1e-9)


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize(("silence", "fault"), [(0.004, Fault.NONE), (0.006, Fault.BUS_LOST)])
def test_a_silent_bus(silence, fault, fused):
    bench = Bench(fused, silence, longest_silence=0.005)
    assert bench.fault is fault


def test_the_root_cause_comes_first():
    """No reference, a joint beyond its limits, a silent bus: each together with the later ones."""
    bench = Bench(silence=1.0, supervision=SupervisionParameters(), longest_silence=0.005)
    assert bench.fault is Fault.BUS_LOST
    bench.set(q=np.full(6, 10.0))
    assert bench.fault is Fault.JOINT_LIMIT
    bench.set(q=np.full(6, 10.0), reference=np.full(6, np.nan))
    assert bench.fault is Fault.INPUT_NOT_FINITE


@pytest.mark.parametrize("fused", [False, True])
def test_a_measurement_that_contradicts_itself(fused):
    bench = Bench(fused, supervision=SupervisionParameters())
    bench.set(v=0.0 * VELOCITY, reference=0.0 * VELOCITY)
    bench.tick()
    bench.tick()
    assert bench.fault is Fault.NONE
    jumped = POSTURE + 0.01 * (np.arange(6) == 2)
    state = np.concatenate([POSTURE, 0.0 * VELOCITY, jumped, 0.0 * VELOCITY])
    bench.servo.GetInputPort("joint_state").FixValue(bench.context, state)
    assert bench.fault is Fault.MEASUREMENT_IMPLAUSIBLE
    bench.tick()
    assert np.flatnonzero(bench.access.suspects(bench.blocks, bench.context)).tolist() == [14]


def test_it_stays_in_its_safe_state(bench):
    bench.set(reference=np.full(6, np.nan))
    bench.tick()
    bench.tick()
    bench.set()
    assert bench.fault is Fault.INPUT_NOT_FINITE
    bench.simulator.Initialize()
    assert bench.fault is Fault.NONE


def test_a_glitch_between_the_ticks_is_not_remembered(bench):
    bench.tick()
    bench.set(reference=np.full(6, np.nan))
    assert bench.fault is Fault.INPUT_NOT_FINITE
    bench.set()
    assert bench.fault is Fault.NONE


def test_it_keeps_the_limits(bench):
    bench.set(v=np.full(6, 100.0), reference=np.full(6, np.nan))
    for _ in range(100):
        bench.tick()
        assert np.all(np.abs(bench.torque) <= bench.limits)


def test_a_start_without_measurement(bench):
    bench.set(q=np.full(6, np.nan))
    bench.simulator.Initialize()
    assert bench.fault is Fault.INPUT_NOT_FINITE
    assert np.isfinite(bench.torque).all()


@pytest.mark.parametrize(("turns", "found"), [(6.0, 7), (0.0, None)])
def test_torques_that_jump_between_their_limits_are_a_fault(turns, found):
    """References of 40 rad/s either way ask axis 2 for more than it has; then the robot stops."""
    watched = SupervisionParameters(
        tolerance=0.0, joint_limits=False, overspeed=np.inf, chatter_turns=turns
    )
    bench = Bench(supervision=watched)
    for k in range(20):
        bench.set(reference=40.0 * (-1.0) ** k * np.eye(6)[1])
        expected = Fault.DRIVE_CHATTERS if found and k > found else Fault.NONE
        assert bench.fault == expected, k
        saturated = np.isclose(np.abs(bench.torque), bench.limits)
        assert saturated.tolist() == [False, expected == Fault.NONE, *[False] * 4]
        bench.tick()
