"""The following law as a function of measurement, manifold point and reference."""

import math

import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.law.decoupling import (
    DecouplingInverse,
    DecouplingSolution,
    Restraint,
    Spare,
    scale_of,
)
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.law_functions import completion_function, law_function
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import LoopGains, Stabilization
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.projection_status import ProjectionStatus
from pfsc_drake.robot.robot_model import RobotModel

# attributes of an enumeration are looked up slowly
_NO_FAULT, _NOT_CONVERGED = Fault.NONE, float(ProjectionStatus.NOT_CONVERGED)
# rad, of an error angle; from there on (3.38) is not defined
_LARGEST_ANGLE = math.pi / 2.0


class LawLayout:
    """Where the results of a law lie in a flat array.

    Attributes:
        drive: Drive input within its limits, shape (N,) [Nm, or rad/s for servos].
        manifold_state: Derivatives 0..r-1 of the virtual output by rows, shape (r m,).
        virtual_input: ``v``, shape (m,).
        status: Fault (:class:`Fault`), reciprocal condition number of the decoupling
            matrix, number of drives at their limit; shape (3,).
        held: The part of the drive input that is extrapolated over the hold, shape (N,).
        reference_velocity: Joint velocities that the reference asks for [rad/s or m/s], shape
            (N,), or (0,) of a law that does not tell them.
        residual: What damping lets the virtual output's r-th derivatives miss, shape (m,), or
            (0,) of a law that does not damp.
        size: Length of the whole array.
    """

    def __init__(
        self,
        num_joints: int,
        num_outputs: int,
        relative_degree: int,
        num_velocities: int = 0,
        num_residuals: int = 0,
    ) -> None:
        sizes = [num_joints, relative_degree * num_outputs, num_outputs, 3, num_joints]
        sizes += [num_velocities, num_residuals]
        ends = np.cumsum(sizes).tolist()
        fields = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
        self.drive, self.manifold_state, self.virtual_input, self.status, self.held = fields[:5]
        self.reference_velocity, self.residual = fields[5:]
        self.size: int = ends[-1]


