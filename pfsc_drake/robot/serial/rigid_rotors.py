"""A serial robot with stiff joints and spinning rotors, (2.36) and (2.62).

With the joints stiff the rotors turn with the links, ``q_M = q_J``. The full model's kinetic
energy reduces to, with ``D_E``, ``D_M`` and ``U`` of
:mod:`~pfsc_drake.robot.serial.rotor_coupling`::

    T = v' (D_E(q) + D_M + U(q) + U'(q)) v / 2
"""

from collections.abc import Sequence

import casadi as ca

from pfsc_drake.robot.robot_model import bias_torque
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import mass_matrix
from pfsc_drake.robot.serial.rotor_coupling import RotorMount, check_mounts, rotor_momentum


def rigid_mass_matrix(chain: SerialChain, mounts: Sequence[RotorMount] | None, q: ca.SX) -> ca.SX:
    """Return ``D = D_E + D_M + U + U'``, shape (N, N).

    Args:
        chain: The robot, N joints.
        mounts: Its rotors, N of them; None for no coupling (U = 0).
        q: Joint coordinates, symbols of shape (N, 1).
    """
    D = mass_matrix(chain, q) + ca.diag(ca.DM(chain.D_M))
    if mounts is None:
        return D
    v = ca.SX.sym("v", chain.dimension)
    U = ca.jacobian(rotor_momentum(chain, mounts, q, v), v).T
    return D + U + U.T


def rigid_bias_torque(
    chain: SerialChain, mounts: Sequence[RotorMount] | None, q: ca.SX, v: ca.SX
) -> ca.SX:
    """Return ``C(q, v) v + g(q)``, shape (N, 1).

    Args:
        chain: The robot, N joints.
        mounts: Its rotors, N of them; None for no coupling.
        q: Joint coordinates, symbols of shape (N, 1).
        v: Their velocities, symbols of shape (N, 1).
    """
    bias = bias_torque(chain, q, v)
    if mounts is None:
        return bias
    # Lagrange's equations for T_c = v' U' v, without accelerations
    T_c = ca.dot(rotor_momentum(chain, mounts, q, v), v)
    return bias + ca.jtimes(ca.gradient(T_c, v), q, v) - ca.gradient(T_c, q)


def rigid_dynamics_function(
    chain: SerialChain, mounts: Sequence[RotorMount] | None = None
) -> ca.Function:
    """Return ``(state, tau) -> acceleration`` as a function of numbers, (2N,), (N,) to (N,).

    Args:
        chain: The robot, N joints; ``state = [q, v]``.
        mounts: Its rotors, N of them; None for no coupling.

    Raises:
        InputError: If the mounts do not fit.
    """
    n = chain.dimension
    if mounts is not None:
        check_mounts(chain, mounts)
    q, v, tau = (ca.SX.sym(name, n) for name in ("q", "v", "tau"))
    load = tau - rigid_bias_torque(chain, mounts, q, v)
    D = ca.densify(rigid_mass_matrix(chain, mounts, q))
    acceleration = ca.densify(ca.ldl_solve(load, *ca.ldl(D)))
    state = ca.SX.sym("state", 2 * n)
    acceleration = ca.substitute(acceleration, ca.vertcat(q, v), state)
    return ca.Function(
        "rigid_dynamics", [state, tau], [acceleration], ["state", "tau"], ["acceleration"]
    )


def rigid_torque_function(
    chain: SerialChain, mounts: Sequence[RotorMount] | None = None
) -> ca.Function:
    """Return ``(q, v, a) -> tau`` without friction as a function of numbers, each (N,).

    Args:
        chain: The robot, N joints.
        mounts: Its rotors, N of them; None for no coupling.

    Raises:
        InputError: If the mounts do not fit.
    """
    if mounts is not None:
        check_mounts(chain, mounts)
    q, v, a = (ca.SX.sym(name, chain.dimension) for name in ("q", "v", "a"))
    tau = rigid_mass_matrix(chain, mounts, q) @ a + rigid_bias_torque(chain, mounts, q, v)
    return ca.Function("rigid_torque", [q, v, a], [ca.densify(tau)], ["q", "v", "a"], ["tau"])
