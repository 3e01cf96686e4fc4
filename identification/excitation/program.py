"""The optimization problem (2.79) for Drake's solvers, with exact first derivatives.

Limits hold at given instants only: those of the joints are linear in the coefficients, torques and
postures are not. What happens in between is the business of who chooses the instants.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from identification.excitation.criterion import ExcitationCost
from identification.excitation.fourier import fourier_basis
from identification.excitation.problem import ExcitationProblem
from identification.excitation.run_in import SampledFunction

Evaluated = Callable[[np.ndarray], np.ndarray]

# a motion that shows a parameter not at all: worse than all others, but a number
_WORST = 1e6
_TOLERANCE = 1e-4  # relative to the limits
_MOST_MINOR_ITERATIONS = 100_000


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a solver ended.

    Attributes:
        coefficients: Coefficients of the motion, shape (N, 2M + 1).
        value: The figure to be small, see :class:`ExcitationCost`.
        converged: Whether it is a local optimum, rather than the end of the iterations.
    """

    coefficients: np.ndarray
    value: float
    converged: bool


class ExcitationProgram:
    """Solves one robot's problem from given starts.

    Args:
        problem: Problem of the robot.
        samples: Samples of the criterion per period.

    Attributes:
        problem: Problem of the robot.
        cost: To be as small as possible.
        constraints: Beside those of positions, velocities and accelerations.
    """

    def __init__(self, problem: ExcitationProblem, samples: int) -> None:
        self.problem = problem
        self.cost = ExcitationCost(
            problem.kernels, problem.period, problem.harmonics, samples, problem.criterion
        )
        limits = problem.limits
        # of order one for the solver: positions by their range, the rest by the velocities
        self._scale = np.repeat(limits.velocity[:, None], problem.shape[1], axis=1)
        self._scale[:, 0] = limits.reach
        self.constraints = _nonlinear_constraints(problem)

    def solve(
        self,
        coefficients: np.ndarray,
        joint_times: np.ndarray,
        posture_times: np.ndarray,
        iterations: int,
    ) -> Solution:
        """Return what SNOPT makes of a motion.

        Args:
            coefficients: Coefficients of the motion to start with, shape (N, 2M + 1); may violate
                limits.
            joint_times: When joint limits hold [s], shape (K,).
            posture_times: When limits of torques and postures hold [s], shape (L,).
            iterations: At most so many major ones.
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
        return Solution(found, self.cost(found)[0], result.is_success())

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
        function: Function of some of q, v, a, each (N,), to values (size,) and their derivatives
            by each, one after the other, (size, N * number of arguments).
        orders: Which of q, v, a.
        size: Number of values.
        lower: Bound of all.
        upper: Bound of all.
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
            times: When it is to hold [s], shape (K,).
            scale: Scale of the coefficients, shape (N, 2M + 1).

        Returns:
            Function of what a solver varies, shape (N * (2M + 1),), to values, shape (K * size,).
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
        # one by one, each is short enough for machine code
        for value in ca.vertsplit(problem.posture.function(q)):
            function = _with_derivatives([q], value)
            constraints.append(MotionConstraint(function, [0], 1, 0.0, np.inf))
    return constraints


def _with_derivatives(arguments: list[ca.SX], value: ca.SX) -> ca.Function:
    derivatives = ca.densify(ca.jacobian(value, ca.vertcat(*arguments)))
    return ca.Function("limits", arguments, [ca.densify(value), derivatives])
