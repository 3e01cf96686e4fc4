"""The experiment of App. C on a simulated robot, as a Drake diagram."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    Adder,
    Demultiplexer,
    MatrixGain,
    Saturation,
    TrajectorySource,
    ZeroOrderHold,
)
from pydrake.trajectories import PiecewisePolynomial

from diagrams.robots.plant_wiring import joint_state_of
from diagrams.signal_log import SignalLog, add_log
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.run_in import ExcitationRun, rest_to_rest
from identification.measurement.imperfections import Imperfections, shipped_imperfections
from identification.measurement.record import Record
from identification.measurement.servo import Servo, drive_inertia
from identification.model.subject import Subject
from pfsc_drake.compiled.bound_function import compiled_when_bound
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.physics.friction import bristles_for_step
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.systems.physics.joint_encoders import EncoderOptions, JointEncoders
from pfsc_drake.systems.physics.joint_friction import JointFriction
from pfsc_drake.systems.plants.delta_plant import DeltaPlant
from pfsc_drake.systems.plants.rigid_plant import RigidPlant

PERIODS = 5  # Sec. C.2
_CHUNK = 0.25  # s, after which progress is told
_SCHEME = "runge_kutta3"


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


def simulate_experiment(
    subject: Subject,
    trajectory: FourierTrajectory,
    imperfections: Imperfections | None = None,
    *,
    periods: int = PERIODS,
    servo: Servo | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Record:
    """Return what would be measured of a robot, see :func:`run_experiment`."""
    run = run_experiment(
        subject,
        trajectory,
        imperfections,
        periods=periods,
        servo=servo,
        seed=seed,
        progress=progress,
    )
    return run.record


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
    on the excitation, gathers speed along it, and runs the periods. A torque sample is the mean
    over one sampling time about its instant, plus noise.

    Args:
        subject: The robot; its friction has to be known.
        trajectory: The excitation, within the limits of the robot.
        imperfections: Of this run; by default the shipped noise and encoders of the robot.
        periods: How often the excitation is run.
        servo: The controller.
        seed: Of all random numbers; one run for each.
        progress: Told the fraction done and what is done.

    Raises:
        InputError: If friction or noise are not known, the trajectory is of another robot or
            beyond its limits, its period is no multiple of the sampling time, or the motion
            cannot be simulated.
    """
    servo, random = servo or Servo(), np.random.default_rng(seed)
    faults = shipped_imperfections(subject.name) if imperfections is None else imperfections
    faults.check_size(subject.dimension)
    usual = _usual_friction(subject)
    coulomb, viscous = faults.friction(*usual, random)
    run = _checked_run(subject, trajectory, periods, servo)
    with compiled_when_bound():
        tau_ff = servo.known_torque(subject, run.sample(1.0 / servo.period)[1:], usual)
        station = _build(subject, run, faults, servo, (coulomb, viscous), tau_ff, random)
    t, signals = _simulate(station, run, servo, progress)
    # what acts up to a tick and what acts from it on
    tau = signals["torque"].copy()
    tau[1:] = 0.5 * (tau[1:] + tau[:-1])
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


def _checked_run(
    subject: Subject, trajectory: FourierTrajectory, periods: int, servo: Servo
) -> ExcitationRun:
    n = subject.dimension
    if trajectory.dimension != n:
        raise InputError(
            f"excitation: of {trajectory.dimension} joints; {subject.name} has {n} joints"
        )
    q = trajectory.motion(trajectory.sample_times(1.0 / servo.period))[0]
    lower, upper = subject.position_limits.T
    beyond = np.maximum(q.max(axis=0) - upper, lower - q.min(axis=0))
    j = int(np.argmax(beyond))
    if beyond[j] > 0.0:
        unit = subject.joint_units[j]
        raise InputError(
            f"excitation: {subject.joint_names[j]} goes from {q[:, j].min():.4g} to "
            f"{q[:, j].max():.4g} {unit}; must stay within {lower[j]:.4g} to {upper[j]:.4g} {unit}"
        )
    return rest_to_rest(
        trajectory,
        subject.velocity_limit,
        subject.acceleration_limit,
        periods=periods,
        rate=1.0 / servo.period,
    )


@dataclass(frozen=True)
class _Station:
    """The diagram, its plant, its log and where the plant starts."""

    diagram: Diagram
    plant: RigidPlant | DeltaPlant
    log: SignalLog
    start: np.ndarray


