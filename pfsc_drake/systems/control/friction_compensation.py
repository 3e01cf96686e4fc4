"""What friction of known coefficients asks of the drives."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.estimation.friction_model import friction_model_function


class FrictionCompensation(LeafSystem):
    """``tau_f = f_c tanh(v / v_s) + f_v v`` of the drives' velocity, see :func:`friction_torque`.

    Ports:
        velocity (input): v of the drives [rad/s or m/s]; its last N entries if there are more,
            as in ``[q_J, v_J, q_M, v_M]``.
        friction_torque (output): ``tau_f`` [Nm or N], shape (N,).

    Args:
        coulomb: ``f_c`` [Nm or N], shape (N,).
        viscous: ``f_v`` [Nm s/rad or N s/m], shape (N,).
        smoothing: ``v_s`` [rad/s or m/s].
        size: Length of the input port, N or more.

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(
        self, coulomb: np.ndarray, viscous: np.ndarray, smoothing: float, size: int
    ) -> None:
        super().__init__()
        function = BoundFunction(friction_model_function(coulomb, viscous, smoothing))
        self._argument, self._result = (
            function.arguments["velocity"],
            function.results["friction_torque"],
        )
        self._evaluate = function.evaluate
        self._velocity = self.DeclareVectorInputPort("velocity", size)
        self.DeclareVectorOutputPort(
            "friction_torque",
            len(self._result),
            self._calc_friction_torque,
            prerequisites_of_calc={self._velocity.ticket()},
        )

    def _calc_friction_torque(self, context: Context, output: BasicVector) -> None:
        self._argument[:] = self._velocity.Eval(context)[-len(self._argument) :]
        self._evaluate()
        output.SetFromVector(self._result)
