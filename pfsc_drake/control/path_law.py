"""The path following law as a function of measurement, path and reference."""

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.control.decoupling import DecouplingInverse, DecouplingSolution
from pfsc_drake.control.linearization import Linearization
from pfsc_drake.control.stabilization import Stabilization
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PathStatus
from pfsc_drake.robot.newton_euler import gravity_torque
from pfsc_drake.robot.serial_chain import SerialChain


class Fault(enum.IntEnum):
    """Why a law went to its safe state."""

    NONE = 0
    STATE_NOT_FINITE = 1
    PROJECTION_FAILED = 2
    OUTSIDE_FEASIBLE_NEIGHBOURHOOD = 3
    SINGULAR = 4

    @property
    def explanation(self) -> str:
        """One phrase for people."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    Fault.NONE: "no fault",
    Fault.STATE_NOT_FINITE: "a measured value is not a finite number",
    Fault.PROJECTION_FAILED: "the projection onto the path did not converge",
    Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD: "the tool left the feasible neighbourhood of the path",
    Fault.SINGULAR: "the decoupling matrix is close to singular",
}


class LawOutput(NamedTuple):
    """What the law gives in one tick.

    Attributes:
        drive: Drive input within its limits, shape (N,) [Nm, or rad/s for servos].
        Y: Derivatives 0..r-1 of the virtual output, shape (r, m).
        v: Virtual input, shape (m,).
        rcond: Reciprocal condition number of the decoupling matrix.
        held: The part of the drive input that is extrapolated over the hold, shape (N,).
        saturated: How many drives are at their limit.
        fault: Why ``drive`` must not be used, or ``Fault.NONE``.
    """

    drive: np.ndarray
    Y: np.ndarray
    v: np.ndarray
    held: np.ndarray
    rcond: float
    saturated: int
    fault: Fault


@dataclass(frozen=True)
class SafeState:
    """What the drives do after a fault: hold the links against gravity and brake.

    ``tau_d = g_L(q) - damping v_M``; for velocity servos the reference is zero.

    Attributes:
        damping: Braking per drive [Nm s/rad], shape (N,).
    """

    damping: np.ndarray


class PathLaw:
    """The path following law (3.29), (3.50), (3.58), (3.65), (3.70) of one robot.

    Evaluation writes into buffers that are made once; the object holds no state
    of the controlled system.

    Args:
        chain: The robot.
        linearization: The compiled relation between drives and virtual output.
        stabilization: Gains of the virtual output's error dynamics.
        inverse: Inverts the decoupling matrix.
        limits: Magnitude limits of the drive input, shape (N,).
        max_alpha: Where the feasible neighbourhood (3.9) ends for the controller, below 1.
        safe_state: What the drives do after a fault.

    Raises:
        InputError: If dimensions do not match, or a limit is not positive.
    """

    def __init__(
        self,
        chain: SerialChain,
        linearization: Linearization,
        stabilization: Stabilization,
        inverse: DecouplingInverse,
        limits: np.ndarray,
        max_alpha: float,
        safe_state: SafeState,
    ) -> None:
        n = linearization.num_joints
        if np.shape(limits) != (n,) or not np.all(np.asarray(limits) > 0.0):
            raise InputError(f"drive limits: {limits}; must be {n} positive numbers")
        if not 0.0 < max_alpha < 1.0:
            raise InputError(f"max_alpha: {max_alpha}; must lie between 0 and 1")
        if stabilization.relative_degree != linearization.relative_degree:
            raise InputError(
                f"gains of relative degree {stabilization.relative_degree} for a law of "
                f"relative degree {linearization.relative_degree}"
            )
        self.linearization = linearization
        self.stabilization = stabilization
        self.limits = np.asarray(limits, dtype=float)
        self._inverse = inverse
        self._max_alpha = max_alpha
        self._safe_state = safe_state
        self._gravity = _gravity_function(chain)
        self.function = _law_function(linearization, stabilization)
        self._bind_buffers()

    def _bind_buffers(self) -> None:
        n, m = self.linearization.num_joints, self.linearization.num_outputs
        r = self.linearization.relative_degree
        self._buffer, self._evaluate = self.function.buffer()
        self._state, self._point, self._reference, self._integral, self._tau_ext = (
            np.zeros(self.function.numel_in(i)) for i in range(5)
        )
        arguments = [self._state, self._point, self._reference, self._integral, self._tau_ext]
        for i, argument in enumerate(arguments):
            self._buffer.set_arg(i, memoryview(argument))
        shapes = [(m, r), (m,), (m, n), (m,), (n, n), (n,), (n,)]
        results = [np.zeros(int(np.prod(shape))) for shape in shapes]
        for i, result in enumerate(results):
            self._buffer.set_res(i, memoryview(result))
        # CasADi stores by columns
        views = [
            result.reshape(shape, order="F") for result, shape in zip(results, shapes, strict=True)
        ]
        self._Y, self._v, self._A, self._rhs, self._gain, self._drift, self._offset = views

    def evaluate(
        self,
        state: np.ndarray,
        point: np.ndarray,
        reference: np.ndarray,
        integral: np.ndarray,
        last_held: np.ndarray | None = None,
        tau_ext: np.ndarray | None = None,
    ) -> LawOutput:
        """Return the drive input of one tick.

        Args:
            state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
            point: Path point next to the tool, laid out by the linearization's layout.
            reference: Derivatives 0..r of the virtual output's reference by rows,
                shape ((r + 1) m,).
            integral: Integral of the virtual output's error, shape (m,).
            last_held: ``held`` of the last tick, shape (N,); if omitted or NaN, nothing
                is extrapolated.
            tau_ext: External joint torques and derivatives, shape (N (r - 1),); zero if omitted.
        """
        self._state[:] = state
        self._point[:] = point
        self._reference[:] = reference
        self._integral[:] = integral
        self._tau_ext[:] = 0.0 if tau_ext is None else tau_ext
        self._evaluate()
        solution = self._inverse.solve(self._A, self._rhs)
        held = self._gain @ solution.x + self._drift
        wanted = held + self._offset
        if (
            self.linearization.extrapolated
            and last_held is not None
            and last_held[0] == last_held[0]
        ):
            wanted += 0.5 * (held - last_held)
        drive = np.minimum(np.maximum(wanted, -self.limits), self.limits)
        fault = self._judge(solution, wanted)
        saturated = int(np.count_nonzero(drive != wanted))
        Y, v = self._Y.T.copy(), self._v.copy()
        return LawOutput(drive, Y, v, held, solution.rcond, saturated, fault)

    def _judge(self, solution: DecouplingSolution, wanted: np.ndarray) -> Fault:
        """Return what forbids the use of a drive input, the root cause first."""
        # written so that NaN is a fault; a sum is finite only if all its terms are
        usable = (
            self._inverse.accepts(solution)
            and self._point[2] < self._max_alpha
            and self._point[3] != PathStatus.NOT_CONVERGED
            and math.isfinite(wanted.sum())
        )
        if usable:
            return Fault.NONE
        layout = self.linearization.layout
        if not np.isfinite(self._state).all():
            return Fault.STATE_NOT_FINITE
        if self._point[layout.status][0] == PathStatus.NOT_CONVERGED:
            return Fault.PROJECTION_FAILED
        if not self._point[layout.alpha][0] < self._max_alpha:
            return Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD
        return Fault.SINGULAR

    def safe_drive(self, state: np.ndarray, last_good_state: np.ndarray) -> np.ndarray:
        """Return the drive input of the safe state, shape (N,).

        Args:
            state: Measured ``[q_J, v_J, q_M, v_M]``; whatever is not finite is replaced.
            last_good_state: The state before the fault.
        """
        n = self.linearization.num_joints
        if self.linearization.relative_degree == 1:
            return np.zeros(n)
        trusted = state if np.isfinite(state).all() else last_good_state
        holding = np.array(self._gravity(trusted[:n])).ravel()
        braking = self._safe_state.damping * np.where(
            np.isfinite(state[3 * n :]), state[3 * n :], 0.0
        )
        return np.clip(holding - braking, -self.limits, self.limits)


def _gravity_function(chain: SerialChain) -> ca.Function:
    q = ca.SX.sym("q", chain.dimension)
    return ca.Function("gravity", [q], [gravity_torque(chain, q)])


def _law_function(linearization: Linearization, stabilization: Stabilization) -> ca.Function:
    """Return everything up to the decoupling matrix's inverse as one function."""
    n, m = linearization.num_joints, linearization.num_outputs
    r = linearization.relative_degree
    state, tau_ext = ca.SX.sym("state", 4 * n), ca.SX.sym("tau_ext", n * max(r - 1, 0))
    point = ca.SX.sym("path_point", linearization.layout.size)
    reference, integral = ca.SX.sym("reference", (r + 1) * m), ca.SX.sym("integral", m)
    Y, A, b, gain, drift, offset = linearization.function(state, tau_ext, point)
    v = stabilization.virtual_input(ca.horzsplit(Y), ca.vertsplit(reference, m), integral)
    return ca.Function(
        "path_law",
        [state, point, reference, integral, tau_ext],
        [Y, ca.densify(v), A, v - b, gain, drift, offset],
        ["state", "path_point", "reference", "integral", "tau_ext"],
        ["Y", "v", "A", "rhs", "gain", "drift", "offset"],
    )
