"""What a person may have mistaken about signals: sign, order or unit.

Torques depend on the motion through the model, and joints on each other: parameters of a link
appear in the torques of all joints before it. A signal with the wrong sign, of another joint or in
another unit contradicts the others, or asks for friction that drives. Each mistake that is likely
is therefore undone on some samples, and the parameters are estimated anew, so that none have to be
known. The one that leaves least of the torques is named, if it leaves much less than the signals
as they are, or takes negative friction away.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from identification.estimation.information import standing_still
from identification.estimation.least_squares import NormalEquations
from identification.estimation.signal_changes import SignalChange, likely_changes
from identification.estimation.validation import describe_negative, never_negative
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor

# samples that are compared; more tell no more of mistakes this large
_SAMPLES = 500
# mean square of what is left, in units of that of the noise, from which on a mistake is looked for;
# and the part of what is above the noise that may be left where one is undone
_SUSPICIOUS, _MUCH_LESS = 1.2, 0.1
# what explanations that take negative friction away may leave more than the signals as they are
_NO_MORE = 1.1
# explanations that leave less than this times the best one are as good
_ALIKE = 1.3
# from these factors of a torque its unit is looked for, and how often the factor is refined
_UNITS_FROM, _ROUNDS = (1.0, 1e3), 2
_WIDEST = 1e5
_UNIT_NAMES = {1e3: "kNm or kN", 1e-3: "mNm or mN"}
_NEAR = 0.35
_MOST_CAUSES = 3
# a factor of a torque that ought to show
_OUGHT_TO_SHOW = 1.2
# of what the model takes, from which on the torque of a joint whose factor does not show is
# doubtful; in units of what those of all joints are
_UNLIKE = 1.1
# times the model's torques, in all joints, from which on another unit is thought of
_OTHER_UNIT = 10.0


@dataclass(frozen=True, eq=False)
class Mistake:
    """What is wrong with the signals, as far as torques tell.

    Attributes:
        cause: In words; two, if torques cannot tell which.
        before: What the model leaves of the mean torques, RMS in units of the noise that
            repetitions show.
        after: The same without the mistake.
        negative: Friction or rotor inertia below zero, in words; empty without.
    """

    cause: str
    before: float
    after: float
    negative: str

    @property
    def reason(self) -> str:
        """Why, in words."""
        left = (
            f"what the model leaves of the torques is {self.before:.3g} times the noise, and "
            f"{self.after:.3g} times without that"
        )
        return f"{self.negative}; {left}" if self.negative else left


@dataclass(frozen=True, eq=False)
class _Fit:
    """What is left with one change of the signals.

    Attributes:
        change: The change.
        left: Mean square of what is left, in units of that of the noise.
        negative: Parameters below zero that cannot be, in words.
        torques: What is left with factors s of the torques is ``s' M s``; M, shape (N, N).
        freedom: Torques that count less parameters.
    """

    change: SignalChange
    left: float
    negative: str
    torques: np.ndarray
    freedom: int


def find_mistake(
    regressor: Regressor, base: BaseParameters, motion: AveragedMotion
) -> Mistake | None:
    """Return what is wrong with the signals of a motion; None if nothing is, or nothing is found.

    Args:
        regressor: Regressor of the robot, with friction.
        base: Its base parameters.
        motion: The motion.
    """
    comparison = _Comparison(regressor, base, motion)
    as_it_is = comparison.as_it_is
    is_much = as_it_is.left > _SUSPICIOUS
    if not is_much and not as_it_is.negative:
        return None
    fits = [*comparison.fits(), *comparison.units()]
    much_less = [f for f in fits if f.left <= 1.0 + _MUCH_LESS * (as_it_is.left - 1.0)]
    sound = [fit for fit in much_less if not fit.negative]
    # of two mistakes at once, one is left where the other one is undone
    found = (sound or much_less) if is_much else []
    if not found and as_it_is.negative:
        found = [f for f in fits if not f.negative and f.left <= _NO_MORE * as_it_is.left]
    if not found:
        return None
    least = min(fit.left for fit in found)
    alike = [fit for fit in found if fit.left <= _ALIKE * least]
    fewest = min(fit.change.steps for fit in alike)
    alike = sorted((f for f in alike if f.change.steps == fewest), key=lambda fit: fit.left)
    return Mistake(
        ", or ".join([fit.change.cause for fit in alike][:2]),
        float(np.sqrt(as_it_is.left)),
        float(np.sqrt(alike[0].left)),
        as_it_is.negative,
    )


def unchecked(
    regressor: Regressor, base: BaseParameters, motion: AveragedMotion, believed: np.ndarray
) -> list[str]:
    """Return what of the signals cannot be checked or is doubtful, one sentence each.

    Args:
        regressor: Regressor of the robot, with friction.
        base: Its base parameters.
        motion: The motion.
        believed: Parameters as the model has them, shape (n,); NaN where it has none.
    """
    comparison = _Comparison(regressor, base, motion)
    most = max(_SUSPICIOUS, _NO_MORE * comparison.as_it_is.left)
    unseen = [f.change.cause for f in comparison.fits() if f.left <= most and not f.negative]
    said = []
    if unseen:
        said.append(f"these torques would not show it if {_listed(unseen)}")
    of_factor = list(comparison.of_factor(_OUGHT_TO_SHOW))
    names = [name for name, fit in of_factor if fit.left <= most]
    if names:
        said.append(
            f"a factor of {_OUGHT_TO_SHOW:g} in tau of {', '.join(names)} (unit, gear ratio) would "
            "not show in the torques of the other joints"
        )
    ratio = comparison.ratio_to(np.nan_to_num(believed))
    usual = float(np.median(ratio))
    if np.isfinite(believed).all():
        said.extend(
            f"tau of {name} is {own:.2g} times what the model's masses and friction take, of all "
            f"joints {usual:.2g} times: its unit, gear ratio or torque constant?"
            for (name, _), own in zip(of_factor, ratio.tolist(), strict=True)
            if name in names and not 1.0 / _UNLIKE < own / usual < _UNLIKE
        )
    knows = np.nan_to_num(believed).any()
    if knows and (np.all(ratio > _OTHER_UNIT) or np.all(ratio < 1.0 / _OTHER_UNIT)):
        said.append(
            f"all torques are about {usual:.2g} times what the model's masses and "
            "friction take: unit of tau?"
        )
    return said


class _Comparison:
    """What is left of the torques in some samples of a motion, with signals as others."""

    def __init__(self, regressor: Regressor, base: BaseParameters, motion: AveragedMotion) -> None:
        self._regressor, self._base = regressor, base
        count = len(motion.q)
        some = np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).astype(int))
        still = standing_still(regressor.subject, motion.v)
        # where all do, the unit of time may be another one
        moves = ~still | still.all()
        self._motion = [motion.q[some], motion.v[some] * moves, motion.a[some] * moves]
        self._tau = motion.tau[some]
        self._noise, self._periods = np.sqrt(motion.mean_torque_variance), motion.periods
        joints = len(regressor.subject.joint_names)
        nothing = SignalChange.nothing(joints)
        self._solved: tuple[object, ...] = ()
        self._matrix = self._columns(nothing)
        self.as_it_is = self._fit(nothing, self._matrix)

    def fits(self) -> Iterator[_Fit]:
        """Yield what is left with each change that is likely."""
        subject, matrix = self._regressor.subject, self._matrix
        motion: tuple[bytes, ...] = ()
        for change in likely_changes(subject.joint_names, subject.joint_units):
            if change.motion != motion:
                motion, matrix = change.motion, self._columns(change)
            # a DELTA robot has no torques where it cannot be
            if np.all(np.isfinite(matrix)):
                yield self._fit(change, matrix)

    def units(self) -> Iterator[_Fit]:
        """Yield what is left where the torque of a joint has the factor that fits best."""
        names = self._regressor.subject.joint_names
        for j in range(len(names) if len(names) > 1 else 0):
            found = [fit for start in _UNITS_FROM for fit in self._of_best_factor(j, start)]
            if found:
                yield min(found, key=lambda fit: fit.left)

    def of_factor(self, factor: float) -> Iterator[tuple[str, _Fit]]:
        """Yield each joint, and what is left with a factor of its torque."""
        names = self._regressor.subject.joint_names
        for j, name in enumerate(names):
            yield name, self._fit(_of_unit(names, j, factor), self._matrix)

    def ratio_to(self, parameters: np.ndarray) -> np.ndarray:
        """Return measured torques by those of parameters, RMS, shape (N,)."""
        predicted = self._matrix @ self._base.values(parameters)
        sizes = [np.sqrt(np.mean(tau**2, axis=0)) for tau in (self._tau, predicted)]
        return np.asarray(sizes[0] / np.maximum(sizes[1], np.finfo(float).tiny))

    def _columns(self, change: SignalChange) -> np.ndarray:
        return self._base.reduce(self._regressor.matrix(*change.of_motion(*self._motion)))

    def _fit(self, change: SignalChange, matrix: np.ndarray) -> _Fit:
        # signs of the torques are factors in the same equations
        signs, size = np.sign(change.torque_factors), np.abs(change.torque_factors)
        same = (change.motion, change.torque_order.tobytes(), size.tobytes())
        if same != self._solved:
            sized = replace(change, torque_factors=size)
            v = change.of_motion(*self._motion)[1]
            self._equations = NormalEquations.of(
                matrix, v, sized.of_torques(self._tau), sized.of_noise(self._noise)
            )
            self._solved = same
        equations = self._equations
        left = float(signs @ equations.left_over @ signs) / equations.freedom
        negative = never_negative(
            self._base,
            equations.parameters @ signs,
            equations.deviation * np.sqrt(max(left, 1.0)),
            equations.sizes / np.sqrt(self._periods),
        )
        words = "" if negative is None else describe_negative(*negative)
        return _Fit(change, left, words, equations.left_over, equations.freedom)

    def _of_best_factor(self, joint: int, factor: float) -> list[_Fit]:
        names = self._regressor.subject.joint_names
        for _ in range(_ROUNDS):
            # the noise has the factor, too
            fit = self._fit(_of_unit(names, joint, factor), self._matrix)
            row = fit.torques[joint]
            factor *= 1.0 - float(row.sum() / row[joint]) if row[joint] > 0.0 else 0.0
            if not 1.0 / _WIDEST < factor < _WIDEST:
                return []
        return [self._fit(_of_unit(names, joint, factor), self._matrix)]


def _listed(causes: list[str]) -> str:
    more = len(causes) - _MOST_CAUSES
    return "; or if ".join(causes[:_MOST_CAUSES]) + (f"; and {more} more" if more > 0 else "")


def _of_unit(names: list[str], joint: int, factor: float) -> SignalChange:
    named = [unit for value, unit in _UNIT_NAMES.items() if abs(factor / value - 1.0) < _NEAR]
    hint = f"is it in {named[0]}?" if named else "unit, or gear ratio?"
    factors = np.ones(len(names))
    factors[joint] = factor
    return replace(
        SignalChange.nothing(len(names)),
        cause=f"tau of {names[joint]} must be {factor:.3g} times as large to fit the other joints "
        f"({hint})",
        steps=1.5,  # a sign is more likely
        torque_factors=factors,
    )
