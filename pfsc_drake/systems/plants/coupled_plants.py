"""Serial robots with stiff or elastic joints, whose rotors and links are coupled by inertia."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.rigid_rotors import rigid_dynamics_function
from pfsc_drake.robot.serial.rotor_coupling import RotorMount, full_dynamics_function


class RigidPlant(LeafSystem):
    """A serial robot as data in continuous time, without friction and limits.

    ::

        (D_E(q) + D_M + U(q) + U'(q)) q'' + C(q, q') q' + g(q) = tau

    see :mod:`~pfsc_drake.robot.serial.rigid_rotors`. A MultibodyPlant with reflected inertias has
    the same equation without U; this plant needs no model file, only a chain, possibly one without
    a file, such as a robot without its tool. Elastic joints of the chain are treated as stiff.

    Ports:
        actuation (input): Drive torques ``tau`` [Nm or N], shape (N,).
        resistance (input): ``-tau_f`` of friction, adds to ``tau`` [Nm or N], shape (N,); zero if
            not connected.
        state (output): ``[q, v]`` [rad, rad/s or m, m/s], shape (2N,).

    State:
        Continuous: ``[q, v]``, shape (2N,), all 0 at the start; see :meth:`set_state`.

    Args:
        chain: The robot, N joints.
        mounts: Mounts of its N rotors; None for no coupling.

    Raises:
        InputError: If the mounts do not fit.
    """

    def __init__(self, chain: SerialChain, mounts: Sequence[RotorMount] | None = None) -> None:
        super().__init__()
        n = chain.dimension
        self.DeclareContinuousState(n, n, 0)
        self._actuation = self.DeclareVectorInputPort("actuation", n)
        self._resistance = self.DeclareVectorInputPort("resistance", n)
        self.DeclareVectorOutputPort(
            "state", 2 * n, self._calc_state, prerequisites_of_calc={self.xc_ticket()}
        )
        self._size = n
        function = BoundFunction(rigid_dynamics_function(chain, mounts))
        self._x, self._tau = function.arguments.values()
        self._acceleration, self._evaluate = function.results["acceleration"], function.evaluate

    def set_state(self, context: Context, q: np.ndarray, v: np.ndarray | None = None) -> None:
        """Set the state.

        Args:
            context: Context of this system.
            q: Joint coordinates [rad or m], shape (N,).
            v: Their velocities, shape (N,); at rest if omitted.
        """
        rate = np.zeros(self._size) if v is None else v
        context.SetContinuousState(np.concatenate([q, rate]))

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_continuous_state_vector().CopyToVector())

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Evaluate ``[v, q'']``; the framework calls this."""
        self._x[:] = context.get_continuous_state_vector().CopyToVector()
        self._tau[:] = self._actuation.Eval(context)
        if self._resistance.HasValue(context):
            self._tau += self._resistance.Eval(context)
        self._evaluate()
        derivatives.SetFromVector(np.concatenate([self._x[self._size :], self._acceleration]))


class FullElasticPlant(LeafSystem):
    """The full model (2.64) of a serial robot with elastic joints, without approximation.

    ``[[D_E, U], [U', D_M]] q'' + [[C_E, C_1], [C_2, 0]] q' + g = [tau_J + tau_ext, tau_d - tau_J]``
    with ``q = [q_J, q_M]`` and ``tau_J`` of (2.66); see
    :mod:`~pfsc_drake.robot.serial.rotor_coupling`.
    A MultibodyPlant with reflected inertias has (2.65) instead, where U, C_1 and C_2 are zero. This
    plant has no geometry, contact, friction or limits;
    :class:`~pfsc_drake.systems.physics.joint_friction.JointFriction` has the port ``resistance``,
    too.

    Ports:
        drive_torque (input): ``tau_d`` at the motors, joint side [Nm or N], shape (N,).
        resistance (input): ``-tau_fM``, adds to ``tau_d`` [Nm or N], shape (N,); 0 if not
            connected.
        external_torque (input): ``tau_ext`` at the links [Nm or N], shape (N,); 0 if not
            connected.
        joint_state (output): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        link_acceleration (output): ``q_J''``, shape (N,) [rad/s^2 or m/s^2].

    State:
        Continuous: ``[q_J, q_M]`` and ``[v_J, v_M]``, shape (4N,), all 0 at the start; see
        :meth:`set_joint_state`.

    Args:
        chain: A robot with elastic joints; N joints.
        mounts: Mounts of its N rotors.

    Raises:
        InputError: If a joint is rigid or has no rotor inertia, or the mounts do not fit.
    """

    def __init__(self, chain: SerialChain, mounts: Sequence[RotorMount]) -> None:
        super().__init__()
        n = chain.dimension
        dynamics = full_dynamics_function(chain, mounts)
        self.DeclareContinuousState(2 * n, 2 * n, 0)
        self._drive = self.DeclareVectorInputPort("drive_torque", n)
        self._resistance = self.DeclareVectorInputPort("resistance", n)
        self._external = self.DeclareVectorInputPort("external_torque", n)
        # from [q_J, q_M, v_J, v_M] to [q_J, v_J, q_M, v_M] and back
        self._order = np.arange(4 * n).reshape(4, n)[[0, 2, 1, 3]].ravel()
        self.DeclareVectorOutputPort(
            "joint_state",
            4 * n,
            self._calc_joint_state,
            prerequisites_of_calc={self.xc_ticket()},
        )
        inputs = (self._drive, self._resistance, self._external)
        self.DeclareVectorOutputPort(
            "link_acceleration",
            n,
            self._calc_link_acceleration,
            prerequisites_of_calc={self.xc_ticket(), *(port.ticket() for port in inputs)},
        )
        self._half = 2 * n
        function = BoundFunction(dynamics)
        self._state, self._tau_d, self._tau_ext = function.arguments.values()
        self._acceleration, self._evaluate = function.results["acceleration"], function.evaluate

    def set_joint_state(self, context: Context, joint_state: np.ndarray) -> None:
        """Set the joint state.

        Args:
            context: Context of this system.
            joint_state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        """
        context.SetContinuousState(np.asarray(joint_state)[self._order])

    def _calc_joint_state(self, context: Context, output: BasicVector) -> None:
        state = context.get_continuous_state_vector().CopyToVector()
        output.SetFromVector(state[self._order])

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Calculate velocities and accelerations; the framework calls this."""
        acceleration = self._calc_acceleration(context)
        derivatives.SetFromVector(np.concatenate([self._state[self._half :], acceleration]))

    def _calc_acceleration(self, context: Context) -> np.ndarray:
        """Return the accelerations of links and motors, shape (2N,)."""
        self._state[:] = context.get_continuous_state_vector().CopyToVector()
        self._tau_d[:] = self._drive.Eval(context)
        if self._resistance.HasValue(context):
            self._tau_d += self._resistance.Eval(context)
        self._tau_ext[:] = self._external.Eval(context) if self._external.HasValue(context) else 0.0
        self._evaluate()
        return self._acceleration

    def _calc_link_acceleration(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._calc_acceleration(context)[: self._half // 2])
