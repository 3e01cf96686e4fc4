"""Regression matrix Y of (2.73): torques that are linear in the dynamic parameters."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from identification.model.dynamic_parameters import parameter_names, parameter_units
from identification.model.subject import Subject
from pfsc_drake import jets
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.kinematics import rod_motion
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import LinkMotion, link_motions
from pfsc_drake.robot.serial.rotor_coupling import RotorMount, rotor_momentum

# samples that are evaluated together
_BATCH = 500


class Regressor:
    """The regression matrix of a robot with N joints and n parameters.

    ``tau_d = Y(q, v, a) rho`` (2.73) with the parameters of
    :mod:`~identification.model.dynamic_parameters` and the drive torques ``tau_d`` of (2.42),
    (2.62) with stiff joints, no external forces::

        D(q) a + C(q, v) v + g(q) + f_c sign(v) + f_v v = tau_d

    Attributes:
        subject: The robot.
        friction: Whether friction is among the parameters.
        coupling: Whether spinning rotors and turning links are coupled (2.62); takes effect if
            ``subject.mounts`` is known.
        sign_width: Velocity [rad/s or m/s] within which the sign of the velocity in Coulomb
            friction is smooth, as ``tanh(v / sign_width)``; 0 for the sign itself.
        names: Names of the parameters.
        units: Units of the parameters.
        function: ``Y(q, v, a)``, CasADi function of three vectors (N,), SX inside, to (N, n).

    Raises:
        InputError: If ``sign_width`` is negative.
    """

    def __init__(
        self,
        subject: Subject,
        friction: bool = True,
        coupling: bool = True,
        sign_width: float = 0.0,
    ) -> None:
        if not 0.0 <= sign_width < np.inf:
            raise InputError(f"sign_width = {sign_width!r}; must be finite and not negative")
        self.subject, self.friction, self.coupling = subject, friction, coupling
        self.sign_width = sign_width
        self.names = parameter_names(subject, friction)
        self.units = parameter_units(subject, friction)
        self.function = self._function()
        self._batch = BoundFunction(self.function.map(_BATCH))

    @property
    def size(self) -> int:
        """Number of parameters n."""
        return len(self.names)

    def matrix(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the regression matrices of many samples, shape (K, N, n).

        Args:
            q: Joint coordinates [rad or m], shape (K, N).
            v: Their velocities, shape (K, N).
            a: Their accelerations, shape (K, N).

        Raises:
            InputError: If the shapes differ or a number is not finite.
        """
        n = self.subject.dimension
        motion = {"q": q, "v": v, "a": a}
        for name, values in motion.items():
            if np.shape(values) != np.shape(q) or np.ndim(values) != 2 or np.shape(q)[1] != n:
                raise InputError(
                    f"{name}: shape {np.shape(values)}; must be (K, {n}), the same for q, v and a"
                )
            if not np.all(np.isfinite(values)):
                row, joint = np.argwhere(~np.isfinite(values))[0]
                raise InputError(
                    f"{name}: sample {row}, joint {joint + 1} is {values[row, joint]}; must be "
                    "finite"
                )
        samples = len(q)
        Y = np.empty((samples, self.size, n))
        for start in range(0, samples, _BATCH):
            stop = min(start + _BATCH, samples)
            for name, values in motion.items():
                argument = self._batch.arguments[name].reshape(_BATCH, n)
                argument[: stop - start] = values[start:stop]
                argument[stop - start :] = values[start]
            self._batch.evaluate()
            # the matrices are stored by columns, one after the other
            result = self._batch.results["Y"].reshape(_BATCH, self.size, n)
            Y[start:stop] = result[: stop - start]
        return Y.transpose(0, 2, 1)

    def _function(self) -> ca.Function:
        subject, n = self.subject, self.subject.dimension
        q, v, a = (ca.SX.sym(name, n) for name in ("q", "v", "a"))
        if subject.chain is None:
            assert subject.delta is not None
            blocks = [delta_columns(subject.delta, q, v, a)]
        else:
            mounts = subject.mounts if self.coupling else None
            blocks = [
                link_columns(subject.chain, q, v, a),
                rotor_columns(subject.chain, mounts, subject.gear_ratio, q, v, a),
            ]
        if self.friction:
            blocks.append(friction_columns(v, self.sign_width))
        Y = ca.densify(ca.horzcat(*blocks))
        return ca.Function("regressor", [q, v, a], [Y], ["q", "v", "a"], ["Y"])


