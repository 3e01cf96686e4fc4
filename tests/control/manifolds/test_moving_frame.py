"""Manifolds in a frame that moves, against differentiation along motions of tool and frame."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.manifolds.moving_frame import (
    FramedLayout,
    MovingFrameManifold,
    frame_jets,
    frame_size,
    frame_vector,
    relative_to,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator
from pfsc_drake.jets import Jet
from tests.control.manifolds.surfaces import frame as surface_frame
from tests.control.manifolds.surfaces import project
from tests.control.manifolds.tool_motion import (
    NODES,
    ORDER,
    ToolMotion,
    assert_derivatives,
    interpolant,
)


def numbers(jets):
    """Return derivatives 0..r of scalar jets, one row each."""
    columns = [[float(ca.DM(c)) for c in jet.derivatives()] for jet in jets]
    return np.array(columns).T


def seen(tool, frame, t):
    """Return the tool in the frame by plain matrices."""
    y, R_e = tool.at(t)
    p, R = frame.at(t)
    return R.T @ (y - p), R.T @ R_e


@pytest.fixture
def motions():
    """A tool near (0.7, 0.2, 1.1), and a frame that moves and turns, its origin elsewhere."""
    rng = np.random.default_rng(5)
    tool = ToolMotion([0.9, 0.1, 1.0], [0.3, 0.2, -0.1], [0.2, 0.1, -0.3], rng)
    frame = ToolMotion([0.2, -0.1, 0.05], [-0.2, 0.25, 0.3], [0.4, -0.2, 0.3], rng)
    return tool, frame


def test_a_tool_relative_to_a_moving_frame(motions):
    tool, frame = motions
    y_C, R_Ce = relative_to(frame.y, frame.R, tool.y, tool.R)
    samples = [seen(tool, frame, t) for t in NODES]
    derivatives = numbers([y_C[i] for i in range(3)])
    assert_derivatives(derivatives, np.array([y for y, _ in samples]))
    elements = [(0, 0), (1, 2), (2, 1)]
    derivatives = numbers([R_Ce[element] for element in elements])
    assert_derivatives(derivatives, np.array([[R[e] for e in elements] for _, R in samples]))


def test_velocity_and_acceleration_are_those_of_mechanics(motions):
    """``a_C = R' (a - a_p - w' x d - w x (w x d) - 2 w x v_rel)``, v_rel in the world's axes."""
    tool, frame = motions
    y, p, R = tool.y, frame.y, frame.R
    d, v, a = (np.array(ca.DM(y.derivative(k) - p.derivative(k))).ravel() for k in range(3))
    R_0, R_1, R_2 = (np.array(ca.DM(R.derivative(k))) for k in range(3))
    W = R_1 @ R_0.T
    w = np.array([W[2, 1], W[0, 2], W[1, 0]])
    turning = R_2 @ R_0.T - W @ W
    w_dot = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    v_rel = v - np.cross(w, d)
    a_rel = a - np.cross(w_dot, d) - np.cross(w, np.cross(w, d)) - 2.0 * np.cross(w, v_rel)
    y_C, _ = relative_to(p, R, y, tool.R)
    assert np.allclose(np.array(ca.DM(y_C.derivative(1))).ravel(), R_0.T @ v_rel, atol=1e-14)
    assert np.allclose(np.array(ca.DM(y_C.derivative(2))).ravel(), R_0.T @ a_rel, atol=1e-13)


def test_path_coordinates_in_the_frame(motions, oriented_path, virtual_output):
    """Order 4, orientation included; along, across and angles of samples seen from the frame."""
    tool, frame = motions
    manifold = MovingFrameManifold(PathManifold(ORDER, oriented=True))
    own = oriented_path.evaluator(ORDER)
    y_C, _ = seen(tool, frame, 0.0)
    theta = oriented_path.nearest(y_C)
    point = np.concatenate([own(y_C.tolist(), theta), whole(frame)])
    jets = manifold.virtual_output(tool.y, tool.R, ca.SX(ca.DM(point)), [])
    derivatives = numbers(jets)
    samples = np.array([virtual_output(oriented_path, *seen(tool, frame, t)) for t in NODES])
    assert manifold.layout.size == own.layout.size + frame_size(ORDER) == len(point)
    assert_derivatives(derivatives, samples)


