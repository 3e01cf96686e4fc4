"""Optimization problem (2.79) of a robot, for other processes and for Drake's solvers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from identification.excitation.criterion import (
    CRITERIA,
    ExcitationCost,
    SampledFunction,
    base_regressor_kernels,
)
from identification.excitation.fourier import check_harmonics, check_period, fourier_basis
from identification.excitation.limits import JointLimits
from identification.excitation.posture_clearance import (
    PostureLimits,
    delta_posture_limits,
    serial_posture_limits,
)
from identification.excitation.scene import Cell, RobotScene
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

# of the largest velocity; Coulomb friction is smooth within, so that gradients exist
_SIGN_WIDTH = 0.01


@dataclass(frozen=True, eq=False)
class ExcitationProblem:
    """Optimization problem (2.79) of one robot.

    Attributes:
        period: T_f [s].
        harmonics: Multiples of the fundamental frequency in use.
        limits: Limits of the joints.
        kernels: Kernels of the criterion, see :func:`base_regressor_kernels`.
        torque: ``(q, v, a) -> tau``, predicted torques of the drives.
        posture: Limits of postures; None for joint limits only.
        criterion: ``D`` or ``condition``.
    """

    period: float
    harmonics: tuple[int, ...]
    limits: JointLimits
    kernels: tuple[ca.Function, ca.Function]
    torque: ca.Function
    posture: PostureLimits | None
    criterion: str

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.limits.velocity.size

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the coefficients, (N, 2M + 1)."""
        return self.dimension, 2 * len(self.harmonics) + 1


def excitation_problem(
    subject: Subject,
    limits: JointLimits,
    *,
    period: float = 10.0,
    harmonics: tuple[int, ...] = (1, 3, 5),
    criterion: str = "D",
    cell: Cell | None = None,
    scene: RobotScene | None = None,
) -> ExcitationProblem:
    """Return the problem of a robot.

    Args:
        subject: The robot.
        limits: Limits of its joints.
        period: T_f [s].
        harmonics: Multiples of the fundamental frequency in use.
        criterion: ``D`` or ``condition``.
        cell: Environment of a serial robot.
        scene: Robot and cell in Drake; created if omitted and there is a cell.

    Raises:
        InputError: If a value is out of range.
    """
    check_period(period)
    check_harmonics(harmonics)
    if criterion not in CRITERIA:
        raise InputError(f"criterion = {criterion!r}; must be one of {', '.join(CRITERIA)}")
    n = subject.dimension
    smooth = Regressor(subject, sign_width=_SIGN_WIDTH * float(limits.velocity.max()))
    base = base_parameters(Regressor(subject))
    parameters = nominal_parameters(subject)
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    tau = ca.densify(smooth.function(q, v, a) @ ca.DM(parameters))
    posture: PostureLimits | None = None
    if subject.delta is not None:
        posture = delta_posture_limits(subject.delta)
    elif cell is not None:
        posture = serial_posture_limits(subject, cell, scene or RobotScene(subject, cell))
    return ExcitationProblem(
        period,
        tuple(harmonics),
        limits,
        base_regressor_kernels(smooth, base),
        ca.Function("torque", [q, v, a], [tau], ["q", "v", "a"], ["tau"]),
        posture,
        criterion,
    )


def nominal_parameters(subject: Subject) -> np.ndarray:
    """Return the parameters of a robot's model, with zero for unknown friction, shape (n,)."""
    return np.nan_to_num(true_parameters(subject))


def tighten(
    problem: ExcitationProblem, share: float, margins: Mapping[str, float], margin: float = 0.0
) -> ExcitationProblem:
    """Return the problem with narrower limits, to allow for the solver's tolerance.

    Args:
        problem: Problem of a robot.
        share: Remaining share of the joint limits.
        margins: Least values of posture limits by name, instead of zero [m or 1].
        margin: Least value of the others [m or 1].
    """
    posture = problem.posture
    if posture is not None:
        q = ca.SX.sym("q", problem.dimension)
        least = ca.DM([margins.get(name, margin) for name in posture.names])
        g = posture.function(q) - least
        posture = replace(posture, function=ca.Function("g", [q], [g], ["q"], ["g"]))
    return replace(problem, limits=problem.limits.shrink(share), posture=posture)


Evaluated = Callable[[np.ndarray], np.ndarray]

# cost of a motion without effect of a parameter: worse than all others, but finite
_WORST = 1e6
_TOLERANCE = 1e-4  # relative to the limits
_MOST_MINOR_ITERATIONS = 100_000


