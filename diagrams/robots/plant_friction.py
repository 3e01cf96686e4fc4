"""Friction and holding brakes of the plant's joints."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder

from diagrams.robots.part import Drives, RobotPart
from diagrams.scenario import BrakeParameters, JointFrictionParameters, SimulationParameters
from diagrams.scenario.simulation import AUTO
from pfsc_drake.checks import require
from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import BristleFriction, bristles_for_step
from pfsc_drake.physics.holding_brakes import HoldingBrakes
from pfsc_drake.robot.inverse_kinematics import middle_posture
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.robot_model import RobotModel, mass_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.brake_torque import BrakeTorque
from pfsc_drake.systems.physics.joint_friction import JointFriction
from pfsc_drake.yaml.fields import spread

# integration schemes of fixed step that the bristles of friction are designed for
FRICTION_INTEGRATORS = ("runge_kutta3", "runge_kutta5")
# omega h of stuck bristles whose force is read once per step, see bristles_for_step
_BRISTLES_PER_STEP = 0.5
# s; shorter steps of a continuous plant change nothing about the bristles
_SHORTEST_STEP = 1e-3
# share of that frequency of brakes, whose dampers act beside those of friction
_OF_BRAKES = 0.3
# share of the links' inertia in the middle posture, for brakes of drives without a rotor
_OF_LINKS = 0.25


@dataclass(frozen=True)
class FrictionOptions:
    """Friction and holding brakes of a plant's drives, with the integration of the plant.

    Attributes:
        friction: Coefficients of the joints, if there are any.
        own: Whether the drives have the friction of the robot's own parameters; None for true if
            ``friction`` has no coefficients.
        brakes: Holding brakes, if there are any.
        simulation: Integration of the plant.
        period: Sampling time of the controller [s].
        folder: Base folder of relative file names.
    """

    friction: JointFrictionParameters
    own: bool | None
    brakes: BrakeParameters | None
    simulation: SimulationParameters
    period: float
    folder: FilePath


def add_friction(
    builder: DiagramBuilder,
    part: RobotPart,
    joint_state: OutputPort,
    options: FrictionOptions,
    stops: Sequence[OutputPort] = (),
) -> dict[str, OutputPort]:
    """Add friction and brakes, and return the friction's signal for the log.

    Args:
        builder: Builder of the diagram.
        part: The robot.
        joint_state: Its actual ``[q_J, v_J, q_M, v_M]``.
        options: Options of friction and brakes.
        stops: Stop categories that are requested, each (1,); without any there are no brakes.

    Returns:
        ``friction_torque``, positive against positive velocities [Nm or N], shape (N,).

    Raises:
        InputError: If the friction does not suit the robot or the integration.
    """
    drives, n = part.drives, part.robot.dimension
    coefficients = _coefficients(options, part)
    motors = np.eye(4 * n)[3 * n :]
    resistances, signals = [], {}
    if coefficients is not None:
        if not np.all(drives.inertia > 0.0):
            names = zip(part.robot.names, drives.inertia, strict=True)
            without = ", ".join(name for name, inertia in names if not inertia > 0.0)
            raise InputError(
                f"friction: needs a robot with rotor inertia in every drive, not so {without}: "
                "write robot.elastic.rotor_inertia (kg m^2) and robot.elastic.gear_ratio"
            )
        bristles = _bristles(options, *coefficients, drives)
        friction = builder.AddNamedSystem(
            "joint_friction", JointFriction(bristles, options.friction.drift, motors)
        )
        builder.Connect(joint_state, friction.GetInputPort("velocity"))
        resistances.append(friction.GetOutputPort("resistance"))
        signals["friction_torque"] = friction.GetOutputPort("friction_torque")
    if stops and (brakes := _add_brakes(builder, part, joint_state, options, stops)):
        resistances.append(brakes)
    if resistances:
        part.connect_resistance(builder, _sum(builder, resistances))
    return signals


def _add_brakes(
    builder: DiagramBuilder,
    part: RobotPart,
    joint_state: OutputPort,
    options: FrictionOptions,
    stops: Sequence[OutputPort],
) -> OutputPort | None:
    """Add brakes, and return their resistance; None where there are none."""
    limit = _brake_torque(part.robot, options.brakes)
    if options.brakes is None or limit is None:
        return None
    holding = replace(part.drives, inertia=_behind_brakes(part))
    step = _step(options, part.drives)
    bristles = _bristles_of_step(step, limit, np.zeros(limit.size), holding, _OF_BRAKES)
    block = HoldingBrakes(bristles.presliding, len(stops), options.brakes.delay, options.period)
    brakes = builder.AddNamedSystem("holding_brakes", BlockSystem(block, options.period))
    torque = builder.AddNamedSystem("brake_torque", BrakeTorque(bristles))
    for k, port in enumerate(stops):
        builder.Connect(port, brakes.GetInputPort(f"request_{k}"))
    for system in (brakes, torque):
        builder.Connect(joint_state, system.GetInputPort("joint_state"))
    for name in block.outputs:
        builder.Connect(brakes.GetOutputPort(name), torque.GetInputPort(name))
    return torque.GetOutputPort("resistance")


def _sum(builder: DiagramBuilder, ports: list[OutputPort]) -> OutputPort:
    """Return the sum of one or more ports."""
    if len(ports) == 1:
        return ports[0]
    adder = builder.AddNamedSystem("all_resistances", Adder(len(ports), ports[0].size()))
    for i, port in enumerate(ports):
        builder.Connect(port, adder.get_input_port(i))
    return adder.get_output_port()


def _brake_torque(robot: RobotModel, brakes: BrakeParameters | None) -> np.ndarray | None:
    """Return the holding torques of the brakes, shape (N,) [Nm or N]; None without brakes.

    By default drives with unknown limits have no brakes.

    Raises:
        InputError: If the torques fit another number of joints.
    """
    if brakes is None:
        return None
    n, values = robot.dimension, np.array(brakes.torque, dtype=float)
    if values.size not in (0, 1, n):
        raise InputError(
            f"faults.brakes.torque = {values.tolist()}; allowed: {n} values, one per joint, or one"
        )
    torque = np.array(np.broadcast_to(values, n)) if values.size else robot.gather("effort_limit")
    return torque if np.isfinite(torque).all() else None


def _behind_brakes(part: RobotPart) -> np.ndarray:
    """Return the least inertia that each brake holds, shape (N,) [kg m^2 or kg].

    A drive without inertia of its own gets a quarter of the links' inertia in the middle of the
    joints' ranges.
    """
    own = part.drives.inertia
    if np.all(own > 0.0):
        return own
    M = np.array(mass_function(part.robot)(middle_posture(part.robot)))
    return np.where(own > 0.0, own, _OF_LINKS / np.diag(np.linalg.inv(M + np.diag(own))))


def nominal_friction(
    part: RobotPart, nominal: JointFrictionParameters, options: FrictionOptions
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the coefficients f_c and f_v of the controller's friction model, each (N,), if any.

    Args:
        part: The robot.
        nominal: ``controller.friction.nominal``; if it is empty, the plant's coefficients with the
            error of the nominal model.
        options: Friction of the plant.

    Raises:
        InputError: If they do not suit the robot.
    """
    if nominal.is_given:
        key = "controller.friction.nominal"
        return _read_coefficients(nominal, part.robot, options.folder, key)
    actual = _coefficients(options, part)
    if actual is None:
        return None
    factors = part.nominal_model.friction
    return factors[0] * actual[0], factors[1] * actual[1]