class FollowingLaw:
    """The law that makes one robot follow a manifold.

    For a path it is (3.29), (3.50), (3.58), (3.65) or (3.70), as the drives are.

    Angles go on over full turns: from one tick to the next they are unwrapped, so that a
    reference that turns on and on is followed. An error angle of 90 deg or more is a fault,
    because (3.38) is not defined there.

    Evaluation writes into buffers that are made once; the object holds no state
    of the controlled system.

    Args:
        robot: The robot.
        linearization: The compiled relation between drives and virtual output.
        stabilization: Gains of the virtual output's error dynamics.
        inverse: Inverts the decoupling matrix.
        limits: Magnitude limits of the drive input, shape (N,).
        max_alpha: Where the feasible neighbourhood (3.9) ends for the controller, below 1.
        safe_state: What the drives do after a fault.
        tells_reference_velocity: Whether the results tell the joint velocities that the
            reference asks for, ``q' - A^-1 (yhat' - yhat_p')``; for r > 1. With more joints than
            outputs it is the one next to the posture reference's.
        posture: What joints beyond the number of outputs do; for a robot that has some.

    Attributes:
        layout: Layout of the results.
        robot: The robot.
        inverse: Inverts the decoupling matrix.
        safe_state: What the drives do after a fault.

    Raises:
        InputError: If dimensions do not match, or a limit is not positive.
    """

    def __init__(
        self,
        robot: RobotModel,
        linearization: Linearization,
        stabilization: Stabilization,
        inverse: DecouplingInverse,
        limits: np.ndarray,
        max_alpha: float,
        safe_state: SafeState,
        *,
        tells_reference_velocity: bool = False,
        posture: Posture | None = None,
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
        coordinates = stabilization.proportional.shape[1]
        if coordinates != linearization.num_outputs:
            raise InputError(
                f"gains of {coordinates} coordinates; "
                f"the law has {linearization.num_outputs} outputs"
            )
        if linearization.is_redundant != (posture is not None):
            raise InputError(
                f"posture: {'none' if posture is None else 'given'} for {n} joints and "
                f"{coordinates} outputs; one is needed where there are more joints than outputs"
            )
        safe_state.check(n)
        self.robot, self.safe_state = robot, safe_state
        self.linearization = linearization
        self.stabilization = stabilization
        self.limits = np.asarray(limits, dtype=float)
        self.posture, self.inverse = posture, inverse
        self._max_alpha = max_alpha
        self._tells_velocity = tells_reference_velocity
        self.layout = LawLayout(
            n,
            linearization.num_outputs,
            linearization.relative_degree,
            n if tells_reference_velocity else 0,
            linearization.num_outputs if inverse.damped_below else 0,
        )
        self.function = law_function(
            robot, linearization, stabilization, posture, damped=inverse.damped_below > 0.0
        )
        self._completion = completion_function(linearization, self.limits)
        self._fault_index = self.layout.status.start
        self._alpha_index = linearization.manifold.layout.alpha.start
        self._status_index = linearization.manifold.layout.status.start
        self._bind_buffers()

    def _bind_buffers(self) -> None:
        """Give both functions one set of arrays, so that nothing is copied between them."""
        first = BoundFunction(self.function)
        arrays = first.arguments | first.results
        second = BoundFunction(self._completion, **arrays)
        arrays |= second.arguments | second.results
        self._linearize, self._complete = first.evaluate, second.evaluate
        self._state, self._point = arrays["state"], arrays["manifold_point"]
        self._reference, self._integral = arrays["reference"], arrays["integral"]
        self._tau_ext, self._last_held = arrays["tau_ext"], arrays["last_held"]
        self._friction = arrays["friction"]
        self._lead, self._rhs = arrays["lead"], arrays["rhs"]
        # CasADi stores by columns
        self._A = arrays["A"].reshape((self.linearization.num_outputs, -1), order="F")
        self._solution, self._rcond = arrays["solution"], arrays["rcond"]
        self._result, self._check = arrays["result"], arrays["check"]
        self._last_output, self._angle = arrays["last_output"], arrays["angle"]
        self._posture = arrays.get("posture", np.zeros(0))
        self._wish, self._slope = arrays.get("wish"), arrays.get("slope")
        self._weight, self._rate = arrays.get("weight"), arrays.get("rate", np.zeros(1))
        self._rest, self._velocity = arrays.get("rest"), arrays.get("velocity")
        n = self.linearization.num_joints
        self._gain = arrays["gain"].reshape((n, n), order="F")
        self._drift, self._offset = arrays["drift"], arrays["offset"]
        self._scale = None if self.posture is None else self.posture.scale

    @property
    def gains(self) -> LoopGains:
        """All gains."""
        posture = None if self.posture is None else self.posture.stabilization
        return LoopGains(self.stabilization, posture)

    def evaluate(
        self,
        state: np.ndarray,
        point: np.ndarray,
        reference: np.ndarray,
        integral: np.ndarray,
        last_held: np.ndarray | None = None,
        tau_ext: np.ndarray | None = None,
        friction: np.ndarray | None = None,
        last_output: np.ndarray | None = None,
        posture: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the drive input of one tick and all that belongs to it.

        Args:
            state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
            point: The manifold's point, laid out by the manifold's layout.
            reference: Derivatives 0..r of the virtual output's reference by rows,
                shape ((r + 1) m,).
            integral: Integral of the virtual output's error, shape (m,).
            last_held: ``held`` of the last tick, shape (N,); if omitted nothing is
                extrapolated.
            tau_ext: External joint torques and derivatives, shape (N (r - 1),); zero if omitted.
            friction: ``tau_f`` that the drives are to overcome besides [Nm or N], shape (N,);
                zero if omitted.
            last_output: Virtual output of the last tick, shape (m,), from which angles go on;
                if omitted they lie within half a turn of zero.
            posture: Derivatives 0..r of the posture reference by rows, shape ((r + 1) N,); only
                for a law with a posture, and zero if omitted.

        Returns:
            New array laid out by ``layout``. With a fault, its ``drive`` must not be used.
        """
        self._state[:] = state
        self._point[:] = point
        self._reference[:] = reference
        self._integral[:] = integral
        _assign(self._tau_ext, tau_ext)
        _assign(self._last_output, last_output)
        _assign(self._friction, friction)
        _assign(self._posture, posture)
        self._linearize()
        solution = self.inverse.solve(self._A, self._rhs, self._spare())
        self._rcond[0] = solution.rcond
        if last_held is None:
            self._lead[0] = 0.0
        else:
            self._lead[0] = self.linearization.lead
            self._last_held[:] = last_held
        self._solution[:] = solution.x
        if solution.rest is not None:
            self._leave_to_outputs(solution.rest)
        self._complete()
        result = self._result.copy()
        result[self._fault_index] = self._judge(solution)
        if self._tells_velocity:
            result = np.append(result, self._reference_velocity())
        if self.inverse.damped_below:
            missed = solution.residual
            result = np.append(result, np.zeros(len(self._rhs)) if missed is None else missed)
        return result

    def _spare(self) -> Spare | None:
        """Return what joints are to do that the outputs leave free."""
        if self._wish is None:
            return None
        if self._weight is not None:
            self._scale = scale_of(self._weight.reshape((len(self._wish), -1)))
        restraint = None
        posture = self.posture
        if posture is not None and posture.speeds is not None and self._rest is not None:
            restraint = Restraint(self._rest, self._velocity, posture.settling, posture.speeds)
        if self._slope is None:
            return Spare(self._wish, self._scale, restraint=restraint)
        return Spare(self._wish, self._scale, self._slope, self._rate.item(), restraint)

    def _leave_to_outputs(self, rest: np.ndarray) -> None:
        """Hold a posture back as far as drives would be at their limits for it.

        Drives are affine in the highest joint derivative: between that with which joints come to
        rest as far as the outputs let them and the one that is asked for, the largest share is
        taken that they can do.

        Args:
            rest: The former, shape (N,).
        """
        wanted = self._drive(self._solution)
        beyond = np.abs(wanted) > self.limits
        if not beyond.any():
            return
        least = self._drive(rest)
        step = (wanted - least)[beyond]
        room = self.limits[beyond] - np.sign(step) * least[beyond]
        share = np.divide(room, np.abs(step), out=np.ones_like(room), where=step != 0.0)
        # where the outputs alone ask for too much, a posture does not add to it
        self._solution[:] = rest + min(max(float(share.min()), 0.0), 1.0) * (self._solution - rest)

    def _drive(self, solution: np.ndarray) -> np.ndarray:
        """Return the drive input of a highest joint derivative, without limits, shape (N,)."""
        held, lead = self._gain @ solution + self._drift, self._lead.item()
        return held + lead * (held - self._last_held) + self._offset + self._friction

    def _reference_velocity(self) -> np.ndarray:
        """Return the joint velocities that the reference asks for, shape (N,)."""
        m, velocity = self.linearization.num_outputs, self.linearization.velocity
        error = self._result[self.layout.manifold_state][m : 2 * m]
        if not self.linearization.manifold.follows_time:
            error = error - self._reference[m : 2 * m]
        moving = self._state[velocity]
        if self.posture is None:
            return moving - self.inverse.solve(self._A, error).x
        n = len(moving)
        spare = Spare(self._posture[n : 2 * n], self._scale)
        return self.inverse.solve(self._A, self._A @ moving - error, spare).x

    def _judge(self, solution: DecouplingSolution) -> Fault:
        """Return what forbids the use of a result, the root cause first."""
        alpha, status = self._point[self._alpha_index], self._point[self._status_index]
        # written so that NaN is a fault
        if (
            self.inverse.accepts(solution)
            and alpha < self._max_alpha
            and status != _NOT_CONVERGED
            and math.isfinite(self._check[0])
            and self._angle[0] < _LARGEST_ANGLE
        ):
            return _NO_FAULT
        inputs = [self._state, self._reference, self._integral, self._tau_ext, self._friction]
        inputs.append(self._posture)
        if not all(np.isfinite(values).all() for values in inputs):
            return Fault.INPUT_NOT_FINITE
        if status == _NOT_CONVERGED:
            return Fault.PROJECTION_FAILED
        if self._angle[0] >= _LARGEST_ANGLE:
            return Fault.ORIENTATION_ERROR
        return Fault.SINGULAR if alpha < self._max_alpha else Fault.OUTSIDE_FEASIBLE_NEIGHBOURHOOD

    def error(self, result: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Return the error of the virtual output, which is to vanish, shape (m,).

        Args:
            result: From :meth:`evaluate`.
            reference: See there.
        """
        m = self.linearization.num_outputs
        y = result[self.layout.manifold_state][:m]
        # where the point moves with time, the virtual output is the error
        return y if self.linearization.manifold.follows_time else y - reference[:m]


def _assign(argument: np.ndarray, values: np.ndarray | None) -> None:
    """Overwrite an argument, by zeros if there are no values."""
    if values is None:
        argument.fill(0.0)
    else:
        argument[:] = values
