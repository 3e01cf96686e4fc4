"""The experiment of App. C on a simulated robot, and preparation of a record for an estimate."""

from dataclasses import dataclass

import numpy as np

from identification.estimation.wiring import find_mistake
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.run_in import run_of
from identification.measurement.imperfections import Imperfections, shipped_imperfections
from identification.measurement.periods import AveragedMotion, average
from identification.measurement.record import Record
from identification.measurement.servo import Servo, friction_torques, rigid_torques
from identification.measurement.station import build_station, simulate_diagram
from identification.measurement.synchronization import check_torque_lag
from identification.model.base import BaseParameters, base_parameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress

PERIODS = 5  # Sec. C.2
_CHUNK = 0.25  # s, between reports of progress


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """A simulated experiment and its measurement; N joints, K samples.

    Attributes:
        record: Measurement, the periods without run-in and run-out.
        q: Simulated positions [rad or m], shape (K, N).
        v: Simulated velocities, shape (K, N).
        tau: Simulated drive torques, as they act about the instants [Nm or N], shape (K, N).
        reference: Reference positions [rad or m], shape (K, N).
        coulomb: ``f_c`` of this run [Nm or N], shape (N,).
        viscous: ``f_v`` of this run [Nm s/rad or N s/m], shape (N,).
    """

    record: Record
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    reference: np.ndarray
    coulomb: np.ndarray
    viscous: np.ndarray


def run_experiment(
    subject: Subject,
    trajectory: FourierTrajectory,
    imperfections: Imperfections | None = None,
    *,
    periods: int = PERIODS,
    servo: Servo | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> SimulatedRun:
    """Simulate a robot that follows an excitation, and measure it.

    The robot obeys (2.36) with the rotors' inertias, their coupling with the links if the mounts
    are known, and dry and viscous friction with sticking; or (2.72). It starts at rest on the
    excitation, accelerates along it, and runs the periods. A torque sample is the drive's torque at
    its instant, between the steps of the feedback their mean, plus noise.

    Args:
        subject: The robot, with known friction.
        trajectory: The excitation, within the limits of the robot.
        imperfections: Imperfections of this run; by default the shipped noise and encoders of the
            robot.
        periods: Number of periods of the excitation.
        servo: The controller.
        seed: Seed of all random numbers; one run for each.
        progress: Receives the completed fraction and the current step.

    Raises:
        InputError: If friction or noise are not known, the trajectory belongs to another robot or
            exceeds its limits or those of the drives, its period is not a multiple of the sampling
            time, or the motion cannot be simulated.
    """
    servo, random = servo or Servo(), np.random.default_rng(seed)
    faults = shipped_imperfections(subject.family) if imperfections is None else imperfections
    faults.check_size(subject.dimension)
    usual = _usual_friction(subject)
    coulomb, viscous = faults.friction(*usual, random)
    run = run_of(subject, trajectory, periods, 1.0 / servo.period)
    _, *motion = run.sample(1.0 / servo.period)
    rigid = rigid_torques(subject, *motion)
    check_effort(subject, rigid + friction_torques(motion[1], *usual))
    friction = (coulomb, viscous)
    station = build_station(subject, run, faults, servo, friction, rigid, random)
    # the run-out is for real robots
    ticks = round((run.duration - run.ramp) / servo.period)
    stride = max(1, round(_CHUNK / servo.period))
    ends = [tick * servo.period for tick in [*range(stride, ticks, stride), ticks]]
    tell = progress or (lambda fraction, phase: None)
    t, signals = simulate_diagram(
        *station, servo.period, ends, lambda fraction: tell(fraction, "simulating the experiment")
    )
    # torques acting before a tick and after it
    feedback = signals["feedback"].copy()
    feedback[1:] = 0.5 * (feedback[1:] + feedback[:-1])
    limit = subject.effort_limit
    tau = np.clip(feedback + signals["feed_forward"], -limit, limit)
    first = round(run.ramp / servo.period)
    window = slice(first, first + round(periods * trajectory.period / servo.period))
    q, v, tau, measured = (
        values[window] for values in (*np.split(signals["state"], 2, axis=1), tau, signals["q"])
    )
    record = Record(
        t[window] - t[first],
        measured + faults.position_noise * random.normal(size=q.shape),
        tau + faults.torque_noise * random.normal(size=q.shape),
        tuple(subject.joint_names),
        trajectory.period,
        source=f"simulated {subject.name}",
    )
    reference = run.motion(t[window])[0]
    return SimulatedRun(record, q, v, tau, reference, coulomb, viscous)


def _usual_friction(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    if subject.coulomb is None or subject.viscous is None:
        raise InputError(
            f"{subject.name}: friction is not known; a robot with known friction is required "
            "for a simulated experiment"
        )
    return subject.coulomb, subject.viscous


def check_effort(subject: Subject, tau: np.ndarray) -> None:
    """Refuse a motion that exceeds a drive's torque: clipped torques cannot be evaluated.

    Args:
        subject: The robot.
        tau: Torques of the motion [Nm or N], shape (K, N).

    Raises:
        InputError: If a drive would exceed its limit.
    """
    largest = np.abs(tau).max(axis=0)
    j = int(np.argmax(largest - subject.effort_limit))
    if largest[j] > subject.effort_limit[j]:
        unit = "Nm" if subject.joint_units[j] == "rad" else "N"
        raise InputError(
            f"excitation: needs {largest[j]:.4g} {unit} at {subject.joint_names[j]}; must stay "
            f"within the drive's {subject.effort_limit[j]:.4g} {unit}"
        )


def prepare_motion(
    record: Record,
    regressor: Regressor,
    base: BaseParameters | None = None,
    *,
    skip: int = 1,
    bandwidth_hz: float | None = None,
) -> AveragedMotion:
    """Return one period of a record with synchronous torques and motion.

    Signs, order and units are checked before a delay is reported: torques with a wrong sign are
    best explained by a model with a small shift.

    Args:
        record: Record with its period.
        regressor: Regressor of the record's robot.
        base: Its base parameters; computed if omitted.
        skip: Periods at the start to leave out.
        bandwidth_hz: ``f_g`` [Hz]; by default ``20 / T_f``.

    Raises:
        InputError: If the periods cannot be averaged, a signal has the wrong sign, joint or unit,
            or torques and positions were not sampled at the same
            instants.
    """
    motion = average(record, skip=skip, bandwidth_hz=bandwidth_hz)
    mistake = find_mistake(regressor, base or base_parameters(regressor), motion)
    if mistake is not None:
        raise InputError(f"{record.source}: {mistake.cause}: {mistake.reason}")
    check_torque_lag(motion, regressor.matrix(motion.q, motion.v, motion.a))
    return motion
