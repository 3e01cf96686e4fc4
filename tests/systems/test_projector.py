"""The projector onto a surface alone: start, memory, revolutions, missing inputs."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.geometry import ProjectionStatus
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator
from pfsc_drake.systems.block_system import BlockSystem

PERIOD, ORDER, RADIUS = 1e-3, 2, 0.3


class Bench:
    """A projector in a context, with the tool at a given point."""

    def __init__(self, surface):
        self.evaluator = SurfaceEvaluator(surface, ORDER)
        self.layout = SurfaceManifold(ORDER).layout
        self.system = BlockSystem(Projector(self.evaluator), PERIOD)
        self.context = self.system.CreateDefaultContext()

    def move_to(self, y_t):
        pose = np.concatenate([y_t, np.eye(3).ravel()])
        self.system.GetInputPort("tool_pose").FixValue(self.context, pose)

    def start(self):
        self.simulator = Simulator(self.system, self.context)
        self.simulator.Initialize()

    def tick(self):
        self.simulator.AdvanceTo(self.context.get_time() + PERIOD)

    @property
    def output(self):
        return self.system.GetOutputPort("manifold_point").Eval(self.context)

    def point(self, field):
        return self.output[getattr(self.layout, field)]

    @property
    def memory(self):
        return self.system.state(self.context, "projection")


def around(angle, height=0.0, radius=RADIUS):
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


@pytest.fixture(name="pipe")
def fixture_pipe():
    return Bench(cylinder(RADIUS, (-1.0, 1.0), Turned()))


def test_the_start_is_found_on_the_whole_surface(pipe):
    pipe.move_to(around(4.0, 0.7, 0.35))
    pipe.start()
    np.testing.assert_allclose(pipe.memory, [4.0, 0.7, 0.0, 0.0], atol=1e-9)
    assert pipe.point("status") == [ProjectionStatus.OK]


def test_a_specified_projection_is_used(pipe):
    """Coordinates start from it, also a revolution later."""
    pipe.system.set_state(pipe.context, "projection", np.array([4.0 + 2.0 * np.pi, 0.7, 5.0, -2.0]))
    pipe.move_to(around(4.1, 0.7))
    pipe.start()
    np.testing.assert_allclose(pipe.point("theta"), [4.1 + 2.0 * np.pi, 0.7], atol=1e-9)
    np.testing.assert_allclose(pipe.point("eta"), [5.0 + 0.1 * RADIUS, -2.0], atol=1e-9)


@pytest.mark.slow
def test_the_output_is_the_evaluators_own():
    bench = Bench(paraboloid(((-0.2, 0.2), (-0.2, 0.2)), 1.0))
    y_t = [0.05, -0.03, 0.02]
    bench.move_to(y_t)
    bench.start()
    theta = bench.memory[:2].tolist()
    np.testing.assert_array_equal(bench.output, bench.evaluator(y_t, theta, [0.0, 0.0]))
    assert bench.output.shape == (bench.layout.size,)


def test_revolutions_are_counted(pipe):
    pipe.move_to(around(0.1))
    pipe.start()
    for turned in np.arange(0.1, 13.0, 0.1):
        pipe.move_to(around(turned, 0.01 * turned))
        pipe.tick()
    pipe.move_to(around(13.0, 0.13, 1.1 * RADIUS))
    np.testing.assert_allclose(pipe.point("theta"), [13.0, 0.13], atol=1e-9)
    np.testing.assert_allclose(pipe.point("eta"), [12.9 * RADIUS, 0.13], atol=1e-9)


def test_the_projection_changes_with_the_ticks_alone(pipe):
    """A motion evaluated within a tick leaves no trace."""
    pipe.move_to(around(0.0))
    pipe.start()
    for angle in (0.3, -0.3, 0.2):
        pipe.move_to(around(angle))
        np.testing.assert_allclose(pipe.point("eta"), [angle * RADIUS, 0.0], atol=1e-9)
    np.testing.assert_allclose(pipe.memory, 0.0, atol=1e-12)
    pipe.tick()
    pipe.tick()
    np.testing.assert_allclose(pipe.memory, [0.2, 0.0, 0.2 * RADIUS, 0.0], atol=1e-9)


def test_a_position_that_is_not_finite_does_not_delete_the_projection(pipe):
    pipe.move_to(around(1.0))
    pipe.start()
    before = pipe.memory.copy()
    pipe.move_to([np.nan, 0.0, 0.0])
    pipe.tick()
    pipe.tick()
    assert pipe.point("status") == [ProjectionStatus.NOT_CONVERGED]
    np.testing.assert_array_equal(pipe.memory, before)
    pipe.move_to(around(1.1))
    np.testing.assert_allclose(pipe.point("theta"), [1.1, 0.0], atol=1e-9)


def test_beyond_the_end_of_an_open_direction_the_surface_goes_on_for_a_quarter_of_it(pipe):
    pipe.move_to(around(1.0, 0.9))
    pipe.start()
    pipe.move_to(around(1.0, 1.2))
    assert pipe.point("status") == [ProjectionStatus.BEYOND_END]
    np.testing.assert_allclose(pipe.point("theta"), [1.0, 1.2], atol=1e-9)
    np.testing.assert_allclose(pipe.point("eta"), [0.0, 0.3], atol=1e-9)
    pipe.move_to(around(1.0, 1.6))
    assert pipe.point("status") == [ProjectionStatus.BEYOND_END]
    np.testing.assert_allclose(pipe.point("theta"), [1.0, 1.5], atol=1e-9)
