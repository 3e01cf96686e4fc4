"""The station of the simulated experiment: a robot, its drives and its encoders, in Drake."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
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
from pfsc_drake.physics.friction import bristles_for_step
from pfsc_drake.physics.joint_sensors import EncoderOptions, JointEncoders
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.joint_friction import JointFriction
from pfsc_drake.systems.plants.coupled_plants import RigidPlant
from pfsc_drake.systems.plants.delta_plant import DeltaPlant


@dataclass(frozen=True)
class MeasuredStation:
    """A robot that runs an excitation; N joints.

    Attributes:
        diagram: Plant, servo, friction, encoders and log.
        plant: What the servo moves, with the state ``[q, v]``.
        log: At the ticks: ``state`` ``[q, v]``, ``q`` as the encoders tell it, ``feedback`` that
            acts until the next tick, ``feed_forward`` at the tick [Nm or N].
        start: Positions at the start [rad or m], shape (N,).
    """

    diagram: Diagram
    plant: RigidPlant | DeltaPlant
    log: SignalLog
    start: np.ndarray


def build_station(
    subject: Subject,
    run: ExcitationRun,
    faults: Imperfections,
    servo: Servo,
    friction: tuple[np.ndarray, np.ndarray],
    rigid: np.ndarray,
    usual: tuple[np.ndarray, np.ndarray],
    random: np.random.Generator,
) -> MeasuredStation:
    """Return the station of one run.

    Args:
        subject: The robot.
        run: What it is to do.
        faults: Encoders, disturbance and drift of the friction.
        servo: The controller.
        friction: ``f_c`` and ``f_v`` of this run, each (N,).
        rigid: Torques of the robot without friction at the ticks [Nm or N], shape (K, N).
        usual: ``f_c`` and ``f_v`` as the servo believes them, each (N,).
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
    known = add_feed_forward(builder, servo, t, v, rigid, usual)
    wanted = add_sum(builder, "drive_torque", hold.get_output_port(), known)
    limits = builder.AddNamedSystem(
        "drive_limits", Saturation(-subject.effort_limit, subject.effort_limit)
    )
    builder.Connect(wanted, limits.get_input_port())
    builder.Connect(limits.get_output_port(), plant.GetInputPort("actuation"))
    resistance = _add_friction(builder, faults, friction, inertia, servo, state)
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
    return MeasuredStation(diagram, plant, log, q[0])


def add_feed_forward(
    builder: DiagramBuilder,
    servo: Servo,
    t: np.ndarray,
    v: np.ndarray,
    rigid: np.ndarray,
    friction: tuple[np.ndarray, np.ndarray],
) -> OutputPort:
    """Return what a servo feeds forward, shape (N,).

    Args:
        builder: Builder of the diagram.
        servo: The controller.
        t: Ticks [s], shape (K,).
        v: Reference velocities, shape (K, N).
        rigid: Torques of the robot without friction [Nm or N], shape (K, N).
        friction: ``f_c`` and ``f_v`` as the servo believes them, each (N,).
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
    """Return positions and velocities as the servo measures them, shape (2N,)."""
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
