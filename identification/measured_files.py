"""Files with measured motions, and how they are read."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from identification.estimation.residuals import choose_bandwidth
from identification.measurement.columns import Reading
from identification.measurement.experiment import prepare_motion
from identification.measurement.files import read_record
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress


@dataclass(frozen=True)
class MeasuredFiles:
    """Files with measured motions, and how they are read.

    Attributes:
        records: Runs of one excitation.
        validation: Measurement of another motion, which is not used to estimate.
        reading: What files say in other words or not at all.
        period: Period of the excitation [s], if files do not state it.
        skip: Periods at the start that are left out.
        bandwidth_hz: Bandwidth of the motion [Hz]; by default the least with which the model
            explains the torques of the first record as well as with any.
    """

    records: Sequence[Path]
    validation: Path | None = None
    reading: Reading = field(default_factory=Reading)
    period: float | None = None
    skip: int = 1
    bandwidth_hz: float | None = None

    @property
    def paths(self) -> list[Path]:
        """All files, that of the other motion last."""
        return [*self.records, *([self.validation] if self.validation else [])]

    def motions(
        self, regressor: Regressor, base: BaseParameters, progress: Progress
    ) -> tuple[list[AveragedMotion], AveragedMotion | None]:
        """Return the motions that are used, and the one that is not.

        Args:
            regressor: Of the robot.
            base: Its base parameters.
            progress: Told the fraction done and what is done.

        Raises:
            InputError: If there is no record, or a file does not tell what is needed.
        """
        if not self.records:
            raise InputError("estimate: no record; at least one is required")
        bandwidth_hz, motions = self.bandwidth_hz, []
        for k, path in enumerate(self.paths):
            progress(k / len(self.paths), f"reading {path.name}")
            record = read_record(path, regressor.subject, self.period, self.reading)
            if bandwidth_hz is None:
                bandwidth_hz = choose_bandwidth(
                    regressor,
                    base,
                    record,
                    self.period,
                    self.skip,
                    lambda _, phase: progress(0.0, phase),
                ).bandwidth_hz
            motions.append(
                prepare_motion(record, regressor, base, skip=self.skip, bandwidth_hz=bandwidth_hz)
            )
        other = motions.pop() if self.validation is not None else None
        return motions, other
