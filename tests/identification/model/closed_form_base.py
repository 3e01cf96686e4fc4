"""Base parameters of revolute joints in closed form (Sec. 2.4.6, Appendix B), and Tab. C.3.

What Appendix B sums up for links between parallel and perpendicular axes, after Mayeda et al.,
is one rule, and holds for axes at any angle: **mass on the axis of joint i belongs as well to
link i - 1 as to link i**. Its three moments, ``m``, ``mz`` and the inertia across, can be taken
off link i, which keeps ``Izz, mx, my, Ixx - Iyy, Ixy, Ixz, Iyz``, and put on the link before. Done
from the tip to the base this gives the sums in (B.4), (B.5), where

- in (B.5b) ``I_i`` is taken about the origin of frame i, and l_i has the index i everywhere;
- in (B.5d) the factor ``z`` is 1, in (B.5e) the last term is added, ``+ 2 l_j,z zeta_a,j``;
- the signs of zeta_b follow the twist: as printed for alpha = +90 deg, opposite for -90 deg
  (``z_5 = -y_4`` in rows 18, 22 of Tab. B.2, where Tab. 2.1 has alpha_4 = -90 deg).

Links whose axes are all parallel to the first turn about one fixed direction: only ``Izz, mx, my``
have an effect, of the first link no ``mx, my`` either if gravity is parallel to its axis (B.2).
Rotors of the first joint, and of the first joint across its axis, can be part of the inertia of
their joints' links, about an axis that nothing else turns about.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identification.consistency.bounds import shipped_or_own
from identification.model.base import BaseParameters
from identification.model.dynamic_parameters import (
    LINK_PARAMETERS,
    PER_LINK,
    parameter_names,
    parameter_units,
    transform_parameters,
)
from identification.model.subject import Subject
from pfsc_drake.checks import require, require_numbers
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.robot.serial.rotor_coupling import RotorMount
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.typed import load_file

# sine of an angle that counts as none
_PARALLEL = 1e-9
_M, _MZ, _IXX, _IYY = (LINK_PARAMETERS.index(name) for name in ("m", "mz", "Ixx", "Iyy"))
# in the order of Tab. B.2
_KEPT = [LINK_PARAMETERS.index(k) for k in ("Izz", "mx", "my", "Ixx", "Ixy", "Ixz", "Iyz")]
_KEPT_PLANAR = _KEPT[:3]
_Z = np.array([0.0, 0.0, 1.0])


def analytic_base(subject: Subject, friction: bool = True, coupling: bool = True) -> BaseParameters:
    """Return the base parameters of (B.4), (B.5), in the order of Tab. B.2, errata corrected.

    Those of a DELTA robot are its parameters themselves (Sec. 2.4.6).

    Args:
        subject: The robot.
        friction: Whether friction is among the parameters.
        coupling: Whether spinning rotors and turning links act on each other, where
            ``subject.mounts`` says how the rotors sit.

    Raises:
        InputError: If a joint of a serial robot slides, or its axis is not z of its link frame.
    """
    names, units = parameter_names(subject, friction), parameter_units(subject, friction)
    if subject.chain is None:
        return BaseParameters(np.arange(len(names)), np.eye(len(names)), names, units)
    chain, n = subject.chain, subject.dimension
    _check(subject.name, chain.links)
    parallel = _parallel_to_first(chain.links)
    moments = _collected(chain.links, len(names))
    rows, indices = [], []
    for i in range(n):
        base_names = _KEPT_PLANAR if i < parallel else _KEPT
        first_axis = chain.links[0].R_PF @ _Z
        if i == 0 and np.linalg.norm(np.cross(first_axis, chain.gravity)) <= _PARALLEL:
            base_names = base_names[:1]
        rows += list(moments[i][base_names])
        indices += [PER_LINK * i + k for k in base_names]
    mounts = subject.mounts if coupling else None
    for j in range(n):
        column = PER_LINK * n + j
        ratio = float(subject.gear_ratio[j])
        mount = None if mounts is None else mounts[j]
        added = _added_inertia(chain.links, parallel, j, ratio, mount)
        for name, size in added.items():
            rows[indices.index(PER_LINK * j + LINK_PARAMETERS.index(name))][column] = size
        if not added:
            rows.append(np.eye(len(names))[column])
            indices.append(column)
    of_friction = range((PER_LINK + 1) * n, len(names))
    rows += list(np.eye(len(names))[of_friction])
    indices += list(of_friction)
    return BaseParameters(np.array(indices), np.array(rows), names, units)


def _check(name: str, links: Sequence[ChainLink]) -> None:
    for i, link in enumerate(links, start=1):
        if not link.is_revolute:
            raise InputError(
                f"{name}: joint {i} ({link.name}) slides; must turn, for base parameters in "
                "closed form; those found with numbers serve any chain"
            )
        if np.linalg.norm(np.cross(link.axis, _Z)) > _PARALLEL:
            raise InputError(
                f"{name}: joint {i} ({link.name}) turns about {link.axis.tolist()}; must be z of "
                "its link frame, for base parameters in closed form; those found with numbers "
                "serve any chain"
            )


def _collected(links: Sequence[ChainLink], size: int) -> list[np.ndarray]:
    """Return each link's ten parameters with what came from links behind, shape (10, size)."""
    moments = [np.eye(size)[PER_LINK * i : PER_LINK * (i + 1)] for i in range(len(links))]
    for i in reversed(range(len(links))):
        own = moments[i]
        # m, mz and the inertia across of what lies on the axis
        on_axis = np.zeros_like(own)
        on_axis[[_M, _MZ, _IXX, _IYY]] = own[[_M, _MZ, _IYY, _IYY]]
        moments[i] = own - on_axis
        if i > 0:
            to_parent = [
                transform_parameters(unit, links[i].R_PF, links[i].p_PF)
                for unit in np.eye(PER_LINK)
            ]
            moments[i - 1] = moments[i - 1] + np.transpose(to_parent) @ on_axis
    return moments


