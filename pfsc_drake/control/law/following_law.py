"""The following law as a function of measurement, manifold point and reference."""

from functools import cached_property

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.cases import all_finite
from pfsc_drake.checks import require_between
from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.decoupling import DecouplingInverse, Spare
from pfsc_drake.control.law.exact_linearization import ExactLinearization
from pfsc_drake.control.law.law_functions import (
    Aim,
    LawInputs,
    aim_and_drives,
    find_fault,
    limit_spare_motion,
    rest_motion,
    spare_motion,
)
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import LoopGains, Stabilization
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, RobotModel

# m; largest distance of a tool beyond an end of an open path without a fault, and its range
MAX_BEYOND_END, BEYOND_END_RANGE = 0.02, (1e-4, 0.5)


class LawLayout:
    """Layout of the results of a law in a flat array.

    Attributes:
        drive: Drive input within its limits, shape (N,) [Nm, or rad/s for servos].
        manifold_state: Derivatives 0..r-1 of the virtual output by rows, shape (r m,).
        virtual_input: ``v``, shape (m,).
        status: Fault (:class:`Fault`), reciprocal condition number of the decoupling
            matrix, number of drives at their limit; shape (3,).
        varying_input: Part of the drive input that is extrapolated over the hold, shape (N,).
        reference_velocity: Joint velocities of the reference [rad/s or m/s], shape (N,), or (0,)
            of a law without them.
        residual: Error of the virtual output's r-th derivatives due to damping, shape (m,), or (0,)
            of a law without damping.
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
        self.drive, self.manifold_state, self.virtual_input, self.status, self.varying_input = (
            fields[:5]
        )
        self.reference_velocity, self.residual = fields[5:]
        self.size: int = ends[-1]


class FollowingLaw:
    """Law of one robot that follows a manifold.

    For a path it is (3.29), (3.50), (3.58), (3.65) or (3.70), depending on the drives.

    Angles continue over full turns: from sample to sample they are unwrapped, so that the
    reference may turn any number of times. An error angle of 90 deg or more is a fault,
    because (3.38) is not defined there.

    The law is one function without state; its memory is an input.

    Args:
        robot: The robot.
        linearization: The compiled relation between drives and virtual output.
        stabilization: Gains of the virtual output's error dynamics.
        inverse: Inverse of the decoupling matrix.
        limits: Magnitude limits of the drive input, shape (N,).
        max_alpha: End of the feasible neighbourhood (3.9) for the controller, below 1.
        safe_state: Safe state of the drives after a fault.
        has_reference_velocity: Whether the results have the joint velocities of the reference,
            ``q' - A^-1 (yhat' - yhat_p')``; for r > 1. With redundant joints they are closest to
            the velocity of the posture reference.
        posture: Posture control of redundant joints; needed if there are any.
        max_beyond_end: Largest distance of the tool beyond an end of an open path [m].

    Attributes:
        layout: Layout of the results.
        function: The law as a CasADi function of :class:`LawInputs` by name; its result is laid
            out by ``layout``.
        robot: The robot.
        inverse: Inverse of the decoupling matrix.
        safe_state: Safe state of the drives after a fault.

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
        has_reference_velocity: bool = False,
        posture: Posture | None = None,
        max_beyond_end: float = MAX_BEYOND_END,
    ) -> None:
        n = linearization.num_joints
        if np.shape(limits) != (n,) or not np.all(np.asarray(limits) > 0.0):
            raise InputError(f"drive limits: {limits}; must be {n} positive numbers")
        if not 0.0 < max_alpha < 1.0:
            raise InputError(f"max_alpha: {max_alpha}; must lie between 0 and 1")
        require_between("max_beyond_end", max_beyond_end, *BEYOND_END_RANGE, "m")
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
                f"{coordinates} outputs; one is needed with more joints than outputs"
            )
        safe_state.check(n)
        self.robot, self.safe_state = robot, safe_state
        self.linearization = linearization
        self.stabilization = stabilization
        self.limits = np.asarray(limits, dtype=float)
        self.posture, self.inverse = posture, inverse
        self._has_velocity = has_reference_velocity
        self.layout = LawLayout(
            n,
            linearization.num_outputs,
            linearization.relative_degree,
            n if has_reference_velocity else 0,
            linearization.num_outputs if inverse.damped_below else 0,
        )
        self.function = self._compose(max_alpha, max_beyond_end)

    @once_per_content()
    def _compose(self, max_alpha: float, max_beyond_end: float) -> ca.Function:
        """Return the law as one function: inputs by :class:`LawInputs`, results by the layout."""
        linearization, inverse = self.linearization, self.inverse
        u = LawInputs.symbols(linearization, has_posture=self.posture is not None)
        aim, drives = aim_and_drives(u, linearization, self.stabilization)
        spare = None
        if self.posture is not None:
            motion = ca.horzsplit(aim.motion)
            spare = spare_motion(self.posture, self.robot, motion, u.posture)
        elif inverse.damped_below:
            spare = rest_motion(self.stabilization, ca.horzsplit(aim.motion))
        solution = inverse.solve(aim.A, aim.rhs, spare)
        x = limit_spare_motion(drives, self.limits, solution)
        unlimited = drives.input(x)
        drive = ca.fmin(ca.fmax(unlimited, -self.limits), self.limits)
        saturated = ca.sum1(ca.fabs(unlimited) > self.limits)
        outputs = ca.vertcat(ca.vec(aim.Y), aim.v)
        # limits turn NaN into numbers
        finite = all_finite(unlimited, outputs, solution.rcond, u.state, u.tau_ext)
        usable = ca.logic_and(solution.usable, finite)
        fault = find_fault(
            u,
            linearization,
            aim,
            usable,
            max_alpha=max_alpha,
            max_beyond_end=max_beyond_end,
        )
        result = [drive, outputs, fault, solution.rcond, saturated, drives.varying_input(x)]
        if self._has_velocity:
            result.append(self._reference_velocity(u, aim, spare))
        if inverse.damped_below:
            result.append(solution.residual)
        return ca.Function(
            "following_law",
            list(u),
            ca.cse([ca.densify(ca.vertcat(*result))]),
            list(u._fields),
            ["result"],
            MAY_BE_PARAMETRIC,
        )

    @cached_property
    def _bound(self) -> BoundFunction:
        """Law with its linearization, as a function of the arguments of :meth:`evaluate`."""
        has_posture = self.posture is not None
        u = LawInputs.symbols(self.linearization, has_posture=has_posture)
        arguments = u._asdict()
        relation = ExactLinearization(self.linearization).output(
            Values(),
            Values(
                joint_state=u.state,
                manifold_point=u.manifold_point,
                tau_ext=u.tau_ext,
                reference=u.reference,
            ),
            0,
        )
        result = self.function(**arguments | relation)["result"]
        del arguments["relation"]
        whole = ca.Function(
            "whole_law", list(arguments.values()), [result], list(arguments), ["result"]
        )
        return BoundFunction(whole)

    def _reference_velocity(self, u: LawInputs, aim: Aim, spare: Spare | None) -> ca.SX:
        """Return the joint velocities of the reference, shape (N,)."""
        n, moving = self.linearization.num_joints, u.state[self.linearization.velocity]
        error = aim.Y[:, 1] - aim.Y_p[:, 1]
        if self.posture is None or spare is None:
            return moving - self.inverse.solve(aim.A, error).x
        next_to = Spare(u.posture[n : 2 * n], spare.scale)
        return self.inverse.solve(aim.A, aim.A @ moving - error, next_to).x

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
        last_varying_input: np.ndarray | None = None,
        tau_ext: np.ndarray | None = None,
        friction: np.ndarray | None = None,
        last_output: np.ndarray | None = None,
        posture: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the drive input of one sample with all other results.

        Args:
            state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
            point: The manifold's point, laid out by the manifold's layout.
            reference: Derivatives 0..r of the virtual output's reference by rows,
                shape ((r + 1) m,).
            integral: Integral of the virtual output's error, shape (m,).
            last_varying_input: ``varying_input`` of the last sample, shape (N,); no extrapolation
                if omitted.
            tau_ext: External joint torques and derivatives, shape (N (r - 1),); zero if omitted.
            friction: ``tau_f`` to be compensated [Nm or N], shape (N,); zero if omitted.
            last_output: Virtual output of the last sample, shape (m,), from which angles continue;
                if omitted they lie within half a turn of zero.
            posture: Derivatives 0..r of the posture reference by rows, shape ((r + 1) N,); only
                for a law with a posture, and zero if omitted.

        Returns:
            New array laid out by ``layout``. With a fault, its ``drive`` must not be used.
        """
        known = float(last_varying_input is not None)
        required = (state, point, reference, integral, last_varying_input, known)
        optional = (tau_ext, friction, last_output, posture)
        for argument, values in zip(
            self._bound.arguments.values(), required + optional, strict=True
        ):
            argument[:] = 0.0 if values is None else values
        self._bound.evaluate()
        return self._bound.results["result"].copy()
