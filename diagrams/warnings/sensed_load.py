"""Warnings about the load below the force sensor, for the sensor and the compliance loop."""

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
    load_inertia,
    load_inertia_ratio,
    tolerable_inertia_ratio,
)
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.controller.law_warnings import least_of, slope_at_rest
from pfsc_drake.physics.joint_sensors import encoder_resolution
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad

# share of the inertia at the stability limit, up to which the loop is robust
_ROBUST = 0.5
# of that share, for a mass chosen exactly at the limit
_ROUNDING = 1e-6
# sampling intervals that a loop over the sensor loses: the hold and the filter of the impedance
_LOST_TICKS = 1.5


@dataclass(frozen=True)
class SensorLoop:
    """Loop over a force sensor: sensor, compliance, controller, servos.

    Attributes:
        sensor: The sensor.
        compliance: Compliance of the tool under measured forces.
        encoders: Encoders, by which the tool's inertial load is computed.
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
    """Return warnings about a load below the sensor, one sentence each.

    Args:
        loop: The loop over the sensor.
        robot: Nominal model of the robot.
        load: Nominal load below the sensor.
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
    """Warn of an uncompensated inertia that is too large for the virtual masses."""
    sensor, coordinates = loop.sensor, law.linearization.manifold.coordinates
    impedance = loop.compliance.impedance()
    kinds = [impedance.of(coordinate.kind) for coordinate in coordinates]
    # a coordinate without a stiffness of its own is compliant, too
    complies = [bool(kind.stiffness.at) or np.isfinite(kind.stiffness.value) for kind in kinds]
    masses = np.where(complies, [least_of(kind.mass) for kind in kinds], np.inf)
    felt = load_inertia(robot, load, rest.q_J, sensor.unknown_mass)
    mass = load.mass + sensor.unknown_mass
    if sensor.inertia != "none":
        felt -= load_inertia(robot, load, rest.q_J)
        mass = sensor.unknown_mass
    share, worst = load_inertia_ratio(felt, slope_at_rest(law, rest), masses)
    tolerable = tolerable_inertia_ratio(*_lag(loop))
    if share <= (_ROBUST + _ROUNDING) * tolerable:
        return []
    unit = "kg m^2" if coordinates[worst].kind is Kind.ROTATIONAL else "kg"
    needed = masses[worst] * share / (_ROBUST * tolerable)
    kind = coordinates[worst].kind.value
    block = {"eta": "tangential", "xi": "transversal", "phi": "rotational"}.get(kind, kind)
    cure = f"compliance.{block}.mass of {needed:.2g} {unit} or more"
    if sensor.inertia == "none" and load.mass > sensor.unknown_mass:
        cure = (
            f"sensor.inertia: differentiated, which compensates the {load.mass:.3g} kg, or {cure}"
        )
    verb = "is unstable" if share > tolerable else "may oscillate with a slightly larger load"
    return [
        f"the sensor measures the inertia of {mass:.3g} kg below it, which is not compensated, and "
        f"the compliance responds: {share / tolerable:.2g} times the inertia that the mass of "
        f"{masses[worst]:g} {unit} in {coordinates[worst].name} tolerates, and with more than "
        f"{_ROBUST:g} the loop {verb}: {cure}"
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
    """Warn of encoders too coarse for the compensation of the tool's inertia."""
    sensor, encoders = loop.sensor, loop.encoders
    if not encoders.difference_quotient or sensor.inertia == "none":
        return []
    # change of the mean acceleration of a block by one increment
    link, _ = encoder_resolution(robot, encoders)
    change = link / (loop.controller.sampling_time * TARING_BLOCK)
    levers = np.sqrt(load.mass * np.diag(load_inertia(robot, load, rest.q_J)))
    noise, allowed = float(np.linalg.norm(levers * change)), float(sensor.taring_spread[:3].min())
    if noise <= allowed:
        return []
    return [
        "the tool's inertial load comes from the second difference of encoder positions, where "
        f"one increment is {noise:.2g} N; with more than sensor.taring_spread = {allowed:g} N it "
        "may never be tared, and compliant coordinates stay at rest: filter the velocities "
        "(encoders.filter_time) or take sensor.inertia 'none'"
    ]
