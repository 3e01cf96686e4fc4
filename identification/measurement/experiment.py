"""The experiment of App. C on a simulated robot, and a record of one, ready for an estimate."""

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
_CHUNK = 0.25  # s, after which progress is told


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """What a simulated experiment was, and what was measured of it; N joints, K samples.

    Attributes:
        record: What was measured, the periods without run-in and run-out.
        q: True positions [rad or m], shape (K, N).
        v: True velocities, shape (K, N).
        tau: True drive torques, as they act about the instants [Nm or N], shape (K, N).
        reference: Positions that were asked for [rad or m], shape (K, N).
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
    """Let a simulated robot follow an excitation, and measure it.

    The robot obeys (2.36) with the rotors' inertias, their coupling with the links where it is
    known how they sit, and dry and viscous friction that sticks; or (2.72). It starts at rest
    on the excitation, gathers speed along it, and runs the periods. A torque sample is what the
    drive gives at its instant, between the steps of the feedback their mean, plus noise.

    Args:
        subject: The robot; its friction has to be known.
        trajectory: The excitation, within the limits of the robot.
        imperfections: Imperfections of this run; by default the shipped noise and encoders of the
            robot.
        periods: How often the excitation is run.
        servo: The controller.
        seed: Seed of all random numbers; one run for each.
        progress: Told the fraction done and what is done.

    Raises:
        InputError: If friction or noise are not known, the trajectory is of another robot or
            beyond its limits or those of the drives, its period is no multiple of the sampling
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
    # the run-out serves a real robot
    ticks = round((run.duration - run.ramp) / servo.period)
    stride = max(1, round(_CHUNK / servo.period))
    ends = [tick * servo.period for tick in [*range(stride, ticks, stride), ticks]]
    tell = progress or (lambda fraction, phase: None)
    t, signals = simulate_diagram(
        *station, servo.period, ends, lambda fraction: tell(fraction, "simulating the experiment")
    )
    # what acts up to a tick and what acts from it on
    feedback = signals["feedback"].copy()
    feedback[1:] = 0.5 * (feedback[1:] + feedback[:-1])
    limit = subject.effort_limit
    tau = np.clip(feedback + signals["feed_forward"], -limit, limit)
    first = round(run.ramp / servo.period)
    kept = slice(first, first + round(periods * trajectory.period / servo.period))
    q, v, tau, measured = (
        values[kept] for values in (*np.split(signals["state"], 2, axis=1), tau, signals["q"])
    )
    record = Record(
        t[kept] - t[first],
        measured + faults.position_noise * random.normal(size=q.shape),
        tau + faults.torque_noise * random.normal(size=q.shape),
        tuple(subject.joint_names),
        trajectory.period,
        source=f"simulated {subject.name}",
    )
    reference = run.motion(t[kept])[0]
    return SimulatedRun(record, q, v, tau, reference, coulomb, viscous)


def _usual_friction(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    if subject.coulomb is None or subject.viscous is None:
        raise InputError(
            f"{subject.name}: friction is not known; a robot whose parameters tell it is required "
            "for a simulated experiment"
        )
    return subject.coulomb, subject.viscous


def check_effort(subject: Subject, tau: np.ndarray) -> None:
    """Refuse a motion whose torques a drive does not have: clipped, they tell nothing.

    Args:
        subject: The robot.
        tau: Torques that the motion takes [Nm or N], shape (K, N).

    Raises:
        InputError: If a drive is asked for more than it has.
    """
    largest = np.abs(tau).max(axis=0)
    j = int(np.argmax(largest - subject.effort_limit))
    if largest[j] > subject.effort_limit[j]:
        unit = "Nm" if subject.joint_units[j] == "rad" else "N"
        raise InputError(
            f"excitation: asks {subject.joint_names[j]} for {largest[j]:.4g} {unit}; must stay "
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
    """Return one period of a record whose torques belong to its motion.

    Signs, order and units are tried before a delay is named: torques with a wrong sign are best
    explained by a model when they are shifted a little.

    Args:
        record: With its period.
        regressor: Regressor of the robot whose record it is.
        base: Its base parameters, if they are there already.
        skip: Periods at the start that are left out.
        bandwidth_hz: ``f_g`` [Hz]; by default ``20 / T_f``.

    Raises:
        InputError: If the periods cannot be averaged, a signal has the wrong sign, another
            joint's place or another unit, or torques and positions were not sampled at the same
            instants.
    """
    motion = average(record, skip=skip, bandwidth_hz=bandwidth_hz)
    mistake = find_mistake(regressor, base or base_parameters(regressor), motion)
    if mistake is not None:
        raise InputError(f"{record.source}: {mistake.cause}: {mistake.reason}")
    check_torque_lag(motion, regressor.matrix(motion.q, motion.v, motion.a))
    return motion
