"""Inertia coupling between spinning rotors and moving links, the full model (2.62)-(2.64).

The simplified model (2.65) counts a rotor's spin about its own axis only against the motor
coordinate (``D_M``). The full model adds the last term of (2.62), by which a turning link
accelerates its rotors and vice versa::

    T_c = v_M' U'(q_J) v_J,   (U' v_J)_j = I_M,j / k_r,j  e_z,M,j . omega_i

with rotor j on link i, its spin axis ``e_z,M,j``, its inertia ``I_M,j`` about that axis and
``1 / k_r,j`` turns per turn of the joint, so that ``I_M,j / k_r,j = D_M,j k_r,j``.

The link inertias must include the mass and the inertia of the rotors at rest, as in the models of
this project; else the mass matrix is not positive definite.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.models.robot_parameters import ArmParameters
from pfsc_drake.robot.robot_model import bias_torque
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import link_motions, mass_matrix

# of unit vectors, so that right angles leave structural zeros in the expressions
_DIGITS = 12
# between a model file and the parameters that it was written from
_FRAME_TOLERANCE, _INERTIA_TOLERANCE = 1e-6, 1e-4


@dataclass(frozen=True, eq=False)
class RotorMount:
    """Mounting of the rotor of one drive, a row of Tab. 2.3.

    Attributes:
        link: Link that carries it: 1 is the first moving link, 0 the base.
        axis: Unit vector of its spin axis in the frame of that link, as in
            :class:`~pfsc_drake.robot.serial.chain.ChainLink`, shape (3,). For a chain taken
            from a Denavit-Hartenberg model this frame is turned back by the twist:
            ``axis = R_x(alpha_i) R_i^{M,j} e_z``, see :func:`mounts_from_dh`.
        gear_ratio: ``1 / k_r`` turns of the rotor per turn of the joint (rad per m for a slide);
            infinite for no coupling.
    """

    link: int
    axis: np.ndarray
    gear_ratio: float


def mounts_from_dh(
    links: Sequence[int], axes: np.ndarray, gear_ratios: np.ndarray, alpha: np.ndarray
) -> list[RotorMount]:
    """Return mounts with axes in DH frames, as in Tab. 2.3.

    Args:
        links: Carrying link i of each rotor, N numbers from 0 (base) to N.
        axes: Spin axes in DH frame i, the last columns of ``R_i^{M,j}``, shape (N, 3).
        gear_ratios: ``1 / k_r``, shape (N,).
        alpha: DH twists of the robot [rad], shape (N,).
    """
    mounts = []
    for link, axis, ratio in zip(links, np.asarray(axes, dtype=float), gear_ratios, strict=True):
        twist = alpha[link - 1] if link > 0 else 0.0
        mounts.append(RotorMount(link, np.round(_R_x(twist) @ axis, _DIGITS), float(ratio)))
    return mounts


def _R_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def mounts_from_parameters(chain: SerialChain, robot: ArmParameters) -> list[RotorMount]:
    """Return the mounts of a robot's rotors, of its first joints if the chain has fewer.

    Args:
        chain: The robot, taken from a model that :mod:`~pfsc_drake.robot.models.writer` wrote.
        robot: Its parameters.

    Raises:
        InputError: If the parameters do not define them, or belong to another robot: joint frames
            and ``D_M`` must agree.
    """
    rotors, table, n = robot.rotors, robot.denavit_hartenberg.table(), chain.dimension
    if not rotors.fixed_to_link:
        raise InputError(f"{robot.name}: no rotors.fixed_to_link and rotors.spin_axes; must be set")
    if n > table.axes:
        raise InputError(f"{robot.name}: {table.axes} joints; must be {n} or more as the model has")
    before = np.concatenate([[0.0], table.alpha])[:n]
    for j, (link, twist, D_M) in enumerate(
        zip(chain.links, before, rotors.reflected_inertia, strict=False), start=1
    ):
        turned = np.allclose(link.R_PF, _R_x(twist), rtol=0.0, atol=_FRAME_TOLERANCE)
        if not (
            turned and np.allclose(link.axis, [0.0, 0.0, 1.0], rtol=0.0, atol=_FRAME_TOLERANCE)
        ):
            raise InputError(
                f"{robot.name}: the frame of joint {j} ({link.name}) differs from its "
                "Denavit-Hartenberg table; must be the same, for spin_axes to agree"
            )
        if not np.isclose(link.reflected_inertia, D_M, rtol=_INERTIA_TOLERANCE, atol=0.0):
            raise InputError(
                f"{robot.name}: rotor {j} has D_M = {D_M:g}; must be {link.reflected_inertia:g} "
                "as in the model"
            )
    return mounts_from_dh(
        rotors.fixed_to_link[:n],
        np.array(rotors.spin_axes[:n]),
        rotors.gear_ratio[:n],
        table.alpha,
    )


def check_mounts(chain: SerialChain, mounts: Sequence[RotorMount]) -> None:
    """Refuse mounts that do not fit a robot.

    Raises:
        InputError: If their number is not N, or a link, an axis or a gear ratio is out of range.
    """
    n = chain.dimension
    if len(mounts) != n:
        raise InputError(f"rotors: {len(mounts)} mounts given; the robot has {n} joints")
    for j, mount in enumerate(mounts, start=1):
        axis = np.asarray(mount.axis, dtype=float)
        if not 0 <= mount.link <= n:
            raise InputError(f"rotor {j}: link = {mount.link}; must be 0 (base) to {n}")
        if axis.shape != (3,) or not abs(np.linalg.norm(axis) - 1.0) < 1e-6:
            raise InputError(f"rotor {j}: axis = {axis.tolist()}; must be a unit vector")
        if not abs(mount.gear_ratio) > 0.0:
            raise InputError(f"rotor {j}: gear_ratio = {mount.gear_ratio!r}; must not be 0")


def rotor_momentum(
    chain: SerialChain, mounts: Sequence[RotorMount], q_J: ca.SX, v_J: ca.SX
) -> ca.SX:
    """Return ``U'(q_J) v_J``, the contribution of the links to the motors' momenta, (N, 1).

    Args:
        chain: The robot; its ``D_M`` contains the rotors' inertias.
        mounts: Its rotors, N of them.
        q_J: Joint coordinates, shape (N, 1).
        v_J: Their velocities, shape (N, 1).
    """
    motions = link_motions(
        chain, [Jet([q, v]) for q, v in zip(_rows(q_J), _rows(v_J), strict=True)]
    )
    momenta = []
    for mount, inertia in zip(mounts, chain.D_M, strict=True):
        spin = ca.SX(0.0)
        if mount.link > 0:
            axis = ca.SX(ca.sparsify(ca.DM(mount.axis)))
            spin = ca.dot(axis, motions[mount.link - 1].w.coefficients[0])
        momenta.append(inertia / mount.gear_ratio * spin)
    return ca.vertcat(*momenta)


def coupling_matrices(
    chain: SerialChain, mounts: Sequence[RotorMount], q_J: ca.SX, v_J: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return ``U(q_J)``, ``C_1(q_J, v_J)`` and ``C_2(q_J, v_J)`` of (2.64), each (N, N).

    With Lagrange's equations for ``T_c = v_J' U v_M``::

        C_1 v_M = d(U v_M)/dq v_J - (dT_c/dq)',   C_2 v_J = d(U' v_J)/dq v_J

    U is upper triangular if no rotor sits beyond its own joint's link; its diagonal is
    zero but for rotors that sit on that link itself and spin about its joint's axis (1 and 3
    of Tab. 2.3).

    Args:
        chain: The robot.
        mounts: Its rotors.
        q_J: Joint coordinates, symbols of shape (N, 1).
        v_J: Their velocities, symbols of shape (N, 1).
    """
    momentum = rotor_momentum(chain, mounts, q_J, v_J)
    v_M = ca.SX.sym("v_M", chain.dimension)
    on_links, on_motors = _coriolis(momentum, q_J, v_J, v_M)
    # on_motors is quadratic in v_J, so that half its Jacobian times v_J gives it back
    return (
        ca.jacobian(momentum, v_J).T,
        ca.jacobian(on_links, v_M),
        ca.jacobian(on_motors, v_J) / 2.0,
    )


