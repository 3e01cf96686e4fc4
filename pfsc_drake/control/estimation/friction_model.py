"""Friction of known coefficients, as a law overcomes it."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.checks import checked_vector
from pfsc_drake.errors import InputError


def friction_torque(coulomb: Any, viscous: Any, velocity: Any, smoothing: float) -> Any:
    """Return ``tau_f = f_c tanh(v / v_s) + f_v v``, shape (N, 1) [Nm or N].

    That is (2.41) with a smooth step: a torque that jumped with the sign of a measured velocity
    would rattle drives at rest.

    Args:
        coulomb: ``f_c``, shape (N, 1) [Nm or N].
        viscous: ``f_v``, shape (N, 1) [Nm s/rad or N s/m].
        velocity: v of the drives, shape (N, 1) [rad/s or m/s].
        smoothing: ``v_s`` [rad/s or m/s].
    """
    return coulomb * ca.tanh(velocity / smoothing) + viscous * velocity


def require_smoothing(smoothing: float) -> None:
    """Refuse a velocity of smoothing that is not positive.

    Raises:
        InputError: If so.
    """
    if not 0.0 < smoothing < np.inf:
        raise InputError(f"smoothing = {smoothing}: must be a positive number")


class FrictionModel(Block):
    """What friction of known coefficients asks of the drives, see :func:`friction_torque`.

    Ports:
        velocity (input): v of the drives [rad/s or m/s]; its last N entries if there are more,
            as in ``[q_J, v_J, q_M, v_M]``.
        friction_torque (output): ``tau_f`` [Nm or N], shape (N,).

    Args:
        coulomb: ``f_c``, shape (N,) [Nm or N], none negative.
        viscous: ``f_v``, shape (N,) [Nm s/rad or N s/m], none negative.
        smoothing: ``v_s`` [rad/s or m/s], positive.
        size: Length of the input port, N or more; N if omitted.

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(
        self, coulomb: np.ndarray, viscous: np.ndarray, smoothing: float, size: int | None = None
    ) -> None:
        n = np.size(coulomb)
        self._f_c, self._f_v = (
            ca.DM(checked_vector("friction model", name, values, n, positive=False))
            for name, values in (("coulomb", coulomb), ("viscous", viscous))
        )
        require_smoothing(smoothing)
        self._smoothing = smoothing
        self.inputs = {"velocity": Port(n if size is None else size, "rad/s or m/s")}
        self.outputs, self.states = {"friction_torque": Port(n, "Nm or N")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        v = u.velocity[-self._f_c.numel() :]
        return {"friction_torque": friction_torque(self._f_c, self._f_v, v, self._smoothing)}
