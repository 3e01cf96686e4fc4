"""Imperfections of a simulated measurement, as in a real one."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import FrictionDrift
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.typed import load_file


@dataclass
class MeasurementFile:
    """Content of ``models/<robot>/measurement.yaml``: quality of a robot's measurement.

    Attributes:
        torque_noise: ``[N]`` standard deviations of one torque sample [Nm or N].
        encoder_increments: ``[N]`` increments per revolution of the joint (per metre of a slide).
    """

    torque_noise: np.ndarray = field(default_factory=lambda: np.ones(1), metadata=REQUIRED)
    encoder_increments: np.ndarray = field(default_factory=lambda: np.ones(1), metadata=REQUIRED)
    source: str = ""


@dataclass(frozen=True, eq=False)
class Imperfections:
    """Noise, disturbances, and friction that is not the same in every run.

    Attributes:
        torque_noise: Standard deviation of white noise on the measured torques [Nm or N], shape
            (N,); Tab. C.4.
        encoder_increments: Per revolution of a joint (per metre of a slide), shape (N,); 0 for
            exact encoders.
        position_noise: Standard deviation of white noise on the recorded positions [rad or m],
            beside the increments.
        disturbance: Standard deviation of a coloured torque that acts on the joints beside the
            drives, like the ripple of gears, in units of ``torque_noise``.
        disturbance_time: Its correlation time [s] (first-order autoregressive process).
        coulomb_spread: Relative standard deviation of ``f_c`` from run to run, for each joint.
        viscous_spread: The same for ``f_v``.
        drift: Change of friction within a run, if any.

    Raises:
        InputError: If a value is negative or not finite.
    """

    torque_noise: np.ndarray
    encoder_increments: np.ndarray
    position_noise: float = 0.0
    disturbance: float = 0.0
    disturbance_time: float = 0.1
    coulomb_spread: float = 0.0
    viscous_spread: float = 0.0
    drift: FrictionDrift | None = None

    def __post_init__(self) -> None:
        for name in ("torque_noise", "encoder_increments"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        numbers = {name: value for name, value in vars(self).items() if name != "drift"}
        for name, value in numbers.items():
            if not np.all(np.isfinite(value)) or np.any(np.asarray(value) < 0.0):
                raise InputError(f"{name} = {value}; must be finite and not negative")
        if not self.disturbance_time > 0.0:
            raise InputError(f"disturbance_time = {self.disturbance_time} s; must be positive")

    def realistic(self) -> "Imperfections":
        """Return the imperfections for a spread of parameters between runs as in Tab. C.3.

        They add a coloured disturbance of 0.2 times the noise, and a spread of 2.5 % of the Coulomb
        and 6 % of the viscous friction.
        """
        return replace(self, disturbance=0.2, coulomb_spread=0.025, viscous_spread=0.06)

    def check_size(self, joints: int) -> None:
        """Refuse imperfections of another robot.

        Raises:
            InputError: If they have another number of joints.
        """
        for name in ("torque_noise", "encoder_increments"):
            size = getattr(self, name).size
            if size != joints:
                raise InputError(f"{name}: {size} values; the robot has {joints} joints")

    def coloured_torque(self, samples: int, step: float, random: np.random.Generator) -> np.ndarray:
        """Return the disturbance, stationary from its first sample on, shape (samples, N).

        ``w_k = c w_{k-1} + sqrt(1 - c^2) e_k`` with ``c = exp(-step / disturbance_time)``.

        Args:
            samples: Number of samples.
            step: Sampling time [s].
            random: Random numbers.
        """
        keep = np.exp(-step / self.disturbance_time)
        white = random.normal(size=(samples, self.torque_noise.size))
        white[1:] *= np.sqrt(1.0 - keep**2)
        coloured: np.ndarray = lfilter([1.0], [1.0, -keep], white, axis=0)
        return self.disturbance * self.torque_noise * coloured

    def friction(
        self, coulomb: np.ndarray, viscous: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the Coulomb and viscous friction of one run, each (N,).

        Args:
            coulomb: Usual ``f_c`` [Nm or N], shape (N,).
            viscous: Usual ``f_v`` [Nm s/rad or N s/m], shape (N,).
            random: Random numbers.
        """
        factors = random.normal(size=(2, coulomb.size))
        spread = np.array([[self.coulomb_spread], [self.viscous_spread]])
        f_c, f_v = np.maximum(1.0 + spread * factors, 0.0) * [coulomb, viscous]
        return f_c, f_v


def shipped_imperfections(robot: str) -> Imperfections:
    """Return noise and encoders of a shipped robot, without other imperfections.

    Args:
        robot: Name of the robot.

    Raises:
        InputError: If there are none for a robot of that name.
    """
    folder = models_directory() / robot
    file = folder / "measurement.yaml"
    if Path(robot).name != robot or not file.is_file():
        known = sorted(path.parent.name for path in models_directory().glob("*/measurement.yaml"))
        raise InputError(
            f"measurement noise of '{robot}': not known; allowed: noise of your own, or a robot "
            f"of {', '.join(known)}"
        )
    content = load_file(MeasurementFile, file)
    return Imperfections(content.torque_noise, content.encoder_increments)