def _parallel_to_first(links: Sequence[ChainLink]) -> int:
    """Return how many links turn about the direction of the first axis only, beta_1."""
    for i, link in enumerate(links[1:], start=1):
        if np.linalg.norm(np.cross(link.R_PF @ _Z, _Z)) > _PARALLEL:
            return i
    return len(links)


def _added_inertia(
    links: Sequence[ChainLink],
    parallel: int,
    j: int,
    ratio: float,
    mount: RotorMount | None,
) -> dict[str, float]:
    """Return what a rotor's inertia adds to parameters of its joint's link; none if it is its own.

    In the energy ``Izz_j`` has ``v_j^2 / 2`` as the rotor has ``ratio^2``, as long as no joint
    before turns about that axis. The coupling ``ratio v_j (axis . omega)`` of a rotor on its own
    joint's link belongs to products of inertia.
    """
    if j not in (0, parallel) or (j > 0 and abs((links[j].R_PF @ _Z)[2]) > _PARALLEL):
        return {}
    sign = float(links[j].axis[2])
    if mount is not None and mount.link == j + 1:
        x, y, z = sign * ratio * np.asarray(mount.axis, dtype=float)
        products = {"Ixz": x, "Iyz": y} if j > 0 else {}
        return {"Izz": ratio**2 + 2.0 * z, **products}
    unmoved = mount is None or mount.link == 0
    if unmoved or (mount is not None and mount.link <= j and abs(mount.axis[2]) <= _PARALLEL):
        return {"Izz": ratio**2}
    return {}


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
        require_numbers("mean", self.mean, SIZE)
        key, deviation = "relative_deviation_percent", self.relative_deviation_percent
        require_numbers(key, deviation, SIZE)
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
            require_numbers(key, value, AXES)
            require(bool(np.all(value > 0.0)), key, value, "positive")


@dataclass
class PrintedIdentification:
    """Tab. C.3 and C.4.

    Attributes:
        name: Name of the robot.
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