def _bristles(
    options: FrictionOptions, f_c: np.ndarray, f_v: np.ndarray, drives: Drives
) -> BristleFriction:
    """Return friction with bristles that suit the plant's integration, during a drift too."""
    simulation = options.simulation
    allowed = (AUTO, *FRICTION_INTEGRATORS)
    if drives.step is None and simulation.accuracy == 0.0 and simulation.integrator not in allowed:
        raise InputError(
            f"simulation.integrator = {simulation.integrator} with friction; allowed: "
            f"{', '.join(allowed)}, or error control"
        )
    drift, displacements = options.friction.drift, options.friction.presliding
    stiffest = f_c * (1.0 if drift is None else max(1.0, drift.factor))
    if displacements:
        presliding = _per_joint("friction.presliding", displacements, f_c.size)
        return _of_presliding(options, f_c, f_v, drives, presliding, stiffest)
    step = drives.step or max(_step(options, drives), _SHORTEST_STEP)
    return replace(_bristles_of_step(step, stiffest, f_v, drives, 1.0), coulomb=f_c)


def _of_presliding(
    options: FrictionOptions,
    f_c: np.ndarray,
    f_v: np.ndarray,
    drives: Drives,
    presliding: np.ndarray,
    stiffest: np.ndarray,
) -> BristleFriction:
    """Return friction of certain presliding displacements, critically damped while stuck.

    Args:
        options: Options of the friction.
        f_c: Coulomb friction, shape (N,) [Nm or N].
        f_v: Viscous friction, shape (N,).
        drives: The drives.
        presliding: Displacements, shape (N,) [rad or m].
        stiffest: Largest Coulomb friction of a drift, shape (N,) [Nm or N].

    Raises:
        InputError: If fixed steps are too long for it.
    """
    step = _step(options, drives)
    least = _bristles_of_step(step, stiffest, f_v, drives, 1.0).presliding
    ratio = presliding / least
    i = int(np.argmin(ratio))
    if ratio[i] < 1.0 - 1e-9 and (options.simulation.accuracy == 0.0 or drives.step is not None):
        raise InputError(
            f"friction.presliding = {presliding[i]:.3g} of joint {i + 1}: steps of {step:g} s "
            f"integrate {least[i]:.2e} and more; write simulation.max_step = "
            f"{0.99 * step * np.sqrt(ratio[i]):.1e}, or simulation.accuracy"
        )
    sliding = f_c > 0.0
    frequency = np.sqrt(np.where(sliding, f_c, 1.0) / (presliding * drives.inertia))
    relaxation = np.where(sliding, 2.0 / frequency, 2.0 * step)
    return BristleFriction(f_c, f_v, presliding, relaxation)


