"""Station of the simulated experiment: a robot, its drives and its encoders, in Drake."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    MatrixGain,
    Saturation,
    ZeroOrderHold,
)

from diagrams.robots.plant_wiring import joint_state_of
from diagrams.signal_log import SignalLog, add_log
from identification.excitation.run_in import ExcitationRun
from identification.measurement.imperfections import Imperfections
from identification.measurement.servo import (
    Servo,
    add_curves,
    add_samples,
    add_signs,
    add_sum,
    drive_inertia,
)
from identification.model.subject import Subject
from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import FrictionDrift, bristles_for_step
from pfsc_drake.physics.joint_sensors import EncoderOptions, JointEncoders
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.joint_friction import JointFriction
from pfsc_drake.systems.plants.coupled_plants import RigidPlant
from pfsc_drake.systems.plants.delta_plant import DeltaPlant

_SCHEME = "runge_kutta3"

# sets the initial state in the context of the diagram
SetState = Callable[[Context], None]


def simulate_diagram(
    diagram: Diagram,
    log: SignalLog,
    set_state: SetState,
    step: float,
    ends: Sequence[float],
    progress: Callable[[float], None],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Simulate a diagram with a fixed step, and return times and logged signals.

    Args:
        diagram: Diagram with the log.
        log: Log of the diagram.
        set_state: Sets the initial state.
        step: Step of the integration [s].
        ends: Times of the progress reports, the last one the end [s].
        progress: Receives the completed fraction.

    Raises:
        InputError: If the motion cannot be simulated.
    """
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme=_SCHEME, max_step_size=step, use_error_control=False
    )
    ApplySimulatorConfig(config, simulator)
    root = simulator.get_mutable_context()
    set_state(root)
    simulator.Initialize()
    for end in ends:
        try:
            simulator.AdvanceTo(end)
        except RuntimeError as error:
            raise InputError(
                f"excitation: cannot be simulated: {' '.join(str(error).split())}; the robot must "
                "be able to follow it"
            ) from None
        progress(end / ends[-1])
    return log.read(root)


def build_station(
    subject: Subject,
    run: ExcitationRun,
    faults: Imperfections,
    servo: Servo,
    friction: tuple[np.ndarray, np.ndarray],
    rigid: np.ndarray,
    random: np.random.Generator,
) -> tuple[Diagram, SignalLog, SetState]:
    """Return the station of one run, its log, and a function that sets its initial state.

    At the ticks the log has ``state`` ``[q, v]``, ``q`` as measured by the encoders, ``feedback``
    until the next tick, and ``feed_forward`` at the tick [Nm or N].

    Args:
        subject: The robot; the servo uses its usual friction for the feed-forward.
        run: The run.
        faults: Encoders, disturbance and drift of the friction.
        servo: The controller.
        friction: ``f_c`` and ``f_v`` of this run, each (N,).
        rigid: Torques of the robot without friction at the ticks [Nm or N], shape (K, N).
        random: Generator of the disturbance.
    """
    builder, n = DiagramBuilder(), subject.dimension
    t, q, v, _ = run.sample(1.0 / servo.period)
    inertia = drive_inertia(subject, q)
    plant = builder.AddNamedSystem("plant", _plant(subject))
    state = plant.GetOutputPort("state")
    measured = _add_encoders(builder, subject, faults, servo, state)
    reference = add_samples(builder, "reference", t, np.hstack([q, v]))
    K_p, K_d = servo.gains(inertia)
    control = builder.AddNamedSystem("servo", PidController(K_p, np.zeros(n), K_d))
    builder.Connect(measured, control.get_input_port_estimated_state())
    builder.Connect(reference, control.get_input_port_desired_state())
    feedback = control.get_output_port_control()
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(servo.period, n))
    builder.Connect(feedback, hold.get_input_port())
    assert subject.coulomb is not None and subject.viscous is not None  # for the servo
    usual = subject.coulomb, subject.viscous
    known = add_feed_forward(builder, servo, t, v, rigid, usual)
    torque_sum = add_sum(builder, "drive_torque", hold.get_output_port(), known)
    limits = builder.AddNamedSystem(
        "drive_limits", Saturation(-subject.effort_limit, subject.effort_limit)
    )
    builder.Connect(torque_sum, limits.get_input_port())
    builder.Connect(limits.get_output_port(), plant.GetInputPort("actuation"))
    resistance = add_friction(builder, friction, inertia, servo.period, state, faults.drift)
    if faults.disturbance > 0.0:
        torque = faults.coloured_torque(len(t), servo.period, random)
        ripple = add_samples(builder, "disturbance", t, torque)
        resistance = add_sum(builder, "all_resistances", resistance, ripple)
    builder.Connect(resistance, plant.GetInputPort("resistance"))
    position = builder.AddNamedSystem("measured_position", MatrixGain(np.eye(n, 2 * n)))
    builder.Connect(measured, position.get_input_port())
    signals = {
        "state": state,
        "q": position.get_output_port(),
        "feedback": feedback,
        "feed_forward": known,
    }
    log = add_log(builder, signals, servo.period)
    diagram = builder.Build()
    diagram.set_name("identification_experiment")

    def set_state(root: Context) -> None:
        plant.set_state(plant.GetMyMutableContextFromRoot(root), q[0])

    return diagram, log, set_state