def link_columns(chain: SerialChain, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """Return the columns of the links' parameters, shape (N, 10 N).

    The torque that moves a link is ``J_k' W_k rho_k`` with the wrench that its ten parameters
    exert at the origin of its frame, in axes of the link, and the Jacobian ``J_k`` of the link's
    twist (principle of virtual power).

    Args:
        chain: The robot.
        q: Joint coordinates, symbols of shape (N, 1).
        v: Their velocities, symbols of shape (N, 1).
        a: Their accelerations, shape (N, 1).
    """
    motions = link_motions(chain, _jets(q, v, a))
    gravity = ca.SX(ca.sparsify(ca.DM(chain.gravity)))
    columns = []
    for motion in motions:
        gravity = motion.R_PL.coefficients[0].T @ gravity
        twist = ca.vertcat(motion.v.coefficients[0], motion.w.coefficients[0])
        columns.append(ca.jacobian(twist, v).T @ _wrench(motion, gravity))
    return ca.horzcat(*columns)


def _wrench(motion: LinkMotion, gravity: ca.SX) -> ca.SX:
    """Return force and torque at a link's origin, linear in its parameters, shape (6, 10)."""
    w, w_dot = motion.w.derivative(0), motion.w.derivative(1)
    v, v_dot = motion.v.derivative(0), motion.v.derivative(1)
    acceleration = v_dot + ca.cross(w, v) - gravity
    force = ca.horzcat(acceleration, ca.skew(w_dot) + ca.skew(w) @ ca.skew(w), ca.SX(3, 6))
    torque = ca.horzcat(
        ca.SX(3, 1), -ca.skew(acceleration), _of_inertia(w_dot) + ca.skew(w) @ _of_inertia(w)
    )
    return ca.vertcat(force, torque)


def _of_inertia(w: ca.SX) -> ca.SX:
    """Return the matrix L with ``I w = L [Ixx, Ixy, Ixz, Iyy, Iyz, Izz]'``, shape (3, 6)."""
    L = ca.SX(3, 6)
    L[0, 0], L[0, 1], L[0, 2] = w[0], w[1], w[2]
    L[1, 1], L[1, 3], L[1, 4] = w[0], w[1], w[2]
    L[2, 2], L[2, 4], L[2, 5] = w[0], w[1], w[2]
    return L


def rotor_columns(
    chain: SerialChain,
    mounts: Sequence[RotorMount] | None,
    gear_ratio: np.ndarray,
    q: ca.SX,
    v: ca.SX,
    a: ca.SX,
) -> ca.SX:
    """Return the columns of the rotors' inertias at the motor side, shape (N, N).

    From Lagrange's equations for the kinetic energy of rotor j (2.62) with stiff joints,
    ``I_M,j (n_j^2 v_j^2 / 2 + n_j v_j e_j . omega)`` with ``n_j = 1 / k_r,j``.

    Args:
        chain: The robot.
        mounts: Mounts of the rotors; None without coupling.
        gear_ratio: n, shape (N,).
        q: Joint coordinates, symbols of shape (N, 1).
        v: Their velocities, symbols of shape (N, 1).
        a: Their accelerations, shape (N, 1).
    """
    own = ca.diag(ca.DM(gear_ratio**2) * a)
    if mounts is None:
        return own
    # with inertias of 1 at the motor side
    unit = zip(chain.links, gear_ratio, strict=True)
    links = [replace(link, reflected_inertia=float(ratio) ** 2) for link, ratio in unit]
    energy = rotor_momentum(replace(chain, links=tuple(links)), mounts, q, v) * v
    state, rate = ca.vertcat(q, v), ca.vertcat(v, a)
    columns = []
    for j in range(chain.dimension):
        momentum = ca.gradient(energy[j], v)
        columns.append(ca.jtimes(momentum, state, rate) - ca.gradient(energy[j], q))
    return own + ca.horzcat(*columns)


def friction_columns(v: ca.SX, sign_width: float = 0.0) -> ca.SX:
    """Return the columns of ``f_c,1, f_v,1, f_c,2, ...``, shape (N, 2 N).

    Args:
        v: Joint velocities, shape (N, 1).
        sign_width: Velocity [rad/s or m/s] within which the sign is smooth; 0 for the sign itself.
    """
    n = v.numel()
    sign = ca.tanh(v / sign_width) if sign_width > 0.0 else ca.sign(v)
    columns = ca.SX(n, 2 * n)
    for j in range(n):
        columns[j, 2 * j], columns[j, 2 * j + 1] = sign[j], v[j]
    return columns


def delta_columns(robot: DeltaRobot, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """Return the columns of ``m_q,1, m_q,2, m_q,3, m_y`` of a DELTA robot, shape (3, 4).

    ``tau = diag(m_q) (q'' + C gravity) + J_D' m_y (y_t'' - gravity)``, see
    :meth:`~pfsc_drake.robot.delta.delta_robot.DeltaRobot.inverse_dynamics`.

    Args:
        robot: The robot.
        q: Slide positions [m], shape (3, 1).
        v: Their velocities, shape (3, 1).
        a: Their accelerations, shape (3, 1).
    """
    motion = rod_motion(robot.parameters.geometry, _jets(q, v, a))
    acceleration = motion.y_t.differentiate().differentiate()
    forces = motion.slide_forces(acceleration - robot.gravity)
    slides = a + ca.DM(robot.parameters.geometry.rails @ robot.gravity)
    return ca.horzcat(ca.diag(slides), ca.vertcat(*[force.coefficients[0] for force in forces]))


def _jets(q: ca.SX, v: ca.SX, a: ca.SX) -> list[Jet]:
    rows = zip(ca.vertsplit(q), ca.vertsplit(v), ca.vertsplit(a), strict=True)
    return [jets.Jet.from_derivatives(list(derivatives)) for derivatives in rows]