def _bristles_of_step(
    step: float, f_c: np.ndarray, f_v: np.ndarray, drives: Drives, share: float
) -> BristleFriction:
    """Return friction with bristles of a share of the frequency that a step allows."""
    # a plant with steps of its own reads the force once per step
    share = share if drives.step is None else share * _BRISTLES_PER_STEP
    return bristles_for_step(f_c, f_v, drives.inertia, step, frequency=share)


def _step(options: FrictionOptions, drives: Drives) -> float:
    """Return the step that integrates friction [s], at most the sampling time of the hold."""
    return drives.step or min(options.simulation.max_step, options.period)


def _coefficients(
    options: FrictionOptions, part: RobotPart
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the friction of the options, or else of the robot's parameters, or else None."""
    own, has_own = part.drives.own_friction, options.own
    allowed = "null; the parameters of this robot have no friction: write the block 'friction'"
    require(own is not None or has_own is None, "drive_friction", has_own, allowed)
    if options.friction.is_given:
        return _read_coefficients(options.friction, part.robot, options.folder, "friction")
    return None if has_own is False else own


def _read_coefficients(
    parameters: JointFrictionParameters, chain: RobotModel, folder: FilePath, block: str
) -> tuple[np.ndarray, np.ndarray]:
    n = chain.dimension
    if file := parameters.file:
        known = load_parameters(folder / file if FilePath(file).suffix else file).friction
        count = known.coulomb.size
        if count < n:
            raise InputError(f"{block}.file: {file}: friction of {count} joints; the robot has {n}")
        return known.coulomb[:n], known.viscous[:n]
    values = []
    for key in ("f_c", "f_v"):
        values.append(_per_joint(f"{block}.{key}", getattr(parameters, key) or [0.0] * n, n))
    return values[0], values[1]


def _per_joint(key: str, numbers: list[float], n: int) -> np.ndarray:
    """Return one number for each joint, shape (N,)."""
    values = spread(numbers, n)
    if len(values) != n:
        raise InputError(f"{key} = {list(values)}; allowed: {n} values, one per joint")
    return np.array(values, dtype=float)
