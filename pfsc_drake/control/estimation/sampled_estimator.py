"""What estimators of torques share: one compiled function of memory and sample."""

import math

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction


class SampledEstimator:
    """An estimator whose memory belongs to the caller.

    Memory is one array, which :meth:`estimate` reads and :meth:`remember` writes.

    Args:
        function: CasADi function of ``memory``, ``state``, ``drive_torque``, ``known_torque`` and
            perhaps more, with the results ``estimate``, ``next`` (memory) and ``check``, which is
            finite only if the next memory is.
        num_joints: N.

    Attributes:
        num_joints: N.
        num_values: Length of the estimate.
        initial_memory: Memory at the start, zeros; the last entry tells whether there was a
            sample before.
        arguments: Of the function, by name, for those that the caller adds.
    """

    def __init__(self, function: ca.Function, num_joints: int) -> None:
        bound = BoundFunction(function)
        self.arguments, results = bound.arguments, bound.results
        self._memory, self._state = self.arguments["memory"], self.arguments["state"]
        self._drive, self._known = self.arguments["drive_torque"], self.arguments["known_torque"]
        self._estimate, self._next = results["estimate"], results["next"]
        self._check, self._evaluate = results["check"], bound.evaluate
        self.num_joints, self.num_values = num_joints, len(self._estimate)
        self.initial_memory = np.zeros(len(self._memory))

    @property
    def memory_size(self) -> int:
        """Length of the memory."""
        return len(self.initial_memory)

    def estimate(self, memory: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the estimate at a sample, shape (num_values,).

        Args:
            memory: From the last sample, shape (memory_size,).
            state: ``[q_J, v_J, q_M, v_M]`` at this sample, shape (4N,).

        Returns:
            A view that the next evaluation overwrites.
        """
        self._memory[:] = memory
        self._state[:] = state
        self._evaluate()
        return self._estimate

    def remember(
        self,
        memory: np.ndarray,
        state: np.ndarray,
        drive_torque: np.ndarray,
        known_torque: np.ndarray | None = None,
    ) -> None:
        """Overwrite the memory by that of this sample.

        After a sample that is not finite the estimate stands still, and the next sample starts
        a new interval.

        Args:
            memory: From the last sample, shape (memory_size,).
            state: ``[q_J, v_J, q_M, v_M]`` at this sample, shape (4N,).
            drive_torque: What the drives do until the next sample, shape (N,).
            known_torque: What else is known to act until then, see
                :class:`~pfsc_drake.control.estimation.generalized_momentum.MomentumModel`, shape
                (N,); zero if omitted.
        """
        self._drive[:] = drive_torque
        self._known[:] = 0.0 if known_torque is None else known_torque
        self.estimate(memory, state)
        if math.isfinite(self._check[0]):
            memory[:] = self._next
        else:
            memory[-1] = 0.0
