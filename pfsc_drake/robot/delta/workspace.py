"""Inverse kinematics and workspace of a DELTA robot with linear drives."""

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.parameters import DeltaGeometry, DeltaParameters

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
        name: What the point is, for the message.

    Returns:
        Shape (3,) [m], inside the travel of the slides.

    Raises:
        InputError: If the point is outside the workspace; the message names the limit.
    """
    y_t = np.asarray(y_t, dtype=float)
    if y_t.shape != (3,) or not np.all(np.isfinite(y_t)):
        raise InputError(f"{name}: {y_t.tolist()}; must be 3 finite numbers [m]")
    geometry, drives = parameters.geometry, parameters.drives
    # from 0 + offset, the slide's place at q = 0, to the end-effector
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
