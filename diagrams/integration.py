"""Explicit integration schemes: cost, and steps with which they are stable."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.scenario.simulation import SimulationParameters

# Coefficients of the polynomial R(z), z = lambda h, by which a step multiplies a mode, from the
# power 0; in order of cost. The first terms are those of exp(z).
STABILITY = {
    "runge_kutta2": (1.0, 1.0, 1.0 / 2.0),
    "runge_kutta3": (1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0),
    "runge_kutta5": (1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 600.0),
}
# modes become faster by up to this factor where the posture changes
_MARGIN = 1.25
# 1/s, growth of an oscillation by the integration alone that every loop tolerates
_GROWTH = 0.1
_DIFFERENCE = 1e-6  # of a state variable, for derivatives


@dataclass(frozen=True)
class Integration:
    """Integration scheme and step of a station, with the reason for the choice.

    Attributes:
        scheme: Drake's name of the scheme.
        step: Its fixed, or with error control its largest step [s].
        reason: Reason for the choice, for the report.
    """

    scheme: str
    step: float
    reason: str

    def __str__(self) -> str:
        """Return a sentence for the report."""
        return f"{self.scheme} in steps of {self.step * 1e3:.4g} ms: {self.reason}"

    def applied_to(self, parameters: SimulationParameters) -> SimulationParameters:
        """Return simulation parameters that name this scheme and step.

        Args:
            parameters: The other parameters.
        """
        return replace(parameters, integrator=self.scheme, max_step=self.step)


def is_stable(scheme: str, step: float, modes: np.ndarray) -> bool:
    """Return whether the numerical solution grows only where the exact one does.

    Modes that are faster by a quarter are checked too, since they depend on the posture.

    Args:
        scheme: One of ``STABILITY``.
        step: Fixed step [s].
        modes: Eigenvalues of the linearized system [1/s].
    """
    R = np.polynomial.Polynomial(STABILITY[scheme])
    for factor in (1.0, _MARGIN):
        poles = factor * modes
        growth = np.log(np.maximum(np.abs(R(poles * step)), 1e-300)) / step
        if np.any(growth > np.maximum(poles.real, 0.0) + _GROWTH):
            return False
    return True


def continuous_modes(diagram: Diagram, root: Context) -> np.ndarray:
    """Return the eigenvalues of a diagram's linearized continuous dynamics [1/s].

    Sampled signals are held constant.

    Args:
        diagram: The diagram.
        root: Its context, for the state; unchanged.
    """
    context = root.Clone()
    x = context.get_continuous_state_vector().CopyToVector()
    A = np.empty((x.size, x.size))
    for i in range(x.size):
        delta = _DIFFERENCE * max(1.0, abs(x[i]))
        rates = []
        for sign in (1.0, -1.0):
            shifted = x.copy()
            shifted[i] += sign * delta
            context.SetContinuousState(shifted)
            rates.append(diagram.EvalTimeDerivatives(context).CopyToVector())
        A[:, i] = (rates[0] - rates[1]) / (2.0 * delta)
    return np.linalg.eigvals(A)
