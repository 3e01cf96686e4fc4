"""Compliance of joints beyond the number of outputs: a posture that yields and comes back."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import companion, expm

from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.errors import InputError


@dataclass
class NullSpaceImpedanceParameters:
    """Impedance of every joint in the null space.

    Attributes:
        inertia: ``m`` [kg m^2 or kg], positive.
        damping: ``d`` [Nm s/rad or N s/m], positive.
        stiffness: ``k`` [Nm/rad or N/m]; zero for a posture that stays where it is left.
        filter_rate: ``w`` of the filter that makes the posture smooth [rad/s].
    """

    inertia: float = 1.0
    damping: float = 20.0
    stiffness: float = 50.0
    filter_rate: float = 30.0

    def __post_init__(self) -> None:
        for key in ("inertia", "damping", "filter_rate"):
            value = getattr(self, key)
            if not 0.0 < value < np.inf:
                raise InputError(f"{key}: {value}; must be positive and finite")
        if not 0.0 <= self.stiffness < np.inf:
            raise InputError(f"stiffness: {self.stiffness}; must be zero or positive, and finite")


@dataclass
class NullSpaceImpedance:
    """Posture reference ``q_0`` that yields to joint torques, for every joint alike.

    It obeys ``(m s^2 + d s + k) (s / w + 1)^(r - 1) q_0 = u + k q_goal``.

    The torque u is the part of the joints' external torques that does no work on the outputs,
    ``N' tau`` (:func:`~pfsc_drake.control.law.decoupling.free_torque`), so that what presses on
    the tool along its outputs does not bend the posture. The filter of order r - 1 makes q_0
    continuous up to its r-th derivative, which a law of relative degree r follows exactly.
    Torques are held over a sampling interval, over which the equation is solved exactly.

    The motion is the derivatives 0..r of q_0 by rows, shape ((r + 1) N,).

    Attributes:
        parameters: The impedance.
        relative_degree: ``r`` of the law that follows, 1 to 4.
        period: Sampling time [s].
    """

    parameters: NullSpaceImpedanceParameters
    relative_degree: int
    period: float
    _transition: ca.DM = field(init=False, repr=False)
    _response: ca.DM = field(init=False, repr=False)

    def __post_init__(self) -> None:
        p, order = self.parameters, self.relative_degree + 1
        polynomial = np.array([p.inertia, p.damping, p.stiffness])
        for _ in range(self.relative_degree - 1):
            polynomial = np.polymul(polynomial, [1.0 / p.filter_rate, 1.0])
        # derivatives in increasing order, one more row for the input
        system = np.zeros((order + 1, order + 1))
        system[:order, :order] = companion(polynomial)[::-1, ::-1]
        system[order - 1, order] = 1.0 / polynomial[0]
        step = expm(system * self.period)
        self._transition = ca.DM(step[:order, :order])
        self._response = ca.DM(step[:order, order])

    def start(self, posture: Any) -> Any:
        """Return the motion at rest in a posture as an expression, shape ((r + 1) N,).

        Args:
            posture: Shape (N,) [rad or m].
        """
        return ca.vertcat(posture, ca.DM.zeros(self.relative_degree * posture.numel()))

    def update(self, motion: Any, torque: Any, goal: Any) -> Any:
        """Return the motion one period later as an expression, shape ((r + 1) N,).

        Args:
            motion: See the class.
            torque: u, shape (N,) [Nm or N]; zero instead unless all of it is finite.
            goal: ``q_goal``, shape (N,).
        """
        force = self.parameters.stiffness * goal + where(all_finite(torque), torque, 0.0)
        derivatives = ca.reshape(motion, goal.numel(), self.relative_degree + 1)
        return ca.vec(derivatives @ self._transition.T + force @ self._response.T)
