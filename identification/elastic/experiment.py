"""Experiments with the motors and links of a simulated elastic robot, as Drake diagrams."""

from dataclasses import replace

import numpy as np
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LinearSystem, MatrixGain, Multiplexer

from diagrams.signal_log import SignalLog, add_log
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.run_in import run_of
from identification.measurement.experiment import check_effort
from identification.measurement.imperfections import Imperfections
from identification.measurement.record import Record
from identification.measurement.servo import (
    Servo,
    add_curves,
    add_sines,
    add_sum,
    drive_inertia,
    friction_torques,
    rigid_torques,
)
from identification.measurement.station import (
    SetState,
    add_feed_forward,
    add_friction,
    simulate_diagram,
)
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.rotor_coupling import RotorMount
from pfsc_drake.systems.plants.coupled_plants import FullElasticPlant


def zippered_multisine(
    rms: np.ndarray,
    period: float,
    random: np.random.Generator,
    lowest: float = 4.0,
    highest: float = 90.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sines of equal size whose frequencies are distributed over the joints in turns.

    No two joints share a frequency, so that motion at a frequency has one drive as its cause.

    Args:
        rms: Root of the mean square of each joint's torque [Nm or N], shape (N,).
        period: All frequencies are multiples of its reciprocal [s].
        random: Generator of the phases.
        lowest: Frequency [Hz].
        highest: Frequency [Hz].

    Returns:
        A [Nm or N], f [Hz] and p [rad] of ``tau_i = sum_m A_im sin(2 pi f_im t + p_im)``, each
        (N, M) for N joints and M lines each.

    Raises:
        InputError: If a value is not positive, or the frequencies are too few for the joints.
    """
    size = np.asarray(rms, dtype=float)
    if not (np.all(np.isfinite(size)) and np.all(size > 0.0)):
        raise InputError(f"torque to shake joints: rms = {size.tolist()}; must be positive")
    if not (0.0 < lowest < highest < np.inf and 0.0 < period < np.inf):
        raise InputError(
            f"torque to shake joints: {lowest:g} to {highest:g} Hz, period {period:g} s; must be "
            "positive and in this order"
        )
    lines = np.arange(np.ceil(lowest * period), np.floor(highest * period) + 1.0) / period
    each = lines.size // size.size
    if each < 2:
        raise InputError(
            f"torque to shake joints: {lines.size} multiples of {1.0 / period:g} Hz between "
            f"{lowest:g} and {highest:g} Hz; at least {2 * size.size} are required"
        )
    frequency = lines[: each * size.size].reshape(each, size.size).T
    amplitude = np.repeat((size * np.sqrt(2.0 / each))[:, None], each, axis=1)
    return amplitude, frequency, random.uniform(0.0, 2.0 * np.pi, frequency.shape)


RATE = 1000.0  # samples per second
_STEP = 0.25e-3  # s, of the integration
_CHUNK = 0.25  # s, between reports of progress
# RMS of the excitation of locked joints, well above friction, and of moving ones, of the largest
_LOCKED, _MOVING = 0.2, 0.05


def simulate_locked(
    subject: Subject,
    faults: Imperfections,
    *,
    duration: float = 10.0,
    share: float = _LOCKED,
    seed: int = 0,
    progress: Progress | None = None,
) -> Record:
    """Return the measurement of an experiment with locked links and excited joints.

    All joints are excited together by sines of 4 to 90 Hz; each is a motor with friction and a
    visco-elastic joint to a link at rest.

    Args:
        subject: A robot with elastic joints and known friction.
        faults: Noise of the torques, encoders and noise of the positions.
        duration: Duration [s].
        share: Share of the drives' largest torques, RMS of the sines.
        seed: Seed of all random numbers.
        progress: Receives the completed fraction and the current step.

    Raises:
        InputError: If joints are rigid, friction is unknown, an option is out of range, or a drive
            would exceed its limit.
    """
    chain, coulomb, viscous = _elastic(subject, faults)
    n, random = subject.dimension, np.random.default_rng(seed)
    builder = DiagramBuilder()
    inverse = np.diag(1.0 / chain.D_M)
    zero, one = np.zeros((n, n)), np.eye(n)
    A = np.block([[zero, one], [-inverse * chain.K_s, -inverse * chain.K_d]])
    B = np.block([[zero, zero], [inverse, inverse]])
    inputs = LinearSystem(A, B, np.eye(2 * n), np.zeros((2 * n, 2 * n)), 0.0)
    plant = builder.AddNamedSystem("motors", inputs)
    state = plant.get_output_port()
    size = share * subject.effort_limit
    drive = _add_multisine(builder, size, duration, random)
    resistance = add_friction(builder, (coulomb, viscous), chain.D_M, _STEP, state)
    both = builder.AddNamedSystem("torques", Multiplexer([n, n]))
    builder.Connect(drive, both.get_input_port(0))
    builder.Connect(resistance, both.get_input_port(1))
    builder.Connect(both.get_output_port(), plant.get_input_port())
    log = add_log(builder, {"state": state, "torque": drive}, 1.0 / RATE)
    signals = _simulate(builder.Build(), log, lambda _: None, duration, progress)
    check_effort(subject, signals["torque"])
    q_M = signals["state"][:, :n]
    return _measure(subject, faults, (np.zeros_like(q_M), q_M, signals["torque"]), random)


def simulate_excited(
    subject: Subject,
    trajectory: FourierTrajectory,
    faults: Imperfections,
    *,
    periods: int = 2,
    seed: int = 0,
    progress: Progress | None = None,
) -> Record:
    """Return the measurement of an experiment with an excitation and additional sines.

    The servo acts on the motors, without delay; sines of 4 to 90 Hz add to its torques. The plant
    is the full model (2.64), with the coupling of rotors if their mounts are known.

    Args:
        subject: A robot with elastic joints and known friction.
        trajectory: Excitation, within the limits of the robot.
        faults: Noise of the torques, encoders and noise of the positions.
        periods: Number of periods of the excitation.
        seed: Seed of all random numbers.
        progress: Receives the completed fraction and the current step.

    Raises:
        InputError: If joints are rigid, friction is unknown, the excitation belongs to another
            robot or exceeds its limits, or a drive would exceed its limit.
    """
    chain, coulomb, viscous = _elastic(subject, faults)
    servo, n, random = Servo(), subject.dimension, np.random.default_rng(seed)
    run = run_of(subject, trajectory, periods, RATE)
    t, q, v, a = run.sample(RATE)
    rigid = rigid_torques(subject, q, v, a)
    check_effort(subject, rigid + friction_torques(v, coulomb, viscous))
    mounts = subject.mounts or [RotorMount(0, np.eye(3)[2], np.inf)] * n
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", FullElasticPlant(chain, mounts))
    joint_state = plant.GetOutputPort("joint_state")
    motor = builder.AddNamedSystem("motor_state", MatrixGain(np.eye(4 * n)[2 * n :]))
    builder.Connect(joint_state, motor.get_input_port())
    K_p, K_d = servo.gains(drive_inertia(subject, q))
    control = builder.AddNamedSystem("servo", PidController(K_p, np.zeros(n), K_d))
    builder.Connect(motor.get_output_port(), control.get_input_port_estimated_state())
    reference = add_curves(builder, "reference", t, np.hstack([q, v]))
    builder.Connect(reference, control.get_input_port_desired_state())
    known = add_feed_forward(builder, servo, t, v, rigid, (coulomb, viscous))
    shaking = _add_multisine(builder, _MOVING * subject.effort_limit, trajectory.period, random)
    drive = add_sum(builder, "servo_torque", control.get_output_port_control(), known)
    drive = add_sum(builder, "drive_torque", drive, shaking)
    builder.Connect(drive, plant.GetInputPort("drive_torque"))
    resistance = add_friction(
        builder, (coulomb, viscous), chain.D_M, _STEP, motor.get_output_port()
    )
    builder.Connect(resistance, plant.GetInputPort("resistance"))
    log = add_log(builder, {"state": joint_state, "torque": drive}, 1.0 / RATE)
    # motors at rest on the excitation, links in static equilibrium
    start = np.concatenate([q[0] - rigid[0] / chain.K_s, np.zeros(n), q[0], np.zeros(n)])

    def set_state(root: Context) -> None:
        plant.set_joint_state(plant.GetMyMutableContextFromRoot(root), start)

    signals = _simulate(builder.Build(), log, set_state, run.duration - run.ramp, progress)
    first = round(run.ramp * RATE)
    window = slice(first, first + round(periods * trajectory.period * RATE))
    q_J, _, q_M, _ = np.split(signals["state"][window], 4, axis=1)
    check_effort(subject, signals["torque"])
    record = _measure(subject, faults, (q_J, q_M, signals["torque"][window]), random)
    return replace(record, period=trajectory.period)


def _elastic(subject: Subject, faults: Imperfections) -> tuple[SerialChain, np.ndarray, np.ndarray]:
    """Return the chain and the friction of a suitable robot."""
    chain = subject.chain
    if chain is None or not chain.is_elastic or not np.all(chain.D_M > 0.0):
        raise InputError(
            f"{subject.name}: joints that are not elastic; a robot all of whose joints have finite "
            "stiffness and rotors is required"
        )
    if subject.coulomb is None or subject.viscous is None:
        raise InputError(f"{subject.name}: friction is not known; must be")
    if not np.all(np.isfinite(subject.effort_limit)):
        raise InputError(f"{subject.name}: effort limits of the drives are not known; must be")
    faults.check_size(subject.dimension)
    return chain, subject.coulomb, subject.viscous


def _add_multisine(
    builder: DiagramBuilder, rms: np.ndarray, period: float, random: np.random.Generator
) -> OutputPort:
    amplitude, frequency, phase = zippered_multisine(rms, period, random)
    return add_sines(builder, "shaking", amplitude, 2.0 * np.pi * frequency, phase)


def _simulate(
    diagram: Diagram,
    log: SignalLog,
    set_state: SetState,
    duration: float,
    progress: Progress | None,
) -> dict[str, np.ndarray]:
    """Return the logged signals."""
    ends = np.append(np.arange(_CHUNK, duration, _CHUNK), duration).tolist()
    tell = progress or (lambda fraction, phase: None)
    return simulate_diagram(
        diagram,
        log,
        set_state,
        _STEP,
        ends,
        lambda fraction: tell(fraction, "simulating the elastic joints"),
    )[1]


def _measure(
    subject: Subject,
    faults: Imperfections,
    true: tuple[np.ndarray, np.ndarray, np.ndarray],
    random: np.random.Generator,
) -> Record:
    """Return the record of simulated link positions, motor positions and torques."""
    turn = np.array([2.0 * np.pi if unit == "rad" else 1.0 for unit in subject.joint_units])
    with np.errstate(divide="ignore"):
        resolution = np.where(
            faults.encoder_increments > 0.0, turn / faults.encoder_increments, 0.0
        )
    coarse = resolution > 0.0
    positions = []
    for q in true[:2]:
        measured = q + faults.position_noise * random.normal(size=q.shape)
        measured[:, coarse] = resolution[coarse] * np.round(
            measured[:, coarse] / resolution[coarse]
        )
        positions.append(measured)
    tau = true[2] + faults.torque_noise * random.normal(size=true[2].shape)
    return Record(
        np.arange(len(tau)) / RATE,
        positions[0],
        tau,
        tuple(subject.joint_names),
        q_motor=positions[1],
        source=f"simulated {subject.name}",
    )
