"""What is measured of one elastic joint."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from identification.elastic.weak_form import white_noise
from identification.measurement.checks import check_sampling
from identification.measurement.record import Record
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.rotor_coupling import rotor_momentum

_SAME = 0.02  # by which the motor's travel may differ from the link's, beside
_TWIST = 0.02  # rad or m
_MOST = 0.5
_STILL = 0.05  # of the motor's travel, by which a locked link may move
_NOISE = 6.0  # standard deviations within which a joint stands still


@dataclass(frozen=True, eq=False)
class JointSignals:
    """Torque and positions of one joint at K instants, all on the joint side.

    Attributes:
        name: Of the joint.
        t: Evenly spaced times [s], shape (K,).
        tau: Drive torques ``tau_d`` [Nm or N], shape (K,).
        q_motor: Positions of the motor [rad or m], shape (K,).
        q: Positions of the link, shape (K,).
        unit: ``rad`` or ``m``.
        spin: Angular velocity of the link that carries the rotor, about the rotor's axis, divided
            by the gear ratio [rad/s or m/s], shape (K,); None for no coupling.
        source: Where the signals are from, for messages.
    """

    name: str
    t: np.ndarray
    tau: np.ndarray
    q_motor: np.ndarray
    q: np.ndarray
    unit: str = "rad"
    spin: np.ndarray | None = None
    source: str = "record"

    @property
    def step(self) -> float:
        """Sampling time [s]."""
        return float((self.t[-1] - self.t[0]) / (self.t.size - 1))


def joint_signals(record: Record, subject: Subject, coupling: bool = True) -> list[JointSignals]:
    """Return the signals of all joints of a record.

    Args:
        record: With positions of the motors.
        subject: Whose record it is.
        coupling: Whether what the links' motion does to the rotors (2.62) is taken off, where
            ``subject.mounts`` says how they sit.

    Raises:
        InputError: If there are no positions of motors, the joints are others, the samples are
            not evenly spaced, or motor and link do not move by the same.
    """
    if record.q_motor is None:
        raise InputError(
            f"{record.source}: no q_motor; positions of motors beside those of the links are "
            "required for elastic joints"
        )
    if list(record.joint_names) != list(subject.joint_names):
        raise InputError(
            f"{record.source}: joints {', '.join(record.joint_names)}; must be those of "
            f"{subject.name}: {', '.join(subject.joint_names)}"
        )
    check_sampling(record)
    spin = _spin(record, subject) if coupling else None
    return [
        JointSignals(
            name,
            record.t,
            record.tau[:, j],
            record.q_motor[:, j],
            record.q[:, j],
            subject.joint_units[j],
            None if spin is None else spin[:, j],
            record.source,
        )
        for j, name in enumerate(record.joint_names)
    ]


def _spin(record: Record, subject: Subject) -> np.ndarray | None:
    if subject.chain is None or subject.mounts is None:
        return None
    q, v = (ca.SX.sym(name, subject.dimension) for name in "qv")
    momentum = rotor_momentum(subject.chain, subject.mounts, q, v) / ca.DM(subject.chain.D_M)
    rates = np.gradient(record.q, record.sampling_time, axis=0)
    return np.array(ca.Function("spin", [q, v], [momentum])(record.q.T, rates.T)).T


def check_same_travel(signals: JointSignals) -> None:
    """Refuse positions of a motor that are no positions of that joint.

    Raises:
        InputError: If the motor does not move by as much as the link.
    """
    link = signals.q - signals.q.mean()
    if not link.any():
        raise InputError(
            f"{signals.source}: {signals.name}: q is constant; a joint that moves is required, or "
            "that it is locked has to be said"
        )
    size = link @ link - link.size * white_noise(signals.q) ** 2
    factor = float(link @ signals.q_motor / max(size, 0.1 * (link @ link)))
    # links that are shaken beyond their resonance move otherwise than motors, by a little
    if abs(factor - 1.0) > min(_SAME + _TWIST / float(np.std(link)), _MOST):
        raise InputError(
            f"{signals.source}: q_motor of {signals.name} moves by {factor:.4g} times q; must be 1 "
            "(on the joint side: divided by the gear ratio; sign, unit)"
        )


def check_locked(signals: JointSignals) -> None:
    """Refuse a locked joint whose link moves, or whose motor does not.

    Raises:
        InputError: If so.
    """
    travel = np.ptp(signals.q)
    allowed = 2.0 * _NOISE * white_noise(signals.q)
    windup = float(np.ptp(signals.q_motor))
    if travel > max(allowed, _STILL * windup):
        raise InputError(
            f"{signals.source}: q of {signals.name} moves by {travel:.3g} {signals.unit} while "
            f"q_motor does by {windup:.3g}; a locked joint must stand still"
        )
