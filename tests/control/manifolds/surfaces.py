"""Surfaces of tests, and their coordinates by root finding, one place after the other."""

from functools import cache

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from pfsc_drake.geometry import FourierCurve, zyx_to_matrix
from pfsc_drake.geometry.path_on_surface import path_on_surface
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.shapes.torus import torus
from pfsc_drake.geometry.surfaces.parametric_surface import partial_orders
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator

# about horizontal, within reach of six axes
TILT = zyx_to_matrix([0.3, -0.2, 0.15])


@cache
def surface(name):
    """Return a surface by its name."""
    return {
        "paraboloid": lambda: paraboloid(
            ((-0.3, 0.3), (-0.3, 0.3)), -0.9, [0.85, 0.05, 0.85], TILT
        ),
        "cylinder": lambda: cylinder(
            0.25, (-0.3, 0.3), Turned([0.85, 0.0, 0.6], TILT, inward=True)
        ),
        "saddle": lambda: torus(0.5, 0.2, Turned([0.9, 0.0, 0.7], TILT)),
    }[name]()


@cache
def path_on_cylinder():
    """Return an oval on the cylinder, oblique to its axis, whose frame turns to and fro."""
    return path_on_surface(
        surface("cylinder"), FourierCurve([0.7, 0.04], [[0.5, 0.05]], [[0.1, 0.15]])
    )


# a place, and the tool's distance from there along the normal
SITUATIONS = {
    "paraboloid": ((0.11, -0.07), 0.02),
    "cylinder": ((0.7, 0.04), 0.125),
    # on the inner side, where it bends both ways
    "saddle": ((1.1, 2.2), -0.05),
}


def frame(geometry, theta):
    """Return ``sigma_t``, both slopes, and ``[t_1, t_2, e_perp]`` by Gram and Schmidt."""
    sigma, s_1, s_2 = geometry.partials(np.asarray(theta), 1)
    t_1 = s_1 / np.linalg.norm(s_1)
    t_2 = s_2 - (t_1 @ s_2) * t_1
    t_2 /= np.linalg.norm(t_2)
    return sigma, np.array([s_1, s_2]), np.column_stack([t_1, t_2, np.cross(t_1, t_2)])


def project(geometry, y_t, guess):
    """Return the parameters where the offset is across both slopes."""

    def across(theta):
        sigma, slopes, _ = frame(geometry, theta)
        return slopes @ (y_t - sigma)

    found = root(across, guess, tol=1e-15)
    assert np.abs(found.fun).max() < 1e-14
    return found.x


class GivenOrientation:
    """A quaternion of any norm that changes with both parameters, quadratically."""

    def __init__(self, R_0, seed=3):
        self.theta = np.zeros(2)
        rng = np.random.default_rng(seed)
        self.terms = {ij: 0.3 * rng.uniform(-1, 1, 4) for ij in partial_orders(2)}
        self.terms[0, 0] = 1.7 * np.roll(Rotation.from_matrix(R_0).as_quat(), 1)

    def quaternion(self, theta):
        a, b = theta
        return sum(c * a**i * b**j for (i, j), c in self.terms.items())

    def partials(self, theta, order):
        """Return partial derivatives, one row each."""
        (a, b), c = theta, self.terms
        rows = {
            (0, 0): self.quaternion(theta),
            (1, 0): c[1, 0] + 2 * a * c[2, 0] + b * c[1, 1],
            (0, 1): c[0, 1] + 2 * b * c[0, 2] + a * c[1, 1],
            (2, 0): 2 * c[2, 0],
            (1, 1): c[1, 1],
            (0, 2): 2 * c[0, 2],
        }
        return np.array([rows.get(ij, np.zeros(4)) for ij in partial_orders(order)])

    def rotation(self, theta):
        return Rotation.from_quat(np.roll(self.quaternion(theta), -1)).as_matrix()


def surface_point(manifold, geometry, y_t, guess, eta=(0.0, 0.0), given=None):
    """Return the surface point next to a tool, with partial derivatives of a given orientation."""
    layout = manifold.layout
    evaluator = SurfaceEvaluator(geometry, layout.order, [1, 0, 0, 0] if layout.oriented else None)
    point = evaluator(list(y_t), guess, eta)
    if layout.oriented:
        partials = given.partials(point[layout.theta], layout.order)
        point[layout.quaternion] = partials.ravel()
    return point


def reference_rotation(manifold, geometry, theta, given=None):
    """Return ``R_d``."""
    if manifold.layout.oriented:
        return given.rotation(theta)
    return frame(geometry, theta)[2] @ manifold.offset


def euler_difference(R_e, R_d, convention):
    """Return the Euler angles of one rotation less those of another, between -pi and pi."""
    e, d = (Rotation.from_matrix(R).as_euler(convention.upper()) for R in (R_e, R_d))
    return (e - d + np.pi) % (2.0 * np.pi) - np.pi


def further_coordinates(manifold, geometry, theta, y_t, R_e, given=None):
    """Return xi and the angles of a tool."""
    sigma, _, axes = frame(geometry, theta)
    xi = axes[:, 2] @ (y_t - sigma)
    if len(manifold.coordinates) == 3:
        return np.array([xi])
    R_d = reference_rotation(manifold, geometry, theta, given)
    C = np.eye(3) if manifold.tool.alignment is None else manifold.tool.alignment
    angles = Rotation.from_matrix(C.T @ R_d.T @ R_e @ C).as_euler("ZYX")
    if manifold.tool.yaw_axis is not None:
        *v, w = Rotation.from_matrix(R_e @ R_d.T).as_quat(canonical=True)
        angles = [2.0 * np.arctan2(manifold.tool.yaw_axis @ v, w)]
    if manifold.tool.euler is not None:
        angles = euler_difference(R_e, R_d, manifold.tool.euler)
    return np.array([xi, *angles[: len(manifold.coordinates) - 3]])