def _coriolis(momentum: ca.SX, q_J: ca.SX, v_J: ca.SX, v_M: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return ``C_1 v_M`` and ``C_2 v_J``."""
    T_c = ca.dot(momentum, v_M)
    on_links = ca.jtimes(ca.gradient(T_c, v_J), q_J, v_J) - ca.gradient(T_c, q_J)
    return on_links, ca.jtimes(momentum, q_J, v_J)


def full_dynamics_function(chain: SerialChain, mounts: Sequence[RotorMount]) -> ca.Function:
    """Return the accelerations of the full model (2.64) as a function of numbers.

    ``(state, tau_d, tau_ext) -> acceleration`` with ``state = [q_J, q_M, v_J, v_M]`` (4N),
    ``tau_d`` (N) at the motors, ``tau_ext`` (N) at the links, ``acceleration = [a_J, a_M]`` (2N)::

        D_E a_J + U a_M  + n_E(q_J, v_J) + C_1 v_M = tau_J + tau_ext
        U' a_J + D_M a_M + C_2 v_J                 = tau_d - tau_J

    ``tau_J = K_s (q_M - q_J) + K_d (v_M - v_J)`` (2.66); friction comes with the inputs. The
    motors' accelerations are eliminated first, ``D_M`` being diagonal.

    Args:
        chain: A robot with elastic joints.
        mounts: Its rotors, N of them.

    Raises:
        InputError: If a joint is rigid or has no rotor inertia, or the mounts do not fit.
    """
    check_mounts(chain, mounts)
    if not (chain.is_elastic and np.all(chain.D_M > 0.0)):
        names = [k.name for k in chain.links if np.isinf(k.stiffness) or k.reflected_inertia <= 0.0]
        raise InputError(
            f"full elastic model: joints {', '.join(names)}; must have finite stiffness and "
            "positive rotor inertia"
        )
    n = chain.dimension
    state = ca.SX.sym("state", 4 * n)
    tau_d, tau_ext = ca.SX.sym("tau_d", n), ca.SX.sym("tau_ext", n)
    q_J, q_M, v_J, v_M = ca.vertsplit(state, n)
    U, on_links, on_motors = _coupling_terms(chain, mounts, v_M, q_J, v_J)
    tau_J = ca.DM(chain.K_s) * (q_M - q_J) + ca.DM(chain.K_d) * (v_M - v_J)
    load_J = tau_J + tau_ext - bias_torque(chain, q_J, v_J) - on_links
    load_M = (tau_d - tau_J - on_motors) / ca.DM(chain.D_M)
    U_over_D_M = U @ ca.diag(1.0 / ca.DM(chain.D_M))
    schur = mass_matrix(chain, q_J) - U_over_D_M @ U.T
    a_J = ca.ldl_solve(load_J - U @ load_M, *ca.ldl(ca.densify(schur)))
    a_M = load_M - U_over_D_M.T @ a_J
    return ca.Function(
        "full_dynamics",
        [state, tau_d, tau_ext],
        [ca.densify(ca.vertcat(a_J, a_M))],
        ["state", "tau_d", "tau_ext"],
        ["acceleration"],
    )


def _coupling_terms(
    chain: SerialChain, mounts: Sequence[RotorMount], v_M: ca.SX, q_J: ca.SX, v_J: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return ``U``, ``C_1 v_M`` and ``C_2 v_J`` for symbols that are parts of a vector."""
    n = chain.dimension
    q, v, w = (ca.SX.sym(name, n) for name in ("q", "v", "w"))
    momentum = rotor_momentum(chain, mounts, q, v)
    terms = [ca.jacobian(momentum, v).T, *_coriolis(momentum, q, v, w)]
    return tuple(ca.substitute(terms, [q, v, w], [q_J, v_J, v_M]))


def full_mass_matrix_function(chain: SerialChain, mounts: Sequence[RotorMount]) -> ca.Function:
    """Return ``D = [[D_E, U], [U', D_M]]`` of (2.63) over ``q_J``, (N,) to (2N, 2N)."""
    check_mounts(chain, mounts)
    q, v = ca.SX.sym("q", chain.dimension), ca.SX.sym("v", chain.dimension)
    U = ca.jacobian(rotor_momentum(chain, mounts, q, v), v).T
    D = ca.blockcat([[mass_matrix(chain, q), U], [U.T, ca.diag(ca.DM(chain.D_M))]])
    return ca.Function("full_mass_matrix", [q], [ca.densify(D)], ["q_J"], ["D"])


def full_energy_function(chain: SerialChain, mounts: Sequence[RotorMount]) -> ca.Function:
    """Return kinetic and potential energy (2.63), (2.54), (2.56) over ``[q_J, q_M, v_J, v_M]``.

    The potential energy of gravity is 0 where all centres of mass are in the origin of the world.
    """
    check_mounts(chain, mounts)
    n = chain.dimension
    state = ca.SX.sym("state", 4 * n)
    q_J, q_M, v_J, v_M = ca.vertsplit(state, n)
    kinetic = (
        v_J.T @ mass_matrix(chain, q_J) @ v_J / 2.0
        + ca.dot(ca.DM(chain.D_M), v_M**2) / 2.0
        + ca.dot(rotor_momentum(chain, mounts, q_J, v_J), v_M)
    )
    potential = ca.dot(ca.DM(chain.K_s), (q_M - q_J) ** 2) / 2.0
    p_WL, R_WL = ca.SX(3, 1), ca.SX.eye(3)
    motions = link_motions(chain, [jets.constant(q, 1) for q in _rows(q_J)])
    for link, motion in zip(chain.links, motions, strict=True):
        p_WL = p_WL + R_WL @ motion.p_PL.coefficients[0]
        R_WL = R_WL @ motion.R_PL.coefficients[0]
        p_WC = p_WL + R_WL @ ca.DM(link.p_LC)
        potential -= link.mass * ca.dot(ca.DM(chain.gravity), p_WC)
    return ca.Function("energy", [state], [kinetic, potential], ["state"], ["kinetic", "potential"])


def _rows(vector: ca.SX) -> list[ca.SX]:
    return [vector[i] for i in range(vector.numel())]
