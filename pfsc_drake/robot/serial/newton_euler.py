"""Kinematics and dynamics of a serial chain on jets.

Everything is computed in link axes, where the time derivative of a momentum's
Taylor coefficients costs nothing: Newton-Euler equations on momenta need no
accelerations of their own, and their derivatives of any order come along.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.jets import Jet
from pfsc_drake.robot.serial.links import ChainLink, Linkage


def _symbolic(array: np.ndarray | float | ca.SX) -> ca.SX:
    """Return a constant as an expression whose zeros are structural; symbols as they are."""
    return array if isinstance(array, ca.SX) else ca.SX(ca.sparsify(ca.DM(array)))


@dataclass(frozen=True)
class LinkMotion:
    """Motion of one link, all in the link's own axes.

    Attributes:
        R_PL: Orientation in the previous link's frame, jet of order r.
        p_PL: Origin in the previous link's frame [m], jet of order r.
        w: Angular velocity [rad/s], jet of order r - 1.
        v: Velocity of the link frame's origin [m/s], jet of order r - 1.
    """

    R_PL: Jet
    p_PL: Jet
    w: Jet
    v: Jet


def _joint_pose(link: ChainLink, q: Jet) -> tuple[Jet, Jet]:
    """Return the pose of the link in the previous link's frame."""
    R_PF, p_PF = _symbolic(link.R_PF), _symbolic(link.p_PF)
    axis = _symbolic(link.axis)
    if link.is_revolute:
        sine, cosine = jets.sin_cos(q)
        along = axis @ axis.T
        R_PL = (R_PF @ (ca.SX.eye(3) - along)) * cosine + (R_PF @ ca.skew(axis)) * sine
        return R_PL + R_PF @ along, jets.constant(p_PF, q.order)
    return jets.constant(R_PF, q.order), (R_PF @ axis) * q + p_PF


def link_motions(chain: Linkage, q: Sequence[Jet]) -> list[LinkMotion]:
    """Return the motion of all links, base first.

    Args:
        chain: The robot, N joints.
        q: Joint coordinates, N scalar jets of order r >= 1.
    """
    motions: list[LinkMotion] = []
    zero = jets.constant(ca.SX(3, 1), q[0].order - 1)
    w_P, v_P = zero, zero
    for link, q_i in zip(chain.links, q, strict=True):
        R_PL, p_PL = _joint_pose(link, q_i)
        R_LP, rate = R_PL.T, q_i.differentiate()
        w = R_LP @ w_P
        v = R_LP @ (v_P + jets.cross(w_P, p_PL))
        if link.is_revolute:
            w = w + _symbolic(link.axis) * rate
        else:
            v = v + _symbolic(link.axis) * rate
        motions.append(LinkMotion(R_PL, p_PL, w, v))
        w_P, v_P = w, v
    return motions


def inverse_dynamics(
    chain: Linkage, q: Sequence[Jet], motions: Sequence[LinkMotion] | None = None
) -> list[Jet]:
    """Return the joint torques of link-side inverse dynamics (Newton-Euler on jets).

    ``tau_J = D_E(q) q'' + n_E(q, q')`` of (2.65a) without friction and without
    external torques; rotor inertias are not included.

    Args:
        chain: The robot, N joints.
        q: Joint coordinates, N scalar jets of order r >= 2.
        motions: Motions for the same coordinates, if known already.

    Returns:
        N scalar jets of order r - 2 [Nm or N].
    """
    motions = link_motions(chain, q) if motions is None else motions
    forces, torques = [], []
    gravity = jets.constant(_symbolic(chain.gravity), q[0].order - 2)
    for link, motion in zip(chain.links, motions, strict=True):
        gravity = motion.R_PL.T @ gravity
        p_LC = _symbolic(link.p_LC)
        v_C = motion.v + jets.cross(motion.w, p_LC)
        force = (v_C.differentiate() + jets.cross(motion.w, v_C) - gravity) * link.mass
        spin = _symbolic(link.I_C) @ motion.w
        torque = spin.differentiate() + jets.cross(motion.w, spin)
        forces.append(force)
        torques.append(torque + jets.cross(p_LC, force))
    tau: list[Jet] = []
    for i in reversed(range(len(chain.links))):
        link = chain.links[i]
        tau.append(jets.dot(_symbolic(link.axis), torques[i] if link.is_revolute else forces[i]))
        if i > 0:
            force_P = motions[i].R_PL @ forces[i]
            torque_P = motions[i].R_PL @ torques[i] + jets.cross(motions[i].p_PL, force_P)
            forces[i - 1] = forces[i - 1] + force_P
            torques[i - 1] = torques[i - 1] + torque_P
    return tau[::-1]


