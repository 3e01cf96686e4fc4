"""The filter: over time, at its start, and after changes of its inputs."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    MatrixGain,
    VectorLogSink,
)

from pfsc_drake.control.compliance.impedance import ImpedanceLaw, ImpedanceStatus
from pfsc_drake.control.compliance.impedance_filter import ImpedanceFilter
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem
from tests.control.compliance.impedance_on_numbers import ImpedanceOnNumbers

PERIOD = 1e-3
COORDINATES = PathManifold(2, oriented=False).coordinates
TAU = np.array([4.0, -6.0, 9.0])
DESIRED = np.array([0.5, 0.0, 0.0, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0])
MEASURED = np.array([0.48, 0.01, -0.02, 0.1, 0.03, 0.05])


def arguments(r=2, far=300.0):
    """Return those of a law with the values of Tab. 3.2, but another damping far from the path."""
    damping = Profile(over="xi", at=[0.0, 0.02], values=[122.47, far])
    tangential = CoordinateImpedance(Profile(0.3), Profile(300.0), Profile(3000.0))
    transversal = CoordinateImpedance(Profile(0.3), damping, Profile(500.0))
    parameters = ImpedanceParameters(tangential, transversal)
    return parameters, COORDINATES, r, PERIOD


class Bench:
    """A filter in a context with fixed inputs."""

    def __init__(self, **options):
        self.law = ImpedanceOnNumbers(*arguments())
        self.system = BlockSystem(ImpedanceFilter(self.law.law, **options), PERIOD)
        self.context = self.system.CreateDefaultContext()
        self.fix(desired_reference=DESIRED, manifold_force=TAU, manifold_state=MEASURED)

    def fix(self, **inputs):
        for name, value in inputs.items():
            self.system.GetInputPort(name).FixValue(self.context, value)

    def start(self):
        self.simulator = Simulator(self.system, self.context)
        self.simulator.Initialize()

    def tick(self, count=1):
        # the update of the last instant happens when time leaves it
        ticks = round(self.context.get_time() / PERIOD) + count
        self.simulator.AdvanceTo(ticks * PERIOD)

    def motion(self):
        return self.output("reference")[:2]

    def output(self, name):
        return self.system.GetOutputPort(name).Eval(self.context).reshape(-1, 3).copy()

    def status(self):
        return self.system.GetOutputPort("status").Eval(self.context)[0]


def test_over_time_it_is_the_law():
    """With a reference, a force and parameters that all vary."""
    law, eta_d = (
        ImpedanceOnNumbers(*arguments(4)),
        rest_to_rest([0.1, 0.4], velocity=0.5, acceleration=3.0),
    )
    builder = DiagramBuilder()
    source = builder.AddSystem(BlockSystem(TimedReference(eta_d, 4, 3, PERIOD), PERIOD))
    system = builder.AddSystem(BlockSystem(ImpedanceFilter(law.law), PERIOD))
    force = builder.AddSystem(MatrixGain(np.eye(3, 15) * [[80.0], [40.0], [0.0]]))
    measured = builder.AddSystem(MatrixGain(0.02 * np.ones((12, 15))))
    log = builder.AddSystem(VectorLogSink(15, PERIOD))
    builder.Connect(source.get_output_port(), system.GetInputPort("desired_reference"))
    for part, name in ((force, "manifold_force"), (measured, "manifold_state")):
        builder.Connect(source.get_output_port(), part.get_input_port())
        builder.Connect(part.get_output_port(), system.GetInputPort(name))
    builder.Connect(system.GetOutputPort("reference"), log.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.5)
    data = log.FindLog(simulator.get_context()).data()
    context, state = source.CreateDefaultContext(), None
    for i, logged in enumerate(data.T):
        context.SetTime(i * PERIOD)
        desired = source.get_output_port().Eval(context)
        rows = desired.reshape(5, 3)
        state = law.start(rows[:2]) if state is None else state
        assert np.allclose(law.reference(state, rows).ravel(), logged, rtol=1e-12, atol=1e-12)
        y = 0.02 * desired.sum() * np.ones(3)
        state, _ = law.update(state, rows, desired[:3] * [80.0, 40.0, 0.0], law.impedance(y))
    assert np.abs(data[0] - data[0, 0]).max() > 0.15


def test_it_starts_at_the_reference_and_yields_after_one_period():
    bench = Bench()
    assert np.array_equal(bench.output("reference").ravel(), DESIRED)
    bench.start()
    assert np.array_equal(bench.motion().ravel(), DESIRED[:6])
    bench.tick(2)
    moved = bench.motion()[0] - DESIRED[:3] - np.array([2 * PERIOD * 0.2, 0.0, 0.0])
    assert np.all(np.sign(moved) == np.sign(TAU))


def test_it_can_start_at_the_measured_motion():
    bench = Bench(start="actual")
    bench.start()
    assert np.array_equal(bench.motion().ravel(), MEASURED)
    with pytest.raises(InputError, match="start of an impedance filter: 'now'; reference or"):
        Bench(start="now")


def test_without_a_measured_velocity_it_starts_with_the_desired_one():
    """So it is where the drives are velocity servos, r = 1."""
    law = ImpedanceOnNumbers(*arguments(r=1)).law
    system = BlockSystem(ImpedanceFilter(law, start="actual"), PERIOD)
    context = system.CreateDefaultContext()
    inputs = {"desired_reference": DESIRED, "manifold_force": TAU, "manifold_state": MEASURED[:3]}
    for name, value in inputs.items():
        size = system.GetInputPort(name).size()
        system.GetInputPort(name).FixValue(context, value[:size])
    system.start(context)
    np.testing.assert_array_equal(system.state(context, "position"), MEASURED[:3])
    np.testing.assert_array_equal(system.state(context, "velocity"), DESIRED[3:6])


def test_what_is_not_measured_yet_is_awaited():
    """A projector finds its place at the same initialization."""
    bench = Bench(start="actual")
    bench.fix(manifold_state=np.full(6, np.nan))
    bench.start()
    assert np.array_equal(bench.output("reference").ravel(), DESIRED)
    bench.fix(manifold_state=MEASURED)
    bench.tick()
    state = bench.law.start(MEASURED.reshape(2, 3))
    expected, _ = bench.law.update(state, DESIRED.reshape(3, 3), TAU, state[3:])
    assert np.array_equal(bench.motion(), expected[:2])


def test_an_initial_state_survives_one_initialization():
    bench = Bench(start="actual")
    position, velocity = np.array([0.3, 0.1, 0.2]), np.array([0.1, 0.0, -0.1])
    bench.system.set_state(bench.context, "position", position)
    bench.system.set_state(bench.context, "velocity", velocity)
    bench.start()
    assert np.array_equal(bench.motion(), [position, velocity])
    bench.tick(5)
    # the next one knows nothing of it
    bench.simulator.Initialize()
    assert np.array_equal(bench.motion().ravel(), MEASURED)


def test_nothing_steps_while_running():
    """Engaging, other parameters and another reference: accelerations are all that changes."""
    bench = Bench()
    bench.fix(engaged=[0.0])
    bench.start()
    bench.tick(20)
    assert np.allclose(bench.motion()[0, 1:], 0.0, rtol=0, atol=1e-15)
    other = np.concatenate([[0.9, 0.05, -0.05], np.zeros(6)])
    changes = [
        {"engaged": [1.0]},
        {"impedance": np.repeat([5.0, 1.0, 0.0], 3)},
        {"desired_reference": other},
        {"impedance": np.repeat([0.1, 80.0, 3e4], 3)},
        {"engaged": [0.0]},
    ]
    for change in changes:
        before = bench.motion()
        bench.fix(**change)
        assert np.array_equal(bench.motion(), before)
        bench.tick()
        after = bench.motion()
        # the velocity within the interval lies between those at its ends
        bound = np.abs(after[1] - before[1]).max() * PERIOD + 1e-12
        assert np.abs(after[0] - before[0] - PERIOD * before[1]).max() < bound
        assert np.abs(after[1] - before[1]).min() > 1e-6
        bench.tick(30)
    assert bench.status() == ImpedanceStatus.OK


def test_when_not_engaged_it_returns_by_its_springs():
    bench = Bench()
    bench.fix(desired_reference=np.zeros(9))
    bench.start()
    bench.tick(500)
    deflected = bench.motion()[0]
    assert np.all(np.abs(deflected) > 1e-3)
    bench.fix(engaged=[0.0])
    assert np.array_equal(bench.motion()[0], deflected)
    bench.tick(3000)
    assert np.abs(bench.motion()[0]).max() < 0.01 * np.abs(deflected).max()


def test_engaging_at_the_measured_motion():
    bench = Bench(start="actual")
    bench.fix(engaged=[0.0])
    bench.start()
    bench.tick(10)
    moved = MEASURED + 0.01
    bench.fix(engaged=[1.0], manifold_state=moved)
    bench.tick()
    state = bench.law.start(moved.reshape(2, 3))
    expected, _ = bench.law.update(state, DESIRED.reshape(3, 3), TAU, state[3:])
    assert np.array_equal(bench.motion(), expected[:2])


def test_a_failed_sensor_is_no_force():
    bench, free = Bench(), Bench()
    bench.fix(manifold_force=np.array([1.0, np.nan, 0.0]))
    free.fix(manifold_force=np.zeros(3))
    for each in (bench, free):
        each.start()
        each.tick(10)
    assert bench.status() == ImpedanceStatus.FORCE_NOT_FINITE
    assert np.array_equal(bench.motion(), free.motion())
    bench.fix(manifold_force=TAU, impedance=np.full(9, -1.0))
    bench.tick()
    assert bench.status() == ImpedanceStatus.IMPEDANCE_NOT_VALID


def test_only_the_desired_reference_acts_at_once():
    system = BlockSystem(ImpedanceFilter(ImpedanceLaw(*arguments())), PERIOD)
    output = int(system.GetOutputPort("reference").get_index())
    acting = [
        system.get_input_port(i).get_name()
        for i in range(system.num_input_ports())
        if system.HasDirectFeedthrough(i, output)
    ]
    assert acting == ["desired_reference"]