def add_feed_forward(
    builder: DiagramBuilder,
    servo: Servo,
    t: np.ndarray,
    v: np.ndarray,
    rigid: np.ndarray,
    friction: tuple[np.ndarray, np.ndarray],
) -> OutputPort:
    """Return the feed-forward torque of a servo, shape (N,).

    Args:
        builder: Builder of the diagram.
        servo: The controller.
        t: Ticks [s], shape (K,).
        v: Reference velocities, shape (K, N).
        rigid: Torques of the robot without friction [Nm or N], shape (K, N).
        friction: Nominal ``f_c`` and ``f_v`` of the servo, each (N,).
    """
    coulomb, viscous = friction
    smooth = servo.feedforward * rigid + servo.friction * viscous * v
    return add_sum(
        builder,
        "feed_forward",
        add_curves(builder, "smooth_feed_forward", t, smooth),
        add_signs(builder, "dry_feed_forward", t, v, servo.friction * coulomb),
    )


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
    """Return positions and velocities measured by the servo, shape (2N,)."""
    n = subject.dimension
    size = 2 * n
    names = tuple(subject.robot.names)
    same = PlantCoordinates(size, np.eye(size), np.eye(size), names, tuple(range(n)))
    increments = faults.encoder_increments.tolist()
    options = EncoderOptions(increments, increments, difference_quotient=True)
    block = JointEncoders(subject.robot, options, servo.period)
    encoders = builder.AddNamedSystem("encoders", BlockSystem(block, servo.period))
    builder.Connect(joint_state_of(builder, state, same), encoders.GetInputPort("joint_state"))
    half = builder.AddNamedSystem("measured_state", MatrixGain(np.eye(size, 2 * size)))
    builder.Connect(encoders.GetOutputPort("joint_state"), half.get_input_port())
    return half.get_output_port()


def add_friction(
    builder: DiagramBuilder,
    friction: tuple[np.ndarray, np.ndarray],
    inertia: np.ndarray,
    step: float,
    state: OutputPort,
    drift: FrictionDrift | None = None,
) -> OutputPort:
    """Return the resistance of friction, shape (N,).

    Args:
        builder: Builder of the diagram.
        friction: ``f_c`` and ``f_v``, each (N,).
        inertia: Inertia that friction acts on [kg m^2 or kg], shape (N,).
        step: Step of the integration [s].
        state: ``[q, v]`` of that inertia, shape (2N,).
        drift: Change of friction, if any.
    """
    n = inertia.size
    stiffest = friction[0] * (1.0 if drift is None else max(1.0, drift.factor))
    bristles = bristles_for_step(stiffest, friction[1], inertia, step)
    system = builder.AddNamedSystem(
        "friction", JointFriction(replace(bristles, coulomb=friction[0]), drift)
    )
    velocity = builder.AddNamedSystem("velocity", MatrixGain(np.eye(2 * n)[n:]))
    builder.Connect(state, velocity.get_input_port())
    builder.Connect(velocity.get_output_port(), system.GetInputPort("velocity"))
    return system.GetOutputPort("resistance")
