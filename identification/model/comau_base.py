"""What the dissertation identified of the Comau Racer 1.4: Tab. B.2, C.3 and C.4 as data."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identification.model.analytic_base import analytic_base
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.parameter_checks import check_vector, require
from pfsc_drake.yaml.typed import REQUIRED, load_file


def shipped_or_own(robot: str | Path, name: str) -> Path:
    """Return a file that is shipped with a robot, or a user's own.

    Args:
        robot: Name of a shipped robot, or a file.
        name: Of the shipped file.

    Raises:
        InputError: If there is no such file with the robot.
    """
    path = Path(robot)
    if path.suffix:
        return path
    path = models_directory() / path / name
    if not path.is_file():
        known = sorted(file.parent.name for file in models_directory().glob(f"*/{name}"))
        raise InputError(f"robot {str(robot)!r}: must be a file or one of {', '.join(known)}")
    return path


AXES, SIZE = 6, 52
FILE_NAME = "identified_base_parameters.yaml"
_PERCENT = 0.01


@dataclass
class PrintedBase:
    """Identified base parameters, in the order of Tab. B.2.

    Attributes:
        mean: ``[52]`` of several runs, SI units.
        relative_deviation_percent: ``[52]`` standard deviations of the runs, of the means [%].
    """

    mean: np.ndarray = field(default_factory=lambda: np.ones(SIZE), metadata=REQUIRED)
    relative_deviation_percent: np.ndarray = field(
        default_factory=lambda: np.ones(SIZE), metadata=REQUIRED
    )
    source: str = ""

    def __post_init__(self) -> None:
        check_vector("mean", self.mean, SIZE)
        key, deviation = "relative_deviation_percent", self.relative_deviation_percent
        check_vector(key, deviation, SIZE)
        require(bool(np.all(deviation > 0.0)), key, deviation, "positive")

    @property
    def relative_deviation(self) -> np.ndarray:
        """``[52]`` standard deviations in units of the magnitude of the means."""
        return self.relative_deviation_percent * _PERCENT

    @property
    def standard_deviation(self) -> np.ndarray:
        """``[52]`` standard deviations, SI units."""
        return self.relative_deviation * np.abs(self.mean)


@dataclass
class PrintedTorque:
    """Measured torques beside predicted ones, at the joint side.

    Attributes:
        error_rms: ``[6]`` root mean square of the prediction error [Nm].
        noise_level: ``[6]`` of the measured torque [Nm].
        variance: ``[6]`` diagonal of the covariance matrix of the estimation [Nm^2].
    """

    error_rms: np.ndarray = field(default_factory=lambda: np.ones(AXES), metadata=REQUIRED)
    noise_level: np.ndarray = field(default_factory=lambda: np.ones(AXES), metadata=REQUIRED)
    variance: np.ndarray = field(default_factory=lambda: np.ones(AXES), metadata=REQUIRED)
    source: str = ""

    def __post_init__(self) -> None:
        for key in ("error_rms", "noise_level", "variance"):
            value = getattr(self, key)
            check_vector(key, value, AXES)
            require(bool(np.all(value > 0.0)), key, value, "positive")


@dataclass
class PrintedIdentification:
    """Tab. C.3 and C.4.

    Attributes:
        name: Of the robot.
        base_parameters: What was identified.
        torque: How well it predicts.
    """

    name: str = field(default="unnamed", metadata=REQUIRED)
    base_parameters: PrintedBase = field(default_factory=PrintedBase, metadata=REQUIRED)
    torque: PrintedTorque = field(default_factory=PrintedTorque, metadata=REQUIRED)


def load_printed_identification(
    robot: str | Path = "comau_racer_1_4",
) -> PrintedIdentification:
    """Return what was identified of a robot.

    Args:
        robot: Name of a shipped robot, or a YAML file.

    Raises:
        InputError: If the file cannot be read, or a key is unknown, missing or out of range.
    """
    return load_file(PrintedIdentification, shipped_or_own(robot, FILE_NAME))


def printed_base(subject: Subject) -> np.ndarray:
    """Return the combinations of Tab. B.2, errata corrected, shape (52, n).

    Times the parameters of :mod:`~identification.model.parameters` they give what Tab. C.3 lists.
    Rows 1 and 2 hold the inertias of rotors 1 and 2, too, which add to moments of inertia of the
    links and which the table leaves out.

    Args:
        subject: A Comau Racer 1.4, or a robot with axes like it.

    Raises:
        InputError: If the robot has another number of base parameters.
    """
    base = analytic_base(subject)
    if base.rank != SIZE:
        raise InputError(
            f"{subject.name}: {base.rank} base parameters; must be {SIZE} for Tab. B.2"
        )
    return base.projection
