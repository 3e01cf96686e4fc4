"""What a load below the force sensor will do to the sensor, and to a compliance that answers."""

from dataclasses import dataclass

import numpy as np

from diagrams.scenario import (
    ComplianceParameters,
    ControllerParameters,
    EncoderOptions,
    SensorParameters,
    ServoParameters,
)
from pfsc_drake.control.compliance.measured_wrench import TARING_BLOCK
from pfsc_drake.control.compliance.tuned_impedance import (
    bearable_share,
    carried_share,
    load_inertia,
)
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.controller.law_warnings import least_of, slope_at_rest
from pfsc_drake.physics.joint_sensors import encoder_resolution
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad

# of the inertia below the sensor at which the loop becomes unstable, up to which it is robust
_ROBUST = 0.5
# of that share; a mass may be chosen that bears it exactly
_ROUNDING = 1e-6
# sampling intervals that a loop over the sensor loses: the hold and the filter of the impedance
_LOST_TICKS = 1.5


@dataclass(frozen=True)
class SensorLoop:
    """What a force sensor feels, and what answers to it.

    Attributes:
        sensor: The sensor.
        compliance: How the tool yields to what it measures.
        encoders: From which the tool's inertial load is computed.
        controller: The controller.
        servo: Velocity servos behind it, for a law that commands velocities.
    """

    sensor: SensorParameters
    compliance: ComplianceParameters
    encoders: EncoderOptions
    controller: ControllerParameters
    servo: ServoParameters


def sensed_load_warnings(
    loop: SensorLoop,
    robot: RobotModel,
    load: ToolLoad,
    law: FollowingLaw,
    rest: RestPosture,
) -> list[str]:
    """Return what a load below the sensor will do, one sentence each.

    Args:
        loop: The sensor, and what answers to it.
        robot: The robot, as it is believed.
        load: What is believed to hang below the sensor.
        law: The law behind the compliance.
        rest: The start, and the manifold's point there.
    """
    if not loop.compliance.needs_sensor:
        return []
    return [
        *_heavy_load(loop, robot, load, law, rest),
        *_noisy_inertia(loop, robot, load, rest),
    ]


def _heavy_load(
    loop: SensorLoop,
    robot: RobotModel,
    load: ToolLoad,
    law: FollowingLaw,
    rest: RestPosture,
) -> list[str]:
    """Warn of an inertia that is felt and not taken off, too much for the virtual masses."""
    sensor, coordinates = loop.sensor, law.linearization.manifold.coordinates
    impedance = loop.compliance.impedance()
    kinds = [impedance.of(coordinate.kind) for coordinate in coordinates]
    # without a stiffness of its own a coordinate yields, too
    yields = [bool(kind.stiffness.at) or np.isfinite(kind.stiffness.value) for kind in kinds]
    masses = np.where(yields, [least_of(kind.mass) for kind in kinds], np.inf)
    felt = load_inertia(robot, load, rest.q_J, sensor.unknown_mass)
    mass = load.mass + sensor.unknown_mass
    if sensor.inertia != "none":
        felt -= load_inertia(robot, load, rest.q_J)
        mass = sensor.unknown_mass
    share, worst = carried_share(felt, slope_at_rest(law, rest), masses)
    bearable = bearable_share(*_lag(loop))
    if share <= (_ROBUST + _ROUNDING) * bearable:
        return []
    unit = "kg m^2" if coordinates[worst].kind is Kind.ROTATIONAL else "kg"
    needed = masses[worst] * share / (_ROBUST * bearable)
    kind = coordinates[worst].kind.value
    block = {"eta": "tangential", "xi": "transversal", "phi": "rotational"}.get(kind, kind)
    cure = f"compliance.{block}.mass of {needed:.2g} {unit} or more"
    if sensor.inertia == "none" and load.mass > sensor.unknown_mass:
        cure = f"sensor.inertia: differentiated, which takes off the {load.mass:.3g} kg, or {cure}"
    verb = "chatters" if share > bearable else "may chatter where a little more hangs there"
    return [
        f"the sensor feels the inertia of {mass:.3g} kg below it, which is not taken off, and the "
        f"compliance answers: {share / bearable:.2g} times what the mass of {masses[worst]:g} "
        f"{unit} in {coordinates[worst].name} bears, and with more than {_ROBUST:g} it {verb}: "
        f"{cure}"
    ]


def _lag(loop: SensorLoop) -> tuple[float, float]:
    """Return the delay in a loop over the sensor [s], and the bandwidth of its servos [rad/s]."""
    period, sensor = loop.controller.sampling_time, loop.sensor
    delay = _LOST_TICKS * period + sensor.delay + 1.0 / (2.0 * np.pi * sensor.bandwidth)
    if loop.controller.law_record.commands_torque:
        return delay, np.inf
    return delay + loop.servo.bus_delay, loop.servo.bandwidth


def _noisy_inertia(
    loop: SensorLoop, robot: RobotModel, load: ToolLoad, rest: RestPosture
) -> list[str]:
    """Warn of encoders too coarse for what the tool's inertia is computed from."""
    sensor, encoders = loop.sensor, loop.encoders
    if not encoders.difference_quotient or sensor.inertia == "none":
        return []
    # one increment within a block changes its mean acceleration by so much
    link, _ = encoder_resolution(robot, encoders)
    change = link / (loop.controller.sampling_time * TARING_BLOCK)
    levers = np.sqrt(load.mass * np.diag(load_inertia(robot, load, rest.q_J)))
    noise, allowed = float(np.linalg.norm(levers * change)), float(sensor.taring_spread[:3].min())
    if noise <= allowed:
        return []
    return [
        "the tool's inertial load comes from the second difference of encoder positions, where "
        f"one increment is {noise:.2g} N; with more than sensor.taring_spread = {allowed:g} N it "
        "may never be tared, and what would yield rests: filter the velocities "
        "(encoders.filter_time) or take sensor.inertia 'none'"
    ]
