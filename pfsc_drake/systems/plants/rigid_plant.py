"""Serial robot with stiff joints, with or without the inertia coupling of its rotors."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.rigid_rotors import rigid_dynamics_function
from pfsc_drake.robot.serial.rotor_coupling import RotorMount


class RigidPlant(LeafSystem):
    """A serial robot as data in continuous time, without friction and limits.

    ::

        (D_E(q) + D_M + U(q) + U'(q)) q'' + C(q, q') q' + g(q) = tau

    see :mod:`~pfsc_drake.robot.serial.rigid_rotors`. A MultibodyPlant with reflected inertias
    obeys the same without U; this plant needs no model file, but a chain, which may be one
    that no file describes, as a robot without its tool. Elastic joints of the chain are
    taken for stiff ones.

    Ports:
        actuation (input): Drive torques ``tau`` [Nm or N], shape (N,).
        resistance (input): ``-tau_f`` of friction, adds to ``tau`` [Nm or N], shape (N,); zero if
            not connected.
        state (output): ``[q, v]`` [rad, rad/s or m, m/s], shape (2N,).

    State:
        Continuous: ``[q, v]``, shape (2N,), all 0 at the start; see :meth:`set_state`.

    Args:
        chain: The robot, N joints.
        mounts: Where its rotors sit, N of them; None for no coupling.

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