def test_surface_coordinates_in_the_frame(motions):
    """The rates of the tangential coordinates, and the distance of the samples."""
    tool, frame = motions
    dome = paraboloid(((-0.6, 0.6), (-0.6, 0.6)), -0.9, [0.7, 0.2, 0.7], np.eye(3))
    manifold = MovingFrameManifold(SurfaceManifold(ORDER, orientation="normal"))
    evaluator = SurfaceEvaluator(dome, ORDER)
    y_C, _ = seen(tool, frame, 0.0)
    theta = project(dome, y_C, [0.0, 0.0])
    own = evaluator(y_C.tolist(), theta.tolist(), (0.0, 0.0))
    point = np.concatenate([own, whole(frame)])
    derivatives = numbers(manifold.virtual_output(tool.y, tool.R, ca.SX(ca.DM(point)), []))
    places = []
    for t in NODES:
        y, R_Ce = seen(tool, frame, t)
        theta = project(dome, y, theta)
        sigma, _, axes = surface_frame(dome, theta)
        angles = Rotation.from_matrix(axes.T @ R_Ce).as_euler("ZYX")
        places.append([axes[:, 2] @ (y - sigma), *angles])
    assert_derivatives(derivatives[:, 2:], np.array(places))


def test_forces_have_the_power_of_the_relative_motion(motions, oriented_path):
    tool, frame = motions
    own = PathManifold(ORDER, oriented=True)
    manifold = MovingFrameManifold(own)
    y_C, _ = seen(tool, frame, 0.0)
    point = oriented_path.evaluator(ORDER)(y_C.tolist(), oriented_path.nearest(y_C))
    framed = ca.SX(ca.DM(np.concatenate([point, whole(frame)])))
    outputs = numbers(manifold.virtual_output(tool.y, tool.R, framed, []))
    wrench = np.array([3.0, -2.0, 5.0, 0.4, 0.3, -0.2])
    known = (ca.SX(ca.DM(wrench)), framed, ca.SX(ca.DM(outputs[0])))
    force = np.array(ca.DM(manifold.force(*known, with_turning=True))).ravel()
    y, R_e, p, R = tool.y, tool.R, frame.y, frame.R
    W = np.array(ca.DM(R.derivative(1) @ R.derivative(0).T))
    W_e = np.array(ca.DM(R_e.derivative(1) @ R_e.derivative(0).T))
    offset, velocity = (np.array(ca.DM(y.derivative(k) - p.derivative(k))).ravel() for k in (0, 1))
    relative = velocity - W @ offset
    turning = W_e - W
    w = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    power = wrench[:3] @ relative + wrench[3:] @ w
    assert force @ outputs[1] == pytest.approx(power, rel=1e-11)


def test_axes_are_those_of_the_world(motions, oriented_path):
    _, frame = motions
    own = PathManifold(ORDER, oriented=True)
    point = oriented_path.evaluator(ORDER).evaluate_at(0.7)
    framed = np.concatenate([point, whole(frame)])
    axes = np.array(ca.DM(MovingFrameManifold(own).axes(ca.DM(framed))))
    assert np.allclose(axes, frame.at(0.0)[1] @ np.array(ca.DM(own.axes(ca.DM(point)))), atol=1e-14)


def test_a_frame_as_a_vector_and_back(motions):
    _, frame = motions
    position, rotation = frame_jets(ca.DM(whole(frame)))
    for jet, given in ((position, frame.y), (rotation, frame.R)):
        for k in range(ORDER + 1):
            difference = ca.DM(jet.derivative(k)) - ca.DM(given.derivative(k))
            assert np.abs(difference.full()).max() < 1e-14
    values = np.array([frame.at(t)[1] for t in NODES])
    assert np.array(ca.DM(rotation.derivative(1)))[0, 1] == pytest.approx(
        interpolant(values[:, 0, 1]).deriv(1)(0.0), abs=1e-10
    )


def test_a_layout_is_the_manifolds_own_and_the_frame():
    own = PathManifold(2, oriented=False).layout
    layout = FramedLayout(own)
    assert (layout.alpha, layout.status, layout.order) == (own.alpha, own.status, 2)
    assert layout.frame == slice(own.size, own.size + 36)


def whole(frame):
    """Return a motion as a frame jet of numbers."""
    jets = Jet(frame.y.coefficients), Jet(frame.R.coefficients)
    return np.array(ca.DM(frame_vector(*jets))).ravel()


def test_the_rate_of_the_frame_is_a_part_of_the_point(motions):
    _, frame = motions
    manifold = MovingFrameManifold(PathManifold(3, oriented=False))
    own = np.full(manifold.layout.own.size, 7.0)
    point = ca.vertcat(own, frame_vector(frame.y.truncate(3), frame.R.truncate(3)))
    rates = np.array(ca.DM(manifold.frame_rate(point))).ravel()
    samples = np.array([np.append(*frame.at(t)) for t in NODES])
    for rate, values in zip(rates, samples.T, strict=True):
        assert rate == pytest.approx(float(interpolant(values).deriv()(0.0)), abs=1e-8)