class ExcitationProgram:
    """Solves one robot's problem from given starts.

    Args:
        problem: Problem of the robot.
        samples: Samples of the criterion per period.

    Attributes:
        problem: Problem of the robot.
        cost: Cost to minimize.
        constraints: Constraints beside those of positions, velocities and accelerations.
    """

    def __init__(self, problem: ExcitationProblem, samples: int) -> None:
        self.problem = problem
        self.cost = ExcitationCost(
            problem.kernels, problem.period, problem.harmonics, samples, problem.criterion
        )
        limits = problem.limits
        # unknowns of order one for the solver: positions by their range, the rest by the velocities
        self._scale = np.repeat(limits.velocity[:, None], problem.shape[1], axis=1)
        self._scale[:, 0] = limits.reach
        self.constraints = _nonlinear_constraints(problem)

    def solve(
        self,
        coefficients: np.ndarray,
        joint_times: np.ndarray,
        posture_times: np.ndarray,
        iterations: int,
    ) -> tuple[np.ndarray, float]:
        """Return SNOPT's solution from a motion.

        Args:
            coefficients: Coefficients of the initial motion, shape (N, 2M + 1); may violate limits.
            joint_times: Times at which joint limits hold [s], shape (K,).
            posture_times: Times at which limits of torques and postures hold [s], shape (L,).
            iterations: Largest number of major iterations.

        Returns:
            Coefficients, shape (N, 2M + 1), and the cost.
        """
        program = MathematicalProgram()
        x = program.NewContinuousVariables(coefficients.size, "c")
        program.AddCost(self._evaluate_cost, vars=x)
        self._add_joint_limits(program, x.reshape(coefficients.shape), joint_times)
        for constraint in self.constraints:
            evaluate = constraint.at(self.problem, posture_times, self._scale)
            count = constraint.size * len(posture_times)
            lower = np.full(count, constraint.lower)
            upper = np.full(count, constraint.upper)
            program.AddConstraint(evaluate, lb=lower, ub=upper, vars=x)
        solver, options = SnoptSolver(), SolverOptions()
        for name, value in (
            ("Major iterations limit", iterations),
            ("Iterations limit", _MOST_MINOR_ITERATIONS),
            ("Major optimality tolerance", _TOLERANCE),
            ("Major feasibility tolerance", _TOLERANCE),
        ):
            options.SetOption(solver.solver_id(), name, value)
        result = solver.Solve(program, (coefficients / self._scale).ravel(), options)
        found = result.GetSolution(x).reshape(coefficients.shape) * self._scale
        return found, self.cost(found)[0]

    def _evaluate_cost(self, x: np.ndarray) -> AutoDiffXd:
        value, gradient = self.cost(self._coefficients(x))
        by_x = (gradient * self._scale).ravel() @ ExtractGradient(x)
        return AutoDiffXd(min(value, _WORST), by_x)

    def _coefficients(self, x: np.ndarray) -> np.ndarray:
        return ExtractValue(x).reshape(self._scale.shape) * self._scale

    def _add_joint_limits(
        self, program: MathematicalProgram, x: np.ndarray, times: np.ndarray
    ) -> None:
        problem, limits = self.problem, self.problem.limits
        position, *rates = fourier_basis(times, problem.period, problem.harmonics)
        ones = np.ones(len(times))
        for i, scale in enumerate(self._scale):
            lower, upper = limits.position[i] / limits.reach[i]
            A = position * scale / limits.reach[i]
            program.AddLinearConstraint(A, lower * ones, upper * ones, x[i])
            for basis, largest in zip(rates, (limits.velocity, limits.acceleration), strict=True):
                A = basis[:, 1:] * scale[1:] / largest[i]
                program.AddLinearConstraint(A, -ones, ones, x[i, 1:])


@dataclass(frozen=True, eq=False)
class MotionConstraint:
    """Bounds of a function of the motion at one instant.

    Attributes:
        function: Function of some of q, v, a, each (N,), to values (size,) and their derivatives by
            each argument, one after the other, (size, N * number of arguments).
        orders: Indices of its arguments among q, v, a.
        size: Number of values.
        lower: Lower bound of all values.
        upper: Upper bound of all values.
    """

    function: ca.Function
    orders: Sequence[int]
    size: int
    lower: float
    upper: float

    def at(self, problem: ExcitationProblem, times: np.ndarray, scale: np.ndarray) -> Evaluated:
        """Return the function of the scaled coefficients that a solver evaluates.

        Args:
            problem: Problem of the robot.
            times: Times at which it must hold [s], shape (K,).
            scale: Scale of the coefficients, shape (N, 2M + 1).

        Returns:
            Function of the solver's variables, shape (N * (2M + 1),), to values, shape (K * size,).
        """
        bases = np.array(fourier_basis(times, problem.period, problem.harmonics))[self.orders]
        sampled = SampledFunction(self.function, len(times))
        shape = (len(times), len(bases), problem.dimension, self.size)

        def evaluate(x: np.ndarray) -> np.ndarray:
            coefficients = ExtractValue(x).reshape(scale.shape) * scale
            values, derivatives = sampled(*(basis @ coefficients.T for basis in bases))
            by_motion = derivatives.reshape(shape)
            jacobian = np.einsum("ksjm,skw->kmjw", by_motion, bases, optimize=True) * scale
            rows = jacobian.reshape(values.size, -1) @ ExtractGradient(x)
            return InitializeAutoDiff(values.reshape(-1, 1), rows).ravel()

        return evaluate


def _nonlinear_constraints(problem: ExcitationProblem) -> list[MotionConstraint]:
    q, v, a = motion = [ca.SX.sym(name, problem.dimension) for name in "qva"]
    constraints = []
    known = np.flatnonzero(np.isfinite(problem.limits.effort))
    if known.size:
        effort = problem.limits.effort[known]
        share = problem.torque(q, v, a)[known.tolist()] / effort
        function = _with_derivatives(motion, share)
        constraints.append(MotionConstraint(function, [0, 1, 2], known.size, -1.0, 1.0))
    if problem.posture is not None:
        # one by one, so that each is short enough for machine code
        for value in ca.vertsplit(problem.posture.function(q)):
            function = _with_derivatives([q], value)
            constraints.append(MotionConstraint(function, [0], 1, 0.0, np.inf))
    return constraints


def _with_derivatives(arguments: list[ca.SX], value: ca.SX) -> ca.Function:
    derivatives = ca.densify(ca.jacobian(value, ca.vertcat(*arguments)))
    return ca.Function("limits", arguments, [ca.densify(value), derivatives])
