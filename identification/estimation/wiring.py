"""Detection of mistakes in signals: sign, order or unit.

Torques depend on the motion through the model, and joints on each other: parameters of a link
appear in the torques of all joints before it. A signal with the wrong sign, of another joint or in
another unit contradicts the others, or requires friction that drives. Therefore each likely mistake
is undone on some samples, and the parameters are estimated again, so that none need to be known.
The mistake with the least residual torque is reported, if the residual is much less than with the
original signals, or negative friction disappears.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from identification.estimation.information import joints_at_rest
from identification.estimation.least_squares import NormalEquations
from identification.estimation.signal_changes import SignalChange, likely_changes
from identification.estimation.validation import describe_negative, never_negative
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor

# number of compared samples; more show no more of mistakes this large
_SAMPLES = 500
# mean square residual in units of the noise's, from which on a mistake is searched for; and the
# largest part of the excess over the noise that may remain after one is undone
_SUSPICIOUS, _MUCH_LESS = 1.2, 0.1
# factor of the residual that changes without negative friction may have
_NO_MORE = 1.1
# changes with a residual below this times the best one are equivalent
_ALIKE = 1.3
# initial factors of a torque in the search for its unit, and number of refinements
_UNITS_FROM, _ROUNDS = (1.0, 1e3), 2
_WIDEST = 1e5
_UNIT_NAMES = {1e3: "kNm or kN", 1e-3: "mNm or mN"}
_NEAR = 0.35
_MOST_CAUSES = 3
# a factor of a torque that must be detectable
_OUGHT_TO_SHOW = 1.2
# ratio to the model's torque, relative to the median of all joints, from which on the torque of a
# joint with an undetectable factor is doubtful
_UNLIKE = 1.1
# ratio to the model's torques in all joints, from which on another unit is suspected
_OTHER_UNIT = 10.0


@dataclass(frozen=True, eq=False)
class Mistake:
    """A mistake in the signals, as far as torques show it.

    Attributes:
        cause: Cause in words; two if torques do not distinguish them.
        before: Residual of the mean torques, RMS in units of the noise from repetitions.
        after: The same without the mistake.
        negative: Friction or rotor inertia below zero, in words; empty without.
    """

    cause: str
    before: float
    after: float
    negative: str

    @property
    def reason(self) -> str:
        """Reason in words."""
        sentence = (
            f"the residual torque of the model is {self.before:.3g} times the noise, and "
            f"{self.after:.3g} times without that"
        )
        return f"{self.negative}; {sentence}" if self.negative else sentence


@dataclass(frozen=True, eq=False)
class _Fit:
    """Residual with one change of the signals.

    Attributes:
        change: The change.
        residual: Mean square of the residual, in units of the noise's.
        negative: Impossible parameters below zero, in words.
        torques: M, shape (N, N); with factors s of the torques the residual is ``s' M s``.
        freedom: Number of used torques minus number of parameters.
    """

    change: SignalChange
    residual: float
    negative: str
    torques: np.ndarray
    freedom: int


def find_mistake(
    regressor: Regressor, base: BaseParameters, motion: AveragedMotion
) -> Mistake | None:
    """Return the mistake in the signals of a motion; None if none is found.

    Args:
        regressor: Regressor of the robot, with friction.
        base: Its base parameters.
        motion: The motion.
    """
    comparison = _Comparison(regressor, base, motion)
    unchanged = comparison.unchanged
    is_much = unchanged.residual > _SUSPICIOUS
    if not is_much and not unchanged.negative:
        return None
    fits = [*comparison.fits(), *comparison.units()]
    much_less = [f for f in fits if f.residual <= 1.0 + _MUCH_LESS * (unchanged.residual - 1.0)]
    sound = [fit for fit in much_less if not fit.negative]
    # of two simultaneous mistakes, one remains if the other is undone
    found = (sound or much_less) if is_much else []
    if not found and unchanged.negative:
        found = [f for f in fits if not f.negative and f.residual <= _NO_MORE * unchanged.residual]
    if not found:
        return None
    least = min(fit.residual for fit in found)
    alike = [fit for fit in found if fit.residual <= _ALIKE * least]
    fewest = min(fit.change.steps for fit in alike)
    alike = sorted((f for f in alike if f.change.steps == fewest), key=lambda fit: fit.residual)
    return Mistake(
        ", or ".join([fit.change.cause for fit in alike][:2]),
        float(np.sqrt(unchanged.residual)),
        float(np.sqrt(alike[0].residual)),
        unchanged.negative,
    )


def doubtful_signals(
    regressor: Regressor, base: BaseParameters, motion: AveragedMotion, nominal: np.ndarray
) -> list[str]:
    """Return properties of the signals that cannot be verified or are doubtful, one sentence each.

    Args:
        regressor: Regressor of the robot, with friction.
        base: Its base parameters.
        motion: The motion.
        nominal: Parameters of the model, shape (n,); NaN if it has none.
    """
    comparison = _Comparison(regressor, base, motion)
    most = max(_SUSPICIOUS, _NO_MORE * comparison.unchanged.residual)
    undetected = [
        f.change.cause for f in comparison.fits() if f.residual <= most and not f.negative
    ]
    notes = []
    if undetected:
        notes.append(f"these torques would not show it if {_join_causes(undetected)}")
    of_factor = list(comparison.of_factor(_OUGHT_TO_SHOW))
    names = [name for name, fit in of_factor if fit.residual <= most]
    if names:
        notes.append(
            f"a factor of {_OUGHT_TO_SHOW:g} in tau of {', '.join(names)} (unit, gear ratio) would "
            "not show in the torques of the other joints"
        )
    ratio = comparison.ratio_to(np.nan_to_num(nominal))
    usual = float(np.median(ratio))
    if np.isfinite(nominal).all():
        notes.extend(
            f"tau of {name} is {own:.2g} times the model's torque (masses and friction), of all "
            f"joints {usual:.2g} times: its unit, gear ratio or torque constant?"
            for (name, _), own in zip(of_factor, ratio.tolist(), strict=True)
            if name in names and not 1.0 / _UNLIKE < own / usual < _UNLIKE
        )
    knows = np.nan_to_num(nominal).any()
    if knows and (np.all(ratio > _OTHER_UNIT) or np.all(ratio < 1.0 / _OTHER_UNIT)):
        notes.append(
            f"all torques are about {usual:.2g} times the model's torques (masses and "
            "friction): unit of tau?"
        )
    return notes


class _Comparison:
    """Residuals of the torques in some samples of a motion, with changed signals."""

    def __init__(self, regressor: Regressor, base: BaseParameters, motion: AveragedMotion) -> None:
        self._regressor, self._base = regressor, base
        count = len(motion.q)
        some = np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).astype(int))
        still = joints_at_rest(regressor.subject, motion.v)
        # if all joints do, the unit of time may be another one
        moves = ~still | still.all()
        self._motion = [motion.q[some], motion.v[some] * moves, motion.a[some] * moves]
        self._tau = motion.tau[some]
        self._noise, self._periods = np.sqrt(motion.mean_torque_variance), motion.periods
        joints = len(regressor.subject.joint_names)
        nothing = SignalChange.nothing(joints)
        self._solved: tuple[object, ...] = ()
        self._matrix = self._columns(nothing)
        self.unchanged = self._fit(nothing, self._matrix)

    def fits(self) -> Iterator[_Fit]:
        """Yield the residual with each likely change."""
        subject, matrix = self._regressor.subject, self._matrix
        motion: tuple[bytes, ...] = ()
        for change in likely_changes(subject.joint_names, subject.joint_units):
            if change.motion != motion:
                motion, matrix = change.motion, self._columns(change)
            # a DELTA robot has no torques at impossible positions
            if np.all(np.isfinite(matrix)):
                yield self._fit(change, matrix)

    def units(self) -> Iterator[_Fit]:
        """Yield the residual with the best factor of the torque of a joint."""
        names = self._regressor.subject.joint_names
        for j in range(len(names) if len(names) > 1 else 0):
            found = [fit for start in _UNITS_FROM for fit in self._of_best_factor(j, start)]
            if found:
                yield min(found, key=lambda fit: fit.residual)

    def of_factor(self, factor: float) -> Iterator[tuple[str, _Fit]]:
        """Yield each joint, and the residual with a factor of its torque."""
        names = self._regressor.subject.joint_names
        for j, name in enumerate(names):
            yield name, self._fit(_of_unit(names, j, factor), self._matrix)

    def ratio_to(self, parameters: np.ndarray) -> np.ndarray:
        """Return the ratio of measured torques to those of parameters, RMS, shape (N,)."""
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
        residual = float(signs @ equations.residual_squares @ signs) / equations.freedom
        negative = never_negative(
            self._base,
            equations.parameters @ signs,
            equations.deviation * np.sqrt(max(residual, 1.0)),
            equations.sizes / np.sqrt(self._periods),
        )
        words = "" if negative is None else describe_negative(*negative)
        return _Fit(change, residual, words, equations.residual_squares, equations.freedom)

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


def _join_causes(causes: list[str]) -> str:
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
