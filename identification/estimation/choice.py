"""Choice of friction terms, by prediction of a motion that was not used to estimate.

Terms are added to Coulomb and viscous friction one after the other. A candidate is estimated on one
motion, including its width, and assessed on another one: the decrease of the squared weighted
errors, summed over sections of the motion, must be larger than chance explains, whatever the number
of candidates, and worth a parameter. The best candidate is accepted if its factor also differs from
zero by more than the noise of the first motion explains: a needless term changes all parameters a
little, which helps every other time. Finally, terms are removed that are no longer worth a
parameter, given the others.

Friction changes from day to day, and only its form matters here. Before errors are squared, the
sizes of Coulomb and viscous friction are therefore adapted to the motion of the assessment.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from identification.estimation.friction_terms import (
    KINDS,
    KINDS_WITH_WIDTH,
    FrictionTerm,
    FrictionTerms,
)
from identification.estimation.identifiability import factorize
from identification.estimation.information import FurtherColumns, MeasuredMotion, information
from identification.estimation.least_squares import estimate
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError

# sections of the assessed motion; correlated errors are shorter than one
_SECTIONS = 40
# probability to choose any term if there is none
_ERROR = 0.01
# least decrease of the error's mean square by a term, as part of a joint's friction torque squared
_WORTH = 1e-4
# initial widths, as part of a joint's largest velocity
_WIDTHS = np.geomspace(0.02, 0.8, 8)
_WIDTH_TOLERANCE = 1e-3  # of the logarithm
# least part of a column outside the span of the others, squared
_INDEPENDENT = 1e-7
_REMEMBERED = 8  # stored models with their errors


@dataclass(frozen=True)
class Judgement:
    """Effect of a term on the prediction of a motion that was not used.

    Attributes:
        term: The term, with the best width.
        improvement: Decrease of the sum of squared weighted errors.
        share: Mean of that decrease for a torque, as part of the weighted mean square of the
            joint's Coulomb and viscous friction.
        significance: Mean improvement of the sections by its standard deviation.
        chosen: Whether the term is in the model.
    """

    term: FrictionTerm
    improvement: float
    share: float
    significance: float
    chosen: bool


@dataclass(frozen=True)
class FrictionChoice:
    """Chosen friction terms.

    Attributes:
        model: Terms beside Coulomb and viscous friction, if any.
        judgements: Assessment of all candidates, sorted by joints; chosen ones compared to the
            model without them, others as one more term.
        threshold: Lower limit of significances, and of factors in standard deviations.
    """

    model: FrictionTerms
    judgements: tuple[Judgement, ...]
    threshold: float


def choose_friction(
    regressor: Regressor,
    base: BaseParameters,
    motion: MeasuredMotion,
    other: MeasuredMotion,
    kinds: Sequence[str] = KINDS,
) -> FrictionChoice:
    """Return the friction terms that improve the prediction of another motion.

    Args:
        regressor: Regressor of the robot, with friction.
        base: Its base parameters.
        motion: Motion of the estimate.
        other: Motion of the assessment, another trajectory; need not excite all parameters.
        kinds: Candidates for each joint, at least one.

    Raises:
        InputError: If the regressor is without friction, there is no kind or an unknown one, a
            motion does not fit the robot, a joint stands still in one of them, or the first one
            does not excite all parameters.
    """
    subject = regressor.subject
    if not kinds:
        raise InputError(f"friction: no kind to choose from; allowed: {', '.join(KINDS)}")
    if not regressor.friction:
        raise InputError(
            f"{subject.name}: regressor without friction; one with Coulomb and viscous friction is "
            "required to choose further terms"
        )
    systems = [information(regressor, base, data) for data in (motion, other)]
    for what, system in zip(("motion", "other motion"), systems, strict=True):
        if system.still.any():
            joint = subject.joint_names[int(np.argmax(system.still))]
            raise InputError(f"{subject.name}: {joint} stands still in the {what}; all must move")
    factorize(*systems[0].weighted(), base.short_names, subject.name)
    candidates = [
        FrictionTerm(joint, kind, 1.0 if kind in KINDS_WITH_WIDTH else None)
        for joint in range(subject.dimension)
        for kind in kinds
    ]

    def deviations(model: FrictionTerms) -> float:
        """Return the factor of the last term in units of its standard deviation."""
        found = estimate(regressor, base, motion, model)
        return float(abs(found.base_parameters[-1]) / found.standard_deviation[-1])

    data = [
        FurtherColumns(system, v) for system, v in zip(systems, (motion.v, other.v), strict=True)
    ]
    return _Search(data[0], data[1], candidates, deviations).run()


class _Search:
    """Estimates models with further columns, from products that are computed once."""

    def __init__(
        self,
        training: FurtherColumns,
        test: FurtherColumns,
        candidates: Sequence[FrictionTerm],
        deviations: Callable[[FrictionTerms], float],
    ) -> None:
        self._training, self._test, self._candidates = training, test, list(candidates)
        self._deviations = deviations
        self._normal, self._right = training.X.T @ training.X, training.X.T @ training.b
        self._square = float(training.b @ training.b)
        self._fastest = np.abs(training.v).max(axis=0)
        self.threshold = float(student.ppf(1.0 - _ERROR / len(self._candidates), _SECTIONS - 1))
        self._own = [self._friction_columns(j) for j in range(training.v.shape[1])]
        self._friction = self._friction_square()
        self._adaptable = [
            np.linalg.qr(test.by_joint[:, j, columns])[0] for j, columns in enumerate(self._own)
        ]
        self._errors = lru_cache(maxsize=_REMEMBERED)(self._errors_of)

    def run(self) -> FrictionChoice:
        """Return the choice."""
        model = FrictionTerms()
        refused: set[str] = set()  # once only, so that the search terminates
        while True:
            judged = [
                self._judge_added(model, term) for term in self._candidates if not model.has(term)
            ]
            better = [found for found in judged if found.chosen and found.term.name not in refused]
            better.sort(key=lambda judgement: -judgement.improvement)
            best = next((found.term for found in better if self._is_sure(model, found.term)), None)
            if best is None:
                break
            model = self._with_best_widths(model.with_term(best))
            needless = self._first_needless(model)
            if needless is not None:
                model = self._with_best_widths(model.without(needless))
                refused.add(needless.name)
        judged = [replace(judgement, chosen=False) for judgement in judged]
        judged += [replace(self._judge_present(model, term), chosen=True) for term in model.terms]
        judged.sort(key=lambda judgement: judgement.term.joint)
        return FrictionChoice(model, tuple(judged), self.threshold)

    def _is_sure(self, model: FrictionTerms, term: FrictionTerm) -> bool:
        """Return whether the factor of one more term certainly differs from zero."""
        return self._deviations(model.with_term(term)) > self.threshold

    def _judge_added(self, model: FrictionTerms, term: FrictionTerm) -> Judgement:
        term = self._with_best_width(model, term)
        return self._judge(model, model.with_term(term), term)

    def _judge_present(self, model: FrictionTerms, term: FrictionTerm) -> Judgement:
        return self._judge(self._with_best_widths(model.without(term)), model, term)

    def _first_needless(self, model: FrictionTerms) -> FrictionTerm | None:
        """Return the first term, except the last one, that the model does not need."""
        judged = (self._judge_present(model, term) for term in model.terms[:-1])
        return next((judgement.term for judgement in judged if not judgement.chosen), None)

    def _judge(self, less: FrictionTerms, more: FrictionTerms, term: FrictionTerm) -> Judgement:
        gain = np.sum(self._errors(less) ** 2 - self._errors(more) ** 2, axis=1)
        sections = np.array([part.sum() for part in np.array_split(gain, _SECTIONS)])
        spread = sections.std(ddof=1) / np.sqrt(_SECTIONS)
        significance = float(sections.mean() / spread) if spread > 0.0 else 0.0
        share = float(gain.mean() / self._friction[term.joint])
        chosen = significance > self.threshold and share > _WORTH
        return Judgement(term, float(gain.sum()), share, significance, chosen)

    def _with_best_widths(self, model: FrictionTerms) -> FrictionTerms:
        for term in model.terms:
            if term.has_width:
                model = model.with_width(self._with_best_width(model.without(term), term))
        return model

    def _with_best_width(self, model: FrictionTerms, term: FrictionTerm) -> FrictionTerm:
        """Return the term with the width that explains most of the motion of the estimate."""
        if not term.has_width:
            return term
        largest = self._fastest[term.joint]

        def squares(log_width: float) -> float:
            width = float(np.exp(log_width)) * largest
            return self._solve(model.with_term(replace(term, width=width)))[1]

        grid = np.log(_WIDTHS)
        best = int(np.argmin([squares(width) for width in grid]))
        bounds = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
        found = minimize_scalar(
            squares, bounds=bounds, method="bounded", options={"xatol": _WIDTH_TOLERANCE}
        )
        return replace(term, width=float(np.exp(found.x) * largest))

    def _solve(self, model: FrictionTerms) -> tuple[np.ndarray, float]:
        """Return parameters and squared weighted errors for the motion of the estimate."""
        size, terms = len(self._right), model.terms
        products = [self._training.products(term) for term in terms]
        normal = np.zeros((size + len(terms), size + len(terms)))
        normal[:size, :size] = self._normal
        for i, (term, own) in enumerate(zip(terms, products, strict=True), start=size):
            normal[i, :size] = normal[:size, i] = own.columns
            for k, (second, other) in enumerate(zip(terms, products, strict=True), start=size):
                normal[i, k] = own.column @ other.column if term.joint == second.joint else 0.0
        right = np.concatenate([self._right, [own.torques for own in products]])
        scale = np.sqrt(np.diag(normal))
        scaled = normal / np.outer(scale, scale)
        # nearly indistinguishable columns get small factors
        scaled[np.diag_indices_from(scaled)] += _INDEPENDENT
        solution = cho_solve(cho_factor(scaled), right / scale) / scale
        squares = self._square - 2.0 * right @ solution + solution @ normal @ solution
        return solution, float(squares)

    def _errors_of(self, model: FrictionTerms) -> np.ndarray:
        """Return the weighted errors in the other motion, with its own f_c, f_v; shape (K, N)."""
        solution, size, data = self._solve(model)[0], len(self._right), self._test
        errors = data.torques - data.by_joint @ solution[:size]
        for factor, term in zip(solution[size:], model.terms, strict=True):
            errors[:, term.joint] -= factor * data.column(term)
        for j, friction in enumerate(self._adaptable):
            errors[:, j] -= friction @ (friction.T @ errors[:, j])
        return errors

    def _friction_columns(self, j: int) -> list[int]:
        names = self._test.names
        return [names.index(f"joint_{j + 1}.{name}") for name in ("f_c", "f_v")]

    def _friction_square(self) -> np.ndarray:
        """Return the weighted mean square of Coulomb and viscous friction, shape (N,)."""
        solution, _ = self._solve(FrictionTerms())
        squares = []
        for j, columns in enumerate(self._own):
            friction = self._test.by_joint[:, j, columns] @ solution[columns]
            squares.append(np.mean(friction**2))
        return np.array(squares)
