"""Criteria of a motion for identifying base parameters, with analytic gradients.

The information matrix (2.76) of a motion stacks the base regressors of its samples. Its criterion
is ``log det(X^T X)`` (2.79), to be maximized, or the condition number ``sigma_1 / sigma_n`` of X,
to be minimized. The gradients of both with respect to X are,

    d log det(X^T X) = 2 <X (X^T X)^-1, dX>,     d log(sigma_i) = <u_i v_i^T / sigma_i, dX>

and CasADi propagates these matrices back through the regressor to the motion.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import casadi as ca
import numpy as np
import scipy.linalg

from identification.excitation.fourier import FourierTrajectory, fourier_basis
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.compiled.native_code import native_code
from pfsc_drake.errors import InputError

Criterion = Literal["D", "condition"]
CRITERIA: tuple[str, ...] = get_args(Criterion)
# of one period, for comparable values
REPORTED_SAMPLES = 1000
_SINGULAR = 1e-13


@dataclass(frozen=True)
class InformationFigures:
    """Values of the criteria for one period, with REPORTED_SAMPLES samples.

    They depend on the choice of base parameters and on their units.

    Attributes:
        log_determinant: ``log det(X^T X)``; minus infinity if a parameter is not excited.
        condition_number: Condition number of X.
        base_parameters: Number n_b of base parameters.
    """

    log_determinant: float
    condition_number: float
    base_parameters: int


def information(
    regressor: Regressor, base: BaseParameters, trajectory: FourierTrajectory
) -> InformationFigures:
    """Return the criteria of a motion.

    Args:
        regressor: Regressor of the robot, with the exact sign of the velocities in Coulomb
            friction.
        base: Its base parameters.
        trajectory: The motion.
    """
    t = np.arange(REPORTED_SAMPLES) * trajectory.period / REPORTED_SAMPLES
    X = base.reduce(regressor.matrix(*trajectory.motion(t))).reshape(-1, base.rank)
    values = np.linalg.svd(X, compute_uv=False)
    if not values[-1] > _SINGULAR * values[0]:
        return InformationFigures(-np.inf, np.inf, base.rank)
    return InformationFigures(
        2.0 * float(np.log(values).sum()), float(values[0] / values[-1]), base.rank
    )


def base_regressor_kernels(
    regressor: Regressor, base: BaseParameters
) -> tuple[ca.Function, ca.Function]:
    """Return the base regressor of one sample and its transposed derivative.

    Args:
        regressor: Regressor with a smooth sign of the velocities.
        base: The base parameters.

    Returns:
        ``(q, v, a) -> Y_b``, vectors (N,) and a matrix (N, n_b), and
        ``(q, v, a, S) -> d<S, Y_b> / d[q, v, a]``, shape (3N,).
    """
    n = regressor.subject.dimension
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    Y = regressor.function(q, v, a)[:, base.indices.tolist()]
    S = ca.SX.sym("S", n, base.rank)
    gradient = ca.densify(ca.gradient(ca.dot(S, Y), ca.vertcat(q, v, a)))
    return (
        ca.Function("forward", [q, v, a], [ca.densify(Y)], ["q", "v", "a"], ["Y"]),
        ca.Function("adjoint", [q, v, a, S], [gradient], ["q", "v", "a", "S"], ["g"]),
    )


class SampledFunction:
    """Evaluates a function for K samples together, as machine code if possible.

    Args:
        function: Function of SX with dense results.
        samples: Number K of samples.
    """

    def __init__(self, function: ca.Function, samples: int) -> None:
        inputs, outputs = range(function.n_in()), range(function.n_out())
        self._arguments = [np.zeros((samples, function.numel_in(i))) for i in inputs]
        self._results = [np.zeros((samples, function.numel_out(i))) for i in outputs]
        self._calls: list[Callable[[], None]] = []
        code = native_code(function)
        if code is not None:
            rows = range(samples)
            self._calls = [
                code.bind([x[k] for x in self._arguments], [x[k] for x in self._results])
                for k in rows
            ]
        else:
            self._mapped = function.map(samples)
            self._buffer, run = self._mapped.buffer()
            for i, array in enumerate(self._arguments):
                self._buffer.set_arg(i, array.ravel().data)
            for i, array in enumerate(self._results):
                self._buffer.set_res(i, array.ravel().data)
            self._calls = [run]

    def __call__(self, *arguments: np.ndarray) -> Sequence[np.ndarray]:
        """Return the results.

        They are overwritten by the next call.

        Args:
            arguments: One array (K, n) each; matrices by columns.

        Returns:
            One array (K, n) each; matrices by columns.
        """
        for own, values in zip(self._arguments, arguments, strict=True):
            own[:] = values.reshape(own.shape)
        for call in self._calls:
            call()
        return self._results


class ExcitationCost:
    """Cost of a motion for the search, with its gradient.

    ``-log det(X^T X)`` or ``log(sigma_1 / sigma_n)``, for a number of samples but scaled to
    REPORTED_SAMPLES.

    Args:
        kernels: Kernels of :func:`base_regressor_kernels`, N joints and n_b base parameters.
        period: Period of the motion [s].
        harmonics: Harmonics of the motion, M of them.
        samples: Number of samples per period.
        criterion: ``D`` or ``condition``.

    Raises:
        InputError: If the criterion is unknown or the samples are fewer than the parameters.
    """

    def __init__(
        self,
        kernels: tuple[ca.Function, ca.Function],
        period: float,
        harmonics: tuple[int, ...],
        samples: int,
        criterion: str = "D",
    ) -> None:
        forward, adjoint = kernels
        self._dimension, self._size = forward.size_out(0)
        if criterion not in CRITERIA:
            raise InputError(f"criterion = {criterion!r}; must be one of {', '.join(CRITERIA)}")
        if samples * self._dimension < self._size:
            raise InputError(
                f"samples = {samples}; must be at least {-(-self._size // self._dimension)} for "
                f"{self._size} base parameters of {self._dimension} joints"
            )
        self._samples, self._criterion = samples, criterion
        self._bases = fourier_basis(np.arange(samples) * period / samples, period, harmonics)
        self._forward = SampledFunction(forward, samples)
        self._adjoint = SampledFunction(adjoint, samples)
        self._shift = self._size * np.log(REPORTED_SAMPLES / samples)

    def __call__(self, coefficients: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the cost and its gradient.

        Args:
            coefficients: Shape (N, 2M + 1), as in :attr:`FourierTrajectory.coefficients`.

        Returns:
            The cost, infinite if a parameter is not excited at all, and the gradient, of the shape
            of the coefficients.
        """
        motion = [basis @ coefficients.T for basis in self._bases]
        (columns,) = self._forward(*motion)
        # the matrices of the samples are stored by columns, one after the other
        Y = columns.reshape(self._samples, self._size, self._dimension)
        X = Y.transpose(0, 2, 1).reshape(-1, self._size)
        value, S = self._log_determinant(X) if self._by_determinant else _log_condition(X)
        if not np.isfinite(value):
            return np.inf, np.zeros_like(coefficients)
        seeds = S.reshape(self._samples, self._dimension, self._size).transpose(0, 2, 1)
        (by_motion,) = self._adjoint(*motion, seeds)
        by_motion = by_motion.reshape(self._samples, 3, self._dimension)
        gradient = sum(by_motion[:, i].T @ basis for i, basis in enumerate(self._bases))
        return value, np.asarray(gradient)

    @property
    def _by_determinant(self) -> bool:
        return self._criterion == "D"

    def _log_determinant(self, X: np.ndarray) -> tuple[float, np.ndarray]:
        """Return ``-log det(X^T X)`` and its gradient by X, from ``X = Q R``."""
        scale = np.linalg.norm(X, axis=0)
        if not np.all(scale > 0.0):
            return np.inf, X
        R = np.linalg.qr(X / scale, mode="r")
        diagonal = np.abs(np.diag(R))
        if not np.all(diagonal > _SINGULAR):
            return np.inf, X
        half = scipy.linalg.solve_triangular(R, np.diag(1.0 / scale), trans="T").T
        value = 2.0 * np.log(diagonal * scale).sum() + self._shift
        return -float(value), -2.0 * X @ (half @ half.T)


def _log_condition(X: np.ndarray) -> tuple[float, np.ndarray]:
    """Return ``log(sigma_1 / sigma_n)`` of X and its gradient by X."""
    U, values, V_T = np.linalg.svd(X, full_matrices=False)
    if not values[-1] > _SINGULAR * values[0]:
        return np.inf, X
    first, last = (np.outer(U[:, i], V_T[i]) / values[i] for i in (0, -1))
    return float(np.log(values[0] / values[-1])), first - last