def _build(
    subject: Subject,
    run: ExcitationRun,
    faults: Imperfections,
    servo: Servo,
    friction: tuple[np.ndarray, np.ndarray],
    tau_ff: np.ndarray,
    random: np.random.Generator,
) -> _Station:
    builder, n = DiagramBuilder(), subject.dimension
    t, q, v, _ = run.sample(1.0 / servo.period)
    inertia = drive_inertia(subject, q)
    plant = builder.AddNamedSystem("plant", _plant(subject))
    state = plant.GetOutputPort("state")
    measured = _add_encoders(builder, subject, faults, servo, state)
    reference = _add_samples(builder, "reference", t, np.hstack([q, v, tau_ff]))
    parts = builder.AddNamedSystem("reference_parts", Demultiplexer([2 * n, n]))
    builder.Connect(reference, parts.get_input_port())
    K_p, K_d = servo.gains(inertia)
    control = builder.AddNamedSystem("servo", PidController(K_p, np.zeros(n), K_d))
    builder.Connect(measured, control.get_input_port_estimated_state())
    builder.Connect(parts.get_output_port(0), control.get_input_port_desired_state())
    wanted = _add_sum(
        builder, "drive_torque", control.get_output_port_control(), parts.get_output_port(1)
    )
    limits = builder.AddNamedSystem(
        "drive_limits", Saturation(-subject.effort_limit, subject.effort_limit)
    )
    builder.Connect(wanted, limits.get_input_port())
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(servo.period, n))
    builder.Connect(limits.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.GetInputPort("actuation"))
    resistance = _add_friction(builder, faults, friction, inertia, servo, state)
    if faults.disturbance > 0.0:
        torque = faults.coloured_torque(len(t), servo.period, random)
        ripple = _add_samples(builder, "disturbance", t, torque)
        resistance = _add_sum(builder, "all_resistances", resistance, ripple)
    builder.Connect(resistance, plant.GetInputPort("resistance"))
    position = builder.AddNamedSystem("measured_position", MatrixGain(np.eye(n, 2 * n)))
    builder.Connect(measured, position.get_input_port())
    signals = {
        "state": state,
        "q": position.get_output_port(),
        "torque": limits.get_output_port(),
    }
    log = add_log(builder, signals, servo.period)
    diagram = builder.Build()
    diagram.set_name("identification_experiment")
    return _Station(diagram, plant, log, q[0])


def _plant(subject: Subject) -> RigidPlant | DeltaPlant:
    if subject.chain is None:
        assert subject.delta is not None
        return DeltaPlant(subject.delta)
    return RigidPlant(subject.chain, subject.mounts)


def _add_encoders(
    builder: DiagramBuilder,
    subject: Subject,
    faults: Imperfections,
    servo: Servo,
    state: OutputPort,
) -> OutputPort:
    """Return positions and velocities as the servo measures them, shape (2N,)."""
    n = subject.dimension
    size = 2 * n
    same = PlantCoordinates(size, np.eye(size), np.eye(size), np.arange(n))
    increments = faults.encoder_increments.tolist()
    options = EncoderOptions(increments, increments, difference_quotient=True)
    encoders = builder.AddNamedSystem(
        "encoders", JointEncoders(subject.robot, options, servo.period)
    )
    builder.Connect(joint_state_of(builder, state, same), encoders.GetInputPort("joint_state"))
    half = builder.AddNamedSystem("measured_state", MatrixGain(np.eye(size, 2 * size)))
    builder.Connect(encoders.GetOutputPort("joint_state"), half.get_input_port())
    return half.get_output_port()


def _add_friction(
    builder: DiagramBuilder,
    faults: Imperfections,
    friction: tuple[np.ndarray, np.ndarray],
    inertia: np.ndarray,
    servo: Servo,
    state: OutputPort,
) -> OutputPort:
    """Return the resistance of friction, shape (N,)."""
    n = inertia.size
    stiffest = friction[0] * (1.0 if faults.drift is None else max(1.0, faults.drift.factor))
    bristles = bristles_for_step(stiffest, friction[1], inertia, servo.period)
    system = builder.AddNamedSystem(
        "friction", JointFriction(replace(bristles, coulomb=friction[0]), faults.drift)
    )
    velocity = builder.AddNamedSystem("velocity", MatrixGain(np.eye(2 * n)[n:]))
    builder.Connect(state, velocity.get_input_port())
    builder.Connect(velocity.get_output_port(), system.GetInputPort("velocity"))
    return system.GetOutputPort("resistance")


def _add_samples(
    builder: DiagramBuilder, name: str, t: np.ndarray, values: np.ndarray
) -> OutputPort:
    """Return values that hold from their instants on."""
    # the last value of such a trajectory only ends it
    ends = np.append(t, 2.0 * t[-1] - t[-2])
    held = PiecewisePolynomial.ZeroOrderHold(ends, np.vstack([values, values[-1]]).T)
    return builder.AddNamedSystem(name, TrajectorySource(held)).get_output_port()


def _add_sum(
    builder: DiagramBuilder, name: str, first: OutputPort, second: OutputPort
) -> OutputPort:
    adder = builder.AddNamedSystem(name, Adder(2, first.size()))
    builder.Connect(first, adder.get_input_port(0))
    builder.Connect(second, adder.get_input_port(1))
    return adder.get_output_port()


def _simulate(
    station: _Station, run: ExcitationRun, servo: Servo, progress: Progress | None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times and logged signals."""
    simulator = Simulator(station.diagram)
    ApplySimulatorConfig(
        SimulatorConfig(
            integration_scheme=_SCHEME, max_step_size=servo.period, use_error_control=False
        ),
        simulator,
    )
    root = simulator.get_mutable_context()
    station.plant.set_state(station.plant.GetMyMutableContextFromRoot(root), station.start)
    simulator.Initialize()
    # the run-out serves a real robot
    ticks = round((run.duration - run.ramp) / servo.period)
    stride = max(1, round(_CHUNK / servo.period))
    for tick in [*range(stride, ticks, stride), ticks]:
        try:
            simulator.AdvanceTo(tick * servo.period)
        except RuntimeError as error:
            raise InputError(
                f"excitation: cannot be simulated: {' '.join(str(error).split())}; the robot must "
                "be able to follow it"
            ) from None
        if progress is not None:
            progress(tick / ticks, "simulating the experiment")
    return station.log.read(root)
