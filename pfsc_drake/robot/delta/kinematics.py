"""Kinematics of a DELTA robot with linear drives on jets (Sec. 2.2), and its workspace.

In (2.23) the last vector, from C_i to E, is ``-l_EC e_xi``; the dissertation's text has lost the
sign, while (2.24) and all that follows, with ``l = l_A - l_EC``, hold with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_parameters import NUM_ARMS, DeltaGeometry, DeltaParameters


def direct_kinematics(geometry: DeltaGeometry, q: Sequence[ca.SX]) -> ca.SX:
    """Return the end-effector position ``y_t = h_D(q)`` in closed form, (2.24)-(2.26).

    The constant term of (2.26) is ``c_0 = (b_1^2 + b_2^2)/d^2 + (b_1 d_1 + b_2 e_1)/d + g_1``:
    (2.25) put into (2.24) gives a plus where the dissertation's text has a minus, and with
    the minus the constraint (2.30) does not hold. Of the two points at the rods' distance
    from all slides this is the lower one, with the larger y_z.

    Args:
        geometry: Dimensions of the robot.
        q: Slide positions [m], three scalars.

    Returns:
        Shape (3, 1) [m], axes of the inertial frame (z_0 down).
    """
    k_D = 1.0 / geometry.rail_length
    length = geometry.l_A - geometry.l_EC
    cosine, sine = geometry.directions[:, 0], geometry.directions[:, 1]
    radius = [2.0 * (q_i * (k_D * geometry.l_A) - length) for q_i in q]
    d = [r * c for r, c in zip(radius, cosine, strict=True)]
    e = [r * s for r, s in zip(radius, sine, strict=True)]
    f = [-2.0 * k_D * geometry.h_P * q_i for q_i in q]
    g = [q_i * (q_i - 2.0 * k_D * geometry.l_A * length) for q_i in q]
    g = [g_i + (length**2 - geometry.l_BC**2) for g_i in g]
    denominator = _alternate(d, e)
    a_1, b_1 = _alternate(e, f) / denominator, _alternate(e, g) / denominator
    a_2, b_2 = -_alternate(d, f) / denominator, -_alternate(d, g) / denominator
    c_2 = a_1**2 + a_2**2 + 1.0
    c_1 = 2.0 * (a_1 * b_1 + a_2 * b_2) + a_1 * d[0] + a_2 * e[0] + f[0]
    c_0 = b_1**2 + b_2**2 + b_1 * d[0] + b_2 * e[0] + g[0]
    y_z = (-c_1 + ca.sqrt(c_1**2 - 4.0 * c_2 * c_0)) / (2.0 * c_2)
    return ca.vertcat(y_z * a_1 + b_1, y_z * a_2 + b_2, y_z)


def _alternate(x: Sequence[ca.SX], y: Sequence[ca.SX]) -> ca.SX:
    """Return ``x_1 (y_2 - y_3) + x_2 (y_3 - y_1) + x_3 (y_1 - y_2)``."""
    return x[0] * (y[1] - y[2]) + x[1] * (y[2] - y[0]) + x[2] * (y[0] - y[1])


@dataclass(frozen=True)
class RodMotion:
    """Motion of end-effector and rods, axes of the inertial frame.

    Attributes:
        geometry: Dimensions of the robot.
        y_t: End-effector position [m], vector jet of order r.
        rods: Vectors ``w_i`` from B_i to C_i (2.29) [m], three vector jets of order r.
        W_inverse: Inverse of ``W = [w_1, w_2, w_3]^T`` of (2.32) at order 0 [1/m], shape (3, 3).
    """

    geometry: DeltaGeometry
    y_t: Jet
    rods: Sequence[Jet]
    W_inverse: ca.SX

    def jacobian(self) -> ca.SX:
        """Return the manipulator Jacobian ``J_D = -W^-1 P`` (2.33), shape (3, 3)."""
        rails = self.geometry.rails
        P = [ca.dot(w.coefficients[0], rails[i]) for i, w in enumerate(self.rods)]
        return -self.W_inverse @ ca.diag(ca.vertcat(*P))

    def slide_forces(self, force: Jet) -> list[Jet]:
        """Return ``J_D^T force``, the end-effector's force as slide forces.

        The rods transmit it: ``W^T lambda = force`` is solved order by order, always with
        the inverse of order 0, and ``J_D^T force = -P lambda``.

        Args:
            force: Force at the end-effector [N], vector jet of some order up to r.

        Returns:
            Three scalar jets of the same order [N].
        """
        solution: list[ca.SX] = []
        for k, remaining in enumerate(force.coefficients):
            for j in range(1, k + 1):
                for i, w in enumerate(self.rods):
                    remaining = remaining - w.coefficients[j] * solution[k - j][i]
            solution.append(self.W_inverse.T @ remaining)
        rails = self.geometry.rails
        rod_forces = [Jet([s[i] for s in solution]) for i in range(NUM_ARMS)]
        return [-jets.dot(w, rails[i]) * rod_forces[i] for i, w in enumerate(self.rods)]


def rod_motion(geometry: DeltaGeometry, q: Sequence[Jet]) -> RodMotion:
    """Return the motion that belongs to a motion of the slides.

    Order 0 is the closed form; every higher order follows from the constraint
    ``w_i . w_i = l_BC^2`` (2.30), of which (2.31) is the first order::

        w_i0 . y_k = -q_ik (w_i0 . c_i) - 1/2 sum_{j=1}^{k-1} w_ij . w_i,k-j

    (2.33) says that W is regular unless two rods are parallel; it is also singular when the
    three rods lie parallel to one plane.

    Args:
        geometry: Dimensions of the robot.
        q: Slide positions [m], three scalar jets of order r >= 0.
    """
    rails, offsets = geometry.rails, geometry.offsets
    q_0 = [q_i.coefficients[0] for q_i in q]
    y = [direct_kinematics(geometry, q_0)]
    rods = [[y[0] - offsets[i] + q_0[i] * rails[i]] for i in range(NUM_ARMS)]
    W_inverse = _inverse_of_rows(*[w[0] for w in rods])
    P = [ca.dot(w[0], rails[i]) for i, w in enumerate(rods)]
    for k in range(1, min(q_i.order for q_i in q) + 1):
        q_k = [q_i.coefficients[k] for q_i in q]
        right = []
        for i, w in enumerate(rods):
            mixed = sum((ca.dot(w[j], w[k - j]) for j in range(1, k)), start=ca.SX(0.0))
            right.append(-P[i] * q_k[i] - 0.5 * mixed)
        y.append(W_inverse @ ca.vertcat(*right))
        for i, w in enumerate(rods):
            w.append(y[k] + q_k[i] * rails[i])
    return RodMotion(geometry, Jet(y), [Jet(w) for w in rods], W_inverse)


def _inverse_of_rows(a: ca.SX, b: ca.SX, c: ca.SX) -> ca.SX:
    """Return the inverse of the matrix with the rows a, b and c, each (3, 1)."""
    b_c = ca.cross(b, c)
    return ca.horzcat(b_c, ca.cross(c, a), ca.cross(a, b)) / ca.dot(a, b_c)


# a slide this far beyond its travel [m] is at its end but for rounding
_ROUNDING = 1e-12


def rod_vectors(geometry: DeltaGeometry, q: np.ndarray, y_t: np.ndarray) -> np.ndarray:
    """Return the rods ``w_i = y_t - (l_A - l_EC) e_xi + q_i c_i`` (2.29) by rows [m], (3, 3).

    Args:
        geometry: Dimensions of the robot.
        q: Slide positions [m], shape (3,).
        y_t: End-effector position [m], shape (3,), axes of the inertial frame (z_0 down).
    """
    return y_t - geometry.offsets + np.asarray(q)[:, None] * geometry.rails


def rod_independence(geometry: DeltaGeometry, q: np.ndarray, y_t: np.ndarray) -> float:
    """Return the smallest singular value of the three unit rod vectors.

    It is 1 for orthogonal rods and 0 where W of (2.32) is singular, that is where two
    rods are parallel or all three are parallel to one plane.

    Args:
        geometry: Dimensions of the robot.
        q: Slide positions [m], shape (3,).
        y_t: End-effector position that belongs to them [m], shape (3,).
    """
    rods = rod_vectors(geometry, q, y_t)
    units = rods / np.linalg.norm(rods, axis=1, keepdims=True)
    return float(np.linalg.svd(units, compute_uv=False)[-1])


def joint_coordinates(
    parameters: DeltaParameters, y_t: np.ndarray, name: str = "tool point"
) -> np.ndarray:
    """Return the slide positions ``q = h_D^-1(y_t)`` (2.27), (2.28).

    Args:
        parameters: The robot.
        y_t: End-effector position [m], shape (3,), axes of the inertial frame (z_0 down).
        name: Name of the point in the message.

    Returns:
        Shape (3,) [m], inside the travel of the slides.

    Raises:
        InputError: If the point is outside the workspace; the message names the limit.
    """
    y_t = np.asarray(y_t, dtype=float)
    if y_t.shape != (3,) or not np.all(np.isfinite(y_t)):
        raise InputError(f"{name}: {y_t.tolist()}; must be 3 finite numbers [m]")
    geometry, drives = parameters.geometry, parameters.drives
    # from 0 + offset, the slide's position at q = 0, to the end-effector
    reach = y_t - geometry.offsets
    half_c1 = np.sum(reach * geometry.rails, axis=1)
    c_0 = np.sum(reach**2, axis=1) - geometry.l_BC**2
    radicand = half_c1**2 - c_0
    where = f"{name}: {np.round(y_t, 6).tolist()} m is outside the workspace; "
    for i in range(len(radicand)):
        if radicand[i] < 0.0:
            distance = np.sqrt(geometry.l_BC**2 - radicand[i])
            raise InputError(
                where + f"rail {i + 1} is {distance:.6g} m away from rod {i + 1}'s end, "
                f"the rod's length is {geometry.l_BC:.6g} m"
            )
    q = -half_c1 - np.sqrt(radicand)
    lower, upper = drives.position_lower, drives.position_upper
    outside = np.maximum(lower - q, q - upper)
    worst = int(np.argmax(outside))
    if outside[worst] > _ROUNDING:
        raise InputError(
            where + f"slide {worst + 1} would be at {q[worst]:.6g} m, "
            f"its travel is {lower[worst]:.6g} m to {upper[worst]:.6g} m"
        )
    q = np.clip(q, lower, upper)
    if y_t[2] <= geometry.h_P:
        raise InputError(where + f"y_z must be greater than h_P = {geometry.h_P:.6g} m")
    independence = rod_independence(geometry, q, y_t)
    least = parameters.workspace.min_rod_independence
    if independence < least:
        raise InputError(
            where + f"the rods are nearly parallel to each other or to one plane, their least "
            f"singular value is {independence:.3g}; at least {least:.3g} is allowed"
        )
    return q
