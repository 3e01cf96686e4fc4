"""Guidance as a system: what moves it when, and what it remembers."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ZeroOrderHold

from pfsc_drake.control.fixtures.command_dynamics import FilterDynamics, ServoDynamics
from pfsc_drake.control.fixtures.fixture_guidance import GuidedTool
from pfsc_drake.control.fixtures.fixture_parameters import Admittance, GuidanceParameters
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.near_regions import near_rows, reaches
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.robot.robot_model import tool_motion_function
from pfsc_drake.systems.block_system import BlockSystem
from tests.control.conftest import BENT, Robot

PERIOD, M = 1e-3, 6
PARAMETERS, MASS, DAMPING = GuidanceParameters(), 3.0, 90.0
PULL = np.array([12.0, -5.0, -40.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def robot():
    return Robot("comau_racer_1_4")


class Bench:
    """Guidance in a context with a robot that stands still, above a floor close by."""

    def __init__(self, robot, dynamics, order=2, below=1e-3):
        self.q, n = np.array(BENT), robot.n
        motion = tool_motion_function(robot.chain)
        self.y_t = np.array(motion(self.q, np.zeros(n))).ravel()[:3]
        regions = [HalfSpace(self.y_t - [0, 0, below], [0, 0, 1])]
        near = near_rows(regions, reaches(PARAMETERS, PERIOD, [0.0]))
        admittance = Admittance(MASS, DAMPING, PERIOD)
        tool = GuidedTool(motion, dynamics, admittance, len(regions), near, order, M)
        self.system = BlockSystem(ProgramGuidance(tool, PARAMETERS, [math.inf]), PERIOD)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.fix(joint_state=[*self.q, *np.zeros(n)] * 2, wrench=PULL, ready=[1.0])

    def fix(self, **inputs):
        for name, value in inputs.items():
            self.system.GetInputPort(name).FixValue(self.context, np.array(value, dtype=float))

    def advance(self, ticks):
        self.simulator.AdvanceTo(self.context.get_time() + ticks * PERIOD)

    @property
    def reference(self):
        return self.system.GetOutputPort("reference").Eval(self.context).reshape(-1, M)

    def record(self, name):
        row = self.system.GetOutputPort("record").Eval(self.context)
        return row[self.system.block.layout.fields[name]]


def test_a_force_moves_the_reference_one_tick_later(robot):
    bench = Bench(robot, ServoDynamics(5e-3, 2e-3, PERIOD))
    bench.simulator.Initialize()
    np.testing.assert_allclose(bench.reference[0, :3], bench.y_t, atol=1e-12)
    assert not bench.reference[1].any()
    bench.advance(1)
    expected = PERIOD * PULL[:2] / (MASS + PERIOD * DAMPING)
    np.testing.assert_allclose(bench.reference[1, :2], expected, rtol=1e-12)
    np.testing.assert_array_equal(bench.record("force"), PULL[:3])


def test_a_damping_is_requested_or_not(robot):
    bench = Bench(robot, ServoDynamics(5e-3, 2e-3, PERIOD))
    bench.fix(damping=[-1.0])
    bench.advance(1)
    requested = {}
    for damping in (-1.0, 30.0):
        bench.fix(damping=[damping])
        requested[damping] = bench.reference[1, 0]
    assert requested[-1.0] == pytest.approx(PERIOD * PULL[0] / (MASS + PERIOD * DAMPING), rel=1e-12)
    assert requested[30.0] == pytest.approx(PERIOD * PULL[0] / (MASS + PERIOD * 30.0), rel=1e-12)
    assert bench.record("damping")[0] == 30.0


def test_the_floor_holds_the_reference(robot):
    """A robot that stands: its rest point does not move on, so that the floor stays 1 mm away."""
    bench = Bench(robot, ServoDynamics(5e-3, 0.0, PERIOD))
    bench.advance(200)
    downwards = -bench.reference[1, 2]
    assert downwards == pytest.approx(1e-3 / PARAMETERS.approach_time, rel=1e-9)
    assert bench.record("near")[0] == 0.0
    assert bench.record("near")[1] == pytest.approx(1e-3, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 4])
def test_a_filtered_reference_comes_to_rest_on_the_floor(robot, degree):
    bench = Bench(robot, FilterDynamics(degree, 3e-3, PERIOD), order=degree)
    lowest = math.inf
    for _ in range(40):
        bench.advance(5)
        lowest = min(lowest, bench.reference[0, 2] - bench.y_t[2])
    assert lowest == pytest.approx(-1e-3, abs=2e-6)
    assert bench.record("mode")[0] == 1.0
    assert bench.record("labels").tolist() == [1.0]
    # it slides on along the floor
    assert bench.reference[1, 0] == pytest.approx(PULL[0] / DAMPING, rel=0.02)


def test_nothing_moves_before_the_sensor_is_ready(robot):
    bench = Bench(robot, ServoDynamics(5e-3, 2e-3, PERIOD))
    bench.fix(ready=[0.0])
    bench.advance(20)
    assert not bench.reference[1].any()
    bench.fix(ready=[1.0])
    bench.advance(2)
    assert bench.reference[1].any()
    bench.fix(ready=[0.0])  # once is enough
    before = bench.reference[1, 0]
    bench.advance(5)
    assert bench.reference[1, 0] > before


def test_a_force_that_is_no_number_counts_as_none(robot):
    bench = Bench(robot, ServoDynamics(5e-3, 2e-3, PERIOD))
    bench.advance(20)
    before = bench.reference[1].copy()
    bench.fix(wrench=[np.nan] * 6)
    bench.advance(2)
    assert np.isfinite(bench.reference).all()
    assert np.abs(bench.reference[1] - before).max() < 1e-2


def test_a_state_that_is_no_number_asks_for_nothing(robot):
    bench = Bench(robot, ServoDynamics(5e-3, 2e-3, PERIOD))
    bench.advance(20)
    names = set(bench.system.states) - {"force", "ready"}
    before = {name: bench.system.state(bench.context, name) for name in names}
    bench.fix(joint_state=[np.nan] * 24)
    bench.advance(1)
    assert not bench.reference[1].any()
    for name, value in before.items():
        np.testing.assert_array_equal(bench.system.state(bench.context, name), value)
    assert np.isnan(bench.record("point")).all()


def test_who_is_sampled_at_a_tick_sees_what_is_logged(robot):
    """A hold of the same period, whose discrete update follows the guidance's own."""
    bench = Bench(robot, FilterDynamics(2, 3e-3, PERIOD))
    builder = DiagramBuilder()
    builder.AddSystem(bench.system)
    hold = builder.AddSystem(ZeroOrderHold(PERIOD, 3 * M))
    builder.Connect(bench.system.GetOutputPort("reference"), hold.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    context = bench.system.GetMyMutableContextFromRoot(root)
    n = robot.n
    values = {"joint_state": [*bench.q, *np.zeros(n)] * 2, "wrench": PULL, "ready": [1.0]}
    for name, value in values.items():
        bench.system.GetInputPort(name).FixValue(context, np.array(value, dtype=float))
    reference, held_reference = bench.system.GetOutputPort("reference"), hold.get_output_port()
    for k in range(1, 6):
        logged = reference.Eval(context).copy()
        simulator.AdvanceTo(k * PERIOD)
        np.testing.assert_array_equal(held_reference.Eval(hold.GetMyContextFromRoot(root)), logged)
        assert (k < 2) or np.any(reference.Eval(context) != logged)


def test_two_contexts_do_not_share_their_memory(robot):
    bench = Bench(robot, FilterDynamics(2, 3e-3, PERIOD))
    bench.simulator.Initialize()
    other = bench.context.Clone()
    bench.advance(50)
    assert bench.system.state(bench.context, "velocity").any()
    assert not bench.system.state(other, "velocity").any()
    twin = bench.context.Clone()
    bench.advance(1)
    fresh = Simulator(bench.system, twin)
    fresh.Initialize(InitializeParams(suppress_initialization_events=True))
    fresh.AdvanceTo(bench.context.get_time())
    port = bench.system.GetOutputPort("record")
    np.testing.assert_array_equal(port.Eval(twin), port.Eval(bench.context))


def test_regions_can_be_switched_off(robot):
    bench = Bench(robot, ServoDynamics(5e-3, 0.0, PERIOD))
    bench.fix(active=[0.0])
    bench.advance(200)
    assert -bench.reference[1, 2] > 0.2
    bench.fix(active=[1.0])
    bench.advance(1)
    assert -bench.reference[1, 2] == pytest.approx(1e-3 / PARAMETERS.approach_time, rel=1e-9)
