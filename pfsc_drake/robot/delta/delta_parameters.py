"""Physical parameters of a DELTA robot with linear drives, ``models/<robot>/parameters.yaml``.

The inertial frame (0, x_0, y_0, z_0) has its origin in the centre of the base plate, x_0 points to
the first drive and z_0 **down**, from the base to the end-effector (Sec. 2.2). Fig. 2.2 and
Tab. 2.2 define the symbols.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np

from pfsc_drake.checks import require, require_numbers
from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.models.robot_parameters import FrictionParameters
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.rules import Name, NotNegative, Numbers, Parameters, Positive, Range
from pfsc_drake.yaml.typed import load_file

NUM_ARMS = 3
SHIPPED_ROBOTS = ("festo_expt_45",)


def _ones() -> np.ndarray:
    return np.ones(NUM_ARMS)


def _zeros() -> np.ndarray:
    return np.zeros(NUM_ARMS)


@dataclass
class DeltaGeometry(Parameters):
    """Dimensions of the three equal arms.

    Attributes:
        l_BC: length of the rods [m].
        l_A: distance of the rails' upper ends A_i from the base's centre 0 [m].
        l_EC: distance of the rods' lower ends C_i from the end-effector's centre E [m].
        h_P: height of the point P that all rails point to, below the base [m].
    """

    l_BC: Positive = field(default=1.0, metadata=REQUIRED)
    l_A: Positive = field(default=1.0, metadata=REQUIRED)
    l_EC: Positive = field(default=0.1, metadata=REQUIRED)
    h_P: Positive = field(default=1.0, metadata=REQUIRED)
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.l_EC < self.l_A, "l_EC", self.l_EC, f"less than l_A = {self.l_A!r}")

    @property
    def rail_length(self) -> float:
        """Distance ``1 / k_D = sqrt(l_A^2 + h_P^2)`` from A_i to P [m]."""
        return float(np.hypot(self.l_A, self.h_P))

    @property
    def directions(self) -> np.ndarray:
        """Rows e_xi, unit vectors from 0 to A_i, shape (3, 3)."""
        angles = 2.0 * np.pi / NUM_ARMS * np.arange(NUM_ARMS)
        return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(NUM_ARMS)])

    @property
    def rails(self) -> np.ndarray:
        """Rows ``c_i = k_D (l_A e_xi - h_P e_z)`` of (2.29), shape (3, 3).

        Unit vectors from P to A_i; a slide moves along ``-c_i`` when q_i grows.
        """
        down = np.array([0.0, 0.0, self.h_P])
        return (self.l_A * self.directions - down) / self.rail_length

    @property
    def offsets(self) -> np.ndarray:
        """Rows ``(l_A - l_EC) e_xi`` [m], shape (3, 3).

        The rods are ``w_i = y_t - offset_i + q_i c_i`` (2.29).
        """
        return (self.l_A - self.l_EC) * self.directions


@dataclass
class DeltaMasses(Parameters):
    """Masses of the moving parts.

    Attributes:
        slide: m_s,i of each slide with all parts that move with it [kg].
        rod_pair: m_p of the two rods of an arm [kg].
        plate: m_e of the end-effector plate [kg].
        load: m_l of the load on the plate [kg].
    """

    slide: Positive = field(default=1.0, metadata=REQUIRED)
    rod_pair: NotNegative = field(default=0.0, metadata=REQUIRED)
    plate: Positive = field(default=1.0, metadata=REQUIRED)
    load: NotNegative = 0.0
    source: str = ""

    @property
    def effective_slide(self) -> float:
        """Mass ``m_q = m_s + 2/3 m_p`` of a slide with its share of the rods [kg], Sec. 2.4.5."""
        return self.slide + 2.0 / 3.0 * self.rod_pair

    @property
    def effective_plate(self) -> float:
        """Mass ``m_y = m_e + m_l + m_p`` of the end-effector with its share [kg], Sec. 2.4.5."""
        return self.plate + self.load + NUM_ARMS * self.rod_pair / 3.0


@dataclass
class DeltaDrives(Parameters):
    """Limits of the three linear drives.

    Attributes:
        position_lower: ``[3]`` smallest slide positions [m], at least 0.
        position_upper: ``[3]`` largest slide positions [m].
        velocity: ``[3]`` largest absolute slide velocities [m/s].
        effort: ``[3]`` largest absolute drive forces [N].
    """

    position_lower: Annotated[np.ndarray, Numbers(NUM_ARMS, Range(0.0))] = field(
        default_factory=_zeros, metadata=REQUIRED
    )
    position_upper: Annotated[np.ndarray, Numbers(NUM_ARMS)] = field(
        default_factory=_ones, metadata=REQUIRED
    )
    velocity: Annotated[np.ndarray, Numbers(NUM_ARMS, Range(0.0, open=True))] = field(
        default_factory=_ones, metadata=REQUIRED
    )
    effort: Annotated[np.ndarray, Numbers(NUM_ARMS, Range(0.0, open=True))] = field(
        default_factory=_ones, metadata=REQUIRED
    )
    source: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("velocity", "effort"):
            value = getattr(self, key)
            require(bool(np.all(value > 0.0)), key, value, "positive")
        lower, upper = self.position_lower, self.position_upper
        allowed = f"less than position_upper = {upper.tolist()}"
        require(bool(np.all(lower < upper)), "position_lower", lower, allowed)


@dataclass
class DeltaWorkspace(Parameters):
    """Distance of the workspace from singular configurations.

    Attributes:
        min_rod_independence: smallest allowed singular value of the matrix of the three unit rod
            vectors, between 0 (two rods parallel or all in one plane) and 1 (orthogonal).
    """

    min_rod_independence: Annotated[float, Range(0.0, 1.0, open=True, below=True)] = field(
        default=0.1, metadata=REQUIRED
    )
    source: str = ""


@dataclass
class DeltaParameters(Parameters):
    """All physical parameters of a DELTA robot with linear drives.

    Attributes:
        name: of the robot.
        geometry: dimensions.
        masses: of the moving parts.
        gravity: ``[3]`` gravitational acceleration in the inertial frame [m/s^2].
        drives: limits of the drives.
        friction: ``f_c`` [N] and ``f_v`` [Ns/m] of (2.34) for each drive.
        workspace: distance from singular configurations.
    """

    name: Name = field(default="unnamed", metadata=REQUIRED)
    geometry: DeltaGeometry = field(default_factory=DeltaGeometry, metadata=REQUIRED)
    masses: DeltaMasses = field(default_factory=DeltaMasses, metadata=REQUIRED)
    gravity: Annotated[np.ndarray, Numbers(NUM_ARMS)] = field(
        default_factory=_zeros, metadata=REQUIRED
    )
    drives: DeltaDrives = field(default_factory=DeltaDrives, metadata=REQUIRED)
    friction: FrictionParameters = field(
        default_factory=lambda: FrictionParameters(_zeros(), _zeros()), metadata=REQUIRED
    )
    workspace: DeltaWorkspace = field(default_factory=DeltaWorkspace, metadata=REQUIRED)

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("coulomb", "viscous"):
            require_numbers(f"friction.{key}", getattr(self.friction, key), NUM_ARMS)
        upper, end = self.drives.position_upper, self.geometry.rail_length
        allowed = f"less than the rails' length to P, {end:.6g} m"
        require(bool(np.all(upper < end)), "drives.position_upper", upper, allowed)


def load_delta_parameters(robot: str | Path = "festo_expt_45") -> DeltaParameters:
    """Return the parameters of a DELTA robot.

    Args:
        robot: the name of a shipped robot (``"festo_expt_45"``) or the path of a YAML file.

    Raises:
        InputError: if the file cannot be read or a key is unknown, missing or out of range.
    """
    path = Path(robot)
    if not path.suffix:
        if str(robot) not in SHIPPED_ROBOTS:
            known = f"{', '.join(SHIPPED_ROBOTS)}{suggestion(robot, SHIPPED_ROBOTS)}"
            raise InputError(f"DELTA robot {str(robot)!r}: must be a file or one of {known}")
        path = models_directory() / path / "parameters.yaml"
    return load_file(DeltaParameters, path)
