"""The projector alone: start, memory, revolutions, branches."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.geometry import FourierCurve, Path, PiecewisePolynomialCurve, ProjectionStatus
from pfsc_drake.systems.block_system import BlockSystem

PERIOD = 1e-3


class Bench:
    """A projector in a context, with the tool at a given point."""

    def __init__(self, path, relative_degree=2):
        self.layout = path.evaluator(relative_degree).layout
        self.system = BlockSystem(Projector(path.evaluator(relative_degree)), PERIOD)
        self.context = self.system.CreateDefaultContext()

    def move_to(self, y_t):
        pose = np.concatenate([y_t, np.eye(3).ravel()])
        self.system.GetInputPort("tool_pose").FixValue(self.context, pose)

    def start(self):
        self.simulator = Simulator(self.system, self.context)
        self.simulator.Initialize()

    def tick(self):
        self.simulator.AdvanceTo(self.context.get_time() + PERIOD)

    def point(self, field):
        layout = self.layout
        return self.system.GetOutputPort("manifold_point").Eval(self.context)[
            getattr(layout, field)
        ]

    @property
    def memory(self):
        return self.system.state(self.context, "projection")


def test_the_start_is_found_on_the_whole_path(path):
    for theta in (0.1, 2.0, 4.0, 6.0):
        bench = Bench(path)
        bench.move_to(path.position.derivatives(theta, 0)[0])
        bench.start()
        assert bench.memory == pytest.approx([theta], abs=1e-9)
        assert bench.point("theta") == pytest.approx([theta], abs=1e-9)
        assert bench.point("status") == [ProjectionStatus.OK]


def test_the_output_is_the_paths_own(path):
    bench = Bench(path, 3)
    y_t = path.position.derivatives(1.2, 0)[0] + [0.01, -0.01, 0.02] * np.ones(3)
    bench.move_to(y_t)
    bench.start()
    expected = path.evaluator(3)(y_t.tolist(), 1.2)
    output = bench.system.GetOutputPort("manifold_point").Eval(bench.context)
    assert output.shape == (bench.layout.size,)
    assert np.allclose(output, expected, rtol=1e-10, atol=1e-11)


def test_the_parameter_is_the_only_memory(path):
    bench = Bench(path)
    assert list(bench.system.states) == ["projection"]
    assert bench.memory.shape == (1,)


def test_revolutions_are_counted():
    circle = FourierCurve.circle([0.0, 0.0, 0.5], 0.3)
    bench = Bench(Path(circle))
    bench.move_to(circle.derivatives(0.1, 0)[0])
    bench.start()
    for turned in np.arange(0.1, 13.0, 0.1):
        bench.move_to(circle.derivatives(turned, 0)[0])
        bench.tick()
    bench.move_to(circle.derivatives(13.0, 0)[0] * [1.1, 1.1, 1.0])
    assert bench.point("theta") == pytest.approx([13.0], abs=1e-11)
    assert bench.point("eta") == pytest.approx([13.0 * 0.3], abs=1e-9)
    # and back again
    for turned in np.arange(13.0, -7.0, -0.1):
        bench.move_to(circle.derivatives(turned, 0)[0])
        bench.tick()
    bench.move_to(circle.derivatives(-7.0, 0)[0])
    assert bench.point("eta") == pytest.approx([-7.0 * 0.3], abs=1e-9)


@pytest.mark.parametrize("theta", [0.5 * np.pi, 1.5 * np.pi])
def test_a_specified_parameter_chooses_the_branch_at_the_crossing(path, theta):
    """At the crossing the two branches differ in their tangents."""
    bench = Bench(path)
    crossing = path.position.derivatives(0.5 * np.pi, 0)[0]
    assert np.allclose(crossing, path.position.derivatives(1.5 * np.pi, 0)[0], atol=1e-12)
    bench.move_to(crossing)
    bench.system.set_state(bench.context, "projection", np.array([theta + 0.02]))
    bench.start()
    assert bench.point("theta") == pytest.approx([theta], abs=1e-9)
    tangent = bench.point("position")[3:6]
    assert np.allclose(tangent, path.position.derivatives(theta, 1)[1], atol=1e-9)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_branch_is_continued_through_the_crossing(path, direction):
    bench = Bench(path)
    begin = 0.5 * np.pi - 0.3 * direction
    bench.move_to(path.position.derivatives(begin, 0)[0])
    bench.start()
    for theta in begin + direction * np.arange(0.0, 0.6, 0.01):
        bench.move_to(path.position.derivatives(theta, 0)[0])
        bench.tick()
        assert bench.memory == pytest.approx([theta], abs=1e-9)


def test_the_output_changes_nothing_by_being_read(path):
    bench = Bench(path)
    bench.move_to(path.position.derivatives(1.0, 0)[0])
    bench.start()
    before = bench.memory.copy()
    bench.move_to(path.position.derivatives(1.1, 0)[0])
    assert bench.point("theta") == pytest.approx([1.1], abs=1e-9)
    assert np.array_equal(bench.memory, before)
    bench.tick()
    assert bench.memory == pytest.approx([1.1], abs=1e-9)


def test_beyond_the_end_of_an_open_path():
    line = PiecewisePolynomialCurve([0.0, 0.5], np.array([[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]]))
    bench = Bench(Path(line))
    bench.move_to([0.4, 0.01, 1.0])
    bench.start()
    assert bench.point("status") == [ProjectionStatus.OK]
    bench.move_to([0.7, 0.01, 1.0])
    assert bench.point("status") == [ProjectionStatus.BEYOND_END]
    # the straight run-out is a tenth of the path long
    assert bench.point("theta") == pytest.approx([0.55], abs=1e-12)
    assert bench.point("eta") == pytest.approx([0.7], abs=1e-12)


def test_a_tool_that_is_nowhere_is_reported_and_forgotten(path):
    """After one bad measurement the projection goes on from where it was."""
    bench = Bench(path)
    good = path.position.derivatives(1.0, 0)[0]
    bench.move_to(good)
    bench.start()
    bench.move_to([np.nan, 0.0, 1.0])
    assert bench.point("status") == [ProjectionStatus.NOT_CONVERGED]
    bench.tick()
    bench.move_to(good)
    assert bench.point("status") == [ProjectionStatus.OK]
    assert bench.point("theta") == pytest.approx([1.0], abs=1e-9)
