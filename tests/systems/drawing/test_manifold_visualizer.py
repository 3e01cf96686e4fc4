"""Paths, surfaces and regions in Meshcat; colours of signed values."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.tasks.drawing import SurfaceDrawing
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator

RADIUS, ORIGIN = 0.2, np.array([0.5, 0.0, 1.0])
OUTSIDE = ORIGIN + np.array([0.0, 0.25, 0.1])
FOOT = ORIGIN + np.array([0.0, RADIUS, 0.1])


class MeshcatSpy:
    """Records drawings; the last transform of every path with its time."""

    def __init__(self):
        self.meshes, self.lines, self.objects, self.transforms = {}, {}, {}, {}

    def SetTriangleMesh(self, path, vertices, faces, color):
        self.meshes[path] = (np.array(vertices), np.array(faces))

    def SetLine(self, path, vertices, width, color):
        self.lines[path] = np.array(vertices)

    def SetObject(self, path, shape, color):
        self.objects[path] = (shape, color)

    def SetTransform(self, path, X, time_in_recording=None):
        self.transforms[path] = (X, time_in_recording)


@pytest.fixture(name="drawn")
def fixture_drawn():
    """Return a function that draws a cylinder, and its frame next to a point."""

    def draw(point=None):
        surface = cylinder(RADIUS, (0.0, 0.3), Turned(ORIGIN))
        manifold = SurfaceManifold(1)
        evaluated = SurfaceEvaluator(surface, 1)(OUTSIDE.tolist(), [1.5, 0.1], [0.0, 0.0])
        spy, builder = MeshcatSpy(), DiagramBuilder()
        port = SurfaceDrawing(surface, manifold).add(builder, spy, 0.1)
        source = builder.AddSystem(ConstantVectorSource(evaluated if point is None else point))
        builder.Connect(source.get_output_port(), port)
        Simulator(builder.Build()).AdvanceTo(0.11)
        return spy, evaluated

    return draw


def test_skin_and_lines_lie_on_the_surface(drawn):
    spy, _ = drawn()
    ((vertices, _),) = spy.meshes.values()
    for points in (vertices.T, *(line.T for line in spy.lines.values())):
        off = points - ORIGIN
        np.testing.assert_allclose(np.hypot(off[:, 0], off[:, 1]), RADIUS, atol=1e-12)
        assert off[:, 2].min() >= -1e-12 and off[:, 2].max() <= 0.3 + 1e-12
    assert len(spy.lines) == 22


def test_the_skin_is_closed_and_visible_from_both_sides(drawn):
    spy, _ = drawn()
    ((vertices, faces),) = spy.meshes.values()
    corners = vertices.T[faces.T]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1).sum()
    assert area == pytest.approx(2.0 * 2.0 * np.pi * RADIUS * 0.3, rel=2e-3)
    np.testing.assert_allclose(cross.sum(axis=0), 0.0, atol=1e-12)


def test_the_frame_stands_on_the_surface_with_its_third_axis_along_the_normal(drawn):
    spy, _ = drawn()
    X_WF, time = spy.transforms["surface_following/frame"]
    assert time == 0.1
    np.testing.assert_allclose(X_WF.translation(), FOOT, atol=1e-9)
    expected = [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]  # around, up, outward
    np.testing.assert_allclose(X_WF.rotation().matrix().T, expected, atol=1e-9)
    assert {"surface_following/frame/axis_0", "surface_following/frame/axis_2"} <= set(spy.objects)


def test_a_point_that_is_none_is_not_drawn(drawn):
    _, evaluated = drawn()
    spy, _ = drawn(np.full(len(evaluated), np.nan))
    assert "surface_following/frame" not in spy.transforms
    assert spy.meshes