def tool_pose(chain: Linkage, motions: Sequence[LinkMotion]) -> tuple[Jet, Jet]:
    """Return the tool point and the tool's orientation in the world.

    The pose of order 0 is the product of the links' poses; its derivatives
    follow from the tool's body twist by ``R' = R S(w)``, ``p' = R v``, which is
    much cheaper than products of matrix jets.

    Args:
        chain: The robot.
        motions: Motions of its links with jets of order r.

    Returns:
        ``y_t`` [m], vector jet of order r, and ``R_e``, matrix jet of order r, see (2.5).
    """
    R_WL, p_WL = _link_poses(motions)[-1]
    R_LT, p_LT = _symbolic(chain.R_LT), _symbolic(chain.p_LT)
    last = motions[-1]
    w_T = R_LT.T @ last.w
    v_T = R_LT.T @ (last.v + jets.cross(last.w, p_LT))
    R_e = _integrate_rotation(R_WL @ R_LT, w_T)
    return (R_e @ v_T).integrate(p_WL + R_WL @ p_LT), R_e


def points_on_links(
    chain: Linkage,
    q: Sequence[Jet],
    points: Sequence[tuple[int, np.ndarray]],
    motions: Sequence[LinkMotion] | None = None,
) -> list[Jet]:
    """Return where points fixed to links are in the world.

    Args:
        chain: The robot, N joints.
        q: Joint coordinates, N scalar jets of order r >= 1.
        points: Points, each by the index of its link, 0 for the first that moves, to N - 1, and
            its position in that link's frame [m], shape (3,).
        motions: Motions for the same coordinates, if known already.

    Returns:
        Positions in world axes [m], vector jets of order r, in the order of ``points``.
    """
    motions = link_motions(chain, q) if motions is None else motions
    poses, positions = _link_poses(motions), []
    turns: dict[int, Jet] = {}
    for k, point in points:
        motion, (R_WL, p_WL) = motions[k], poses[k]
        p_LQ = _symbolic(point)
        if k not in turns:
            turns[k] = _integrate_rotation(R_WL, motion.w)
        velocity = turns[k] @ (motion.v + jets.cross(motion.w, p_LQ))
        positions.append(velocity.integrate(p_WL + R_WL @ p_LQ))
    return positions


def _link_poses(motions: Sequence[LinkMotion]) -> list[tuple[ca.SX, ca.SX]]:
    """Return orientations and origins of all link frames in the world, of order 0."""
    R_WL, p_WL = ca.SX.eye(3), ca.SX(3, 1)
    poses = []
    for motion in motions:
        p_WL = p_WL + R_WL @ motion.p_PL.coefficients[0]
        R_WL = R_WL @ motion.R_PL.coefficients[0]
        poses.append((R_WL, p_WL))
    return poses


def _integrate_rotation(R: ca.SX, w: Jet) -> Jet:
    """Return the jet of R with ``R' = R S(w)``, w in body axes."""

    def rate(rotation: Jet) -> Jet:
        return jets.bilinear(lambda r, w: r @ ca.skew(w), rotation, w)

    return jets.solve_ode(rate, R, w.order + 1)


def _inertia_about_origin(link: ChainLink) -> ca.SX:
    """Return :attr:`ChainLink.inertia_about_origin`, also of symbols."""
    if not isinstance(link.p_LC, ca.SX):
        return _symbolic(link.inertia_about_origin)
    S_c = ca.skew(link.p_LC)
    return link.I_C - link.mass * S_c @ S_c


def mass_matrix(chain: Linkage, q: ca.SX) -> ca.SX:
    """Return the link-side mass matrix ``D_E(q)`` (2.65a), shape (N, N), by composite bodies.

    Args:
        chain: The robot.
        q: Joint coordinates, shape (N, 1).
    """
    n = len(chain.links)
    poses = [_joint_pose(link, Jet([q[i]])) for i, link in enumerate(chain.links)]
    R_PL = [R.coefficients[0] for R, _ in poses]
    p_PL = [p.coefficients[0] for _, p in poses]
    mass = [link.mass for link in chain.links]
    moment = [_symbolic(link.mass * link.p_LC) for link in chain.links]
    inertia = [_inertia_about_origin(link) for link in chain.links]
    D = ca.SX(n, n)
    for j in reversed(range(n)):
        axis = _symbolic(chain.links[j].axis)
        if chain.links[j].is_revolute:
            force, torque = ca.cross(axis, moment[j]), inertia[j] @ axis
        else:
            force, torque = mass[j] * axis, ca.cross(moment[j], axis)
        for i in reversed(range(j + 1)):
            link = chain.links[i]
            D[i, j] = D[j, i] = ca.dot(_symbolic(link.axis), torque if link.is_revolute else force)
            force = R_PL[i] @ force
            torque = R_PL[i] @ torque + ca.cross(p_PL[i], force)
        if j > 0:
            rotated = R_PL[j] @ moment[j]
            p = p_PL[j]
            S_p, S_m = ca.skew(p), ca.skew(rotated)
            inertia[j - 1] += (
                R_PL[j] @ inertia[j] @ R_PL[j].T - mass[j] * S_p @ S_p - S_p @ S_m - S_m @ S_p
            )
            moment[j - 1] += rotated + mass[j] * p
            mass[j - 1] += mass[j]
    return D
