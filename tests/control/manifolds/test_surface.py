"""Jets of tangential, transversal and rotational coordinates of a surface along tool motions."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.jets import constant
from tests.control.manifolds.surfaces import (
    SITUATIONS,
    GivenOrientation,
    frame,
    further_coordinates,
    project,
    reference_rotation,
    surface,
    surface_point,
)
from tests.control.manifolds.tool_motion import (
    NODES,
    ORDER,
    ToolMotion,
    assert_derivatives,
    interpolant,
)

OFFSET = np.diag([1.0, -1.0, -1.0]) @ zyx_to_matrix([0.2, 0.15, -0.3])
ORIENTATIONS = {
    "none": {},
    "normal": {"orientation": "normal"},
    "lead and tilt": {"orientation": "normal", "offset": OFFSET},
    "axis": {"orientation": "normal", "offset": OFFSET, "tool_axis": [0.0, 0.0, 1.0]},
    "given": {"orientation": "given"},
    "axis of a given one": {"orientation": "given", "tool_axis": [0.2, -0.4, 0.3]},
    "euler": {"orientation": "normal", "offset": OFFSET, "euler": "zyz"},
    "turn": {"orientation": "normal", "yaw_axis": [0.0, 0.0, 1.0]},
}
ETA = (0.3, -0.2)


def tool_motion(manifold, geometry, theta, distance, given, rng):
    """Return a motion along and across the surface that begins at a distance from a place."""
    sigma, _, axes = frame(geometry, theta)
    angles = np.zeros(3)
    if len(manifold.coordinates) > 3:
        R_d = reference_rotation(manifold, geometry, theta, given)
        angles = Rotation.from_matrix(R_d).as_euler("ZYX") + 0.1
    velocity = axes @ [0.12, -0.1, 0.03]
    return ToolMotion(sigma + distance * axes[:, 2], velocity, angles, rng)


def jets_of_outputs(manifold, point, motion, order=ORDER):
    """Return derivatives 0..order of the outputs, one row each."""
    y, R_e = motion.y.truncate(order), motion.R.truncate(order)
    outputs = manifold.virtual_output(y, R_e, ca.SX(point), [])
    return np.array([[float(ca.evalf(x.derivative(k))) for x in outputs] for k in range(order + 1)])


def outputs_over_time(manifold, geometry, theta, motion, given):
    """Return the outputs at NODES by root finding and quadrature, one row each."""
    poses = [motion.at(t) for t in NODES]
    places = np.array([project(geometry, y_t, theta) for y_t, _ in poses])
    rates = np.column_stack([interpolant(column).deriv()(NODES) for column in places.T])
    along = []
    for place, rate in zip(places, rates, strict=True):
        _, slopes, axes = frame(geometry, place)
        along.append(axes[:, :2].T @ slopes.T @ rate)
    lengths = [interpolant(column).integ(lbnd=0.0)(NODES) for column in np.array(along).T]
    further = [
        further_coordinates(manifold, geometry, place, *pose, given)
        for place, pose in zip(places, poses, strict=True)
    ]
    return np.column_stack([np.transpose(lengths) + ETA, further])


@pytest.mark.slow(but="axis-cylinder")
@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_jets_are_derivatives_of_the_outputs(situation, orientation):
    theta, distance = SITUATIONS[situation]
    geometry, given = surface(situation), GivenOrientation(zyx_to_matrix([0.4, 0.3, 2.8]))
    manifold = SurfaceManifold(ORDER, **ORIENTATIONS[orientation])
    motion = tool_motion(manifold, geometry, theta, distance, given, np.random.default_rng(4))
    point = surface_point(manifold, geometry, motion.at(0.0)[0], theta, ETA, given)
    jets = jets_of_outputs(manifold, point, motion)
    assert np.abs(jets[1:]).min(axis=1).max() > 0.005
    assert_derivatives(jets, outputs_over_time(manifold, geometry, theta, motion, given))
    # lower orders are the beginning of higher ones
    for order in range(1, ORDER):
        lower = SurfaceManifold(order, **ORIENTATIONS[orientation])
        point = surface_point(lower, geometry, motion.at(0.0)[0], theta, ETA, given)
        rows = jets_of_outputs(lower, point, motion, order)
        assert np.allclose(rows, jets[: order + 1], rtol=1e-12, atol=1e-12)


def test_the_situations_are_far_and_bent():
    """Half way to the axis of the cylinder, and both signs of curvature on the saddle."""
    alphas = {}
    for name, (theta, distance) in SITUATIONS.items():
        manifold = SurfaceManifold(2)
        sigma, _, axes = frame(surface(name), theta)
        point = surface_point(manifold, surface(name), sigma + distance * axes[:, 2], theta)
        alphas[name] = point[manifold.layout.alpha][0]
        assert np.allclose(manifold.axes(point).full(), axes, atol=1e-12)
    assert alphas["cylinder"] == pytest.approx(0.5, abs=1e-12)
    assert all(alpha != 0.0 for alpha in alphas.values())


def test_coordinates_are_named_by_their_meaning():
    names = [c.name for c in SurfaceManifold(2, orientation="normal").coordinates]
    assert names == ["eta_1", "eta_2", "xi", "phi_z", "phi_y", "phi_x"]
    kinds = [c.kind for c in SurfaceManifold(2).coordinates]
    assert kinds == [Kind.TANGENTIAL, Kind.TANGENTIAL, Kind.TRANSVERSAL]
    axis = SurfaceManifold(2, orientation="normal", tool_axis=[0, 0, 2.0])
    assert [c.force for c in axis.coordinates[3:]] == ["tau_z", "tau_y"]
    assert np.allclose(axis.tool.tool_axis, [0, 0, 1])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"orientation": "upwards"}, "orientation 'upwards': unknown; allowed are given, normal"),
        ({"offset": np.eye(3)}, "offset: given for the orientation 'None'; only 'normal'"),
        ({"orientation": "normal", "offset": 2 * np.eye(3)}, "offset: R'R differs"),
        ({"tool_axis": [0, 0, 1]}, r"tool axis \[0, 0, 1\]: the surface has no orientation"),
    ],
)
def test_wrong_input_is_refused(keys, message):
    with pytest.raises(InputError, match=message):
        SurfaceManifold(2, **keys)


@pytest.mark.slow(but=["lead and tilt", "given"])
@pytest.mark.parametrize("orientation", ["normal", "lead and tilt", "given"])
def test_a_tool_in_the_reference_orientation_has_no_angles(orientation):
    theta, distance = SITUATIONS["saddle"]
    geometry = surface("saddle")
    given = GivenOrientation(zyx_to_matrix([0.4, 0.3, 2.8]))
    manifold = SurfaceManifold(ORDER, **ORIENTATIONS[orientation])
    motion = tool_motion(manifold, geometry, theta, distance, given, np.random.default_rng(4))
    point = surface_point(manifold, geometry, motion.at(0.0)[0], theta, ETA, given)
    (R_d,) = manifold.orientation(point[None])
    outputs = manifold.virtual_output(motion.y, constant(ca.SX(R_d), ORDER), ca.SX(point), [])
    angles = [float(ca.evalf(x.derivative(0))) for x in outputs[3:]]
    np.testing.assert_allclose(angles, 0.0, atol=1e-12)
