"""A periodic motion for a robot's controller: from rest, some periods, to rest.

The robot moves along the periodic motion from the first instant on, with increasing speed: the
motion is ``q(s(t))`` with the rate ``s'`` of its clock rising from 0 to 1 before the first period,
and falling after the last. Thus the postures, and with them position limits and clearances, are
those of one period; if velocities and accelerations of the ramps are not, the ramps get longer.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.excitation.fourier import FourierTrajectory, samples_per_period
from identification.model.subject import Subject
from identification.output import write_text
from pfsc_drake.errors import InputError

# rate of the clock on a ramp of unit length, C^4 at both ends
_RATE = np.polynomial.Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
_CLOCK, _CHANGE = _RATE.integ(), _RATE.deriv()
_RAMP_SAMPLES = 2000
_LONGER = 1.2
_MOST_PERIODS = 10  # in one ramp
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class ExcitationRun:
    """A motion from rest to rest with whole periods of an excitation in between.

    Attributes:
        trajectory: The periodic motion.
        periods: Number of full periods.
        ramp: Duration of run-in and run-out, each [s].
    """

    trajectory: FourierTrajectory
    periods: int
    ramp: float

    @property
    def duration(self) -> float:
        """Time from rest to rest [s]."""
        return 2.0 * self.ramp + self.periods * self.trajectory.period

    def motion(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return positions, velocities and accelerations.

        Args:
            t: Times since the start [s], shape (K,); before and after the robot is at rest.

        Returns:
            q, v, a, each of shape (K, N) [rad or m, per s, per s^2].
        """
        clock, rate, change = self._clock(np.asarray(t, dtype=float))
        q, v, a = self.trajectory.motion(clock)
        rate, change = rate[:, None], change[:, None]
        return q, v * rate, a * rate**2 + v * change

    def _clock(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return time on the periodic motion [s], its rate and the rate's derivative [1/s]."""
        full = self.periods * self.trajectory.period
        into, out = (np.clip(x / self.ramp, 0.0, 1.0) for x in (t, self.duration - t))
        within = np.clip(t - self.ramp, 0.0, full)
        # each ramp lasts half of its time on the clock of the periodic motion
        clock = within + self.ramp * (_CLOCK(into) - _CLOCK(out))
        return clock, _RATE(into) * _RATE(out), (_CHANGE(into) - _CHANGE(out)) / self.ramp

    def sample(self, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return times and motion at a sampling rate, see :meth:`motion`.

        Args:
            rate: Rate of samples [Hz].

        Returns:
            t, shape (K,), and q, v, a, each of shape (K, N).

        Raises:
            InputError: If the period is not a multiple of the sampling time.
        """
        samples_per_period(self.trajectory.period, rate)
        t = np.arange(round(self.duration * rate) + 1) / rate
        return t, *self.motion(t)

    def export_csv(self, path: str | Path, rate: float, units: list[str] | None = None) -> None:
        """Write the motion for a robot's controller.

        Columns ``t, q_1 .. q_N, v_1 .. v_N, a_1 .. a_N`` under lines with the units and the start
        of the periods; the first and the last row are at rest.

        Args:
            path: Path of the file, which is replaced.
            rate: Rate of samples [Hz].
            units: Units of the joints' positions, N of ``rad`` or ``m``; all rad by default.

        InputError: If the period is not a multiple of the sampling time, or the file cannot be
            written.
                written.
        """
        table = np.column_stack(self.sample(rate))
        n = self.trajectory.dimension
        units = ["rad"] * n if units is None else units
        names = ["t", *(f"{letter}_{i + 1}" for letter in "qva" for i in range(n))]
        lines = [
            f"# {self.periods} periods of {self.trajectory.period:g} s from t = {self.ramp:g} s "
            f"on, from rest to rest; {rate:g} samples per second",
            f"# units: t in s; q_1 .. q_{n} in {', '.join(units)}; v per s; a per s^2",
            ",".join(names),
        ]
        lines += [",".join(f"{value:.9g}" for value in row) for row in table]
        write_text(Path(path), "\n".join(lines) + "\n")


def rest_to_rest(
    trajectory: FourierTrajectory,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    *,
    periods: int = 5,
    rate: float = 1000.0,
) -> ExcitationRun:
    """Return a run with ramps as short as the limits allow.

    Args:
        trajectory: The periodic motion, within the limits.
        velocity: Largest magnitudes of the joint velocities [rad/s or m/s], shape (N,).
        acceleration: Largest magnitudes of the joint accelerations [per s^2], shape (N,).
        periods: Number of full periods.
        rate: Rate of samples [Hz]; ramps are multiples of the sampling time.

    Raises:
        InputError: If there is no period, or no ramp is within the limits.
    """
    if periods < 1:
        raise InputError(f"periods = {periods}; must be 1 or more")
    samples_per_period(trajectory.period, rate)
    longest = _MOST_PERIODS * trajectory.period
    ramp = trajectory.period / max(trajectory.harmonics) / 2.0
    while ramp <= longest:
        ramp = np.ceil(ramp * rate - _ROUNDING) / rate
        run = ExcitationRun(trajectory, periods, ramp)
        into = np.linspace(0.0, ramp, _RAMP_SAMPLES)
        _, v, a = run.motion(np.concatenate([into, run.duration - into]))
        if np.all(np.abs(v) <= velocity) and np.all(np.abs(a) <= acceleration):
            return run
        ramp *= _LONGER
    _, v, a = trajectory.motion(np.linspace(0.0, trajectory.period, _RAMP_SAMPLES))
    share = max((np.abs(v) / velocity).max(), (np.abs(a) / acceleration).max())
    raise InputError(
        f"excitation: no ramp of up to {longest:g} s keeps the limits of velocity and "
        f"acceleration; one period takes {100.0 * share:.3g} % of them, must be less than 100 %"
    )


def run_of(
    subject: Subject, trajectory: FourierTrajectory, periods: int, rate: float
) -> ExcitationRun:
    """Return the run of a robot, within its limits of position, velocity and acceleration.

    Args:
        subject: The robot.
        trajectory: The periodic motion.
        periods: Number of full periods.
        rate: Rate of samples [Hz].

    Raises:
        InputError: If the motion belongs to another robot or leaves the position limits, or as in
            :func:`rest_to_rest`.
    """
    n = subject.dimension
    if trajectory.dimension != n:
        raise InputError(
            f"excitation: of {trajectory.dimension} joints; {subject.name} has {n} joints"
        )
    q = trajectory.motion(trajectory.sample_times(rate))[0]
    lower, upper = subject.position_limits.T
    beyond = np.maximum(q.max(axis=0) - upper, lower - q.min(axis=0))
    j = int(np.argmax(beyond))
    if beyond[j] > 0.0:
        unit = subject.joint_units[j]
        raise InputError(
            f"excitation: {subject.joint_names[j]} goes from {q[:, j].min():.4g} to "
            f"{q[:, j].max():.4g} {unit}; must stay within {lower[j]:.4g} to {upper[j]:.4g} {unit}"
        )
    velocity, acceleration = subject.velocity_limit, subject.acceleration_limit
    return rest_to_rest(trajectory, velocity, acceleration, periods=periods, rate=rate)
