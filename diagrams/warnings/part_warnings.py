"""Warnings before a run about encoders, obstacles, fixtures and the end of a teleoperation."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from diagrams.scenario import HandParameters
from diagrams.scenario.obstacles import CrossingParameters
from diagrams.scenario.teleoperation import TeleoperationParameters
from diagrams.scenario.virtual_fixtures import FixtureParameters
from pfsc_drake.control.fixtures.command_dynamics import ServoDynamics
from pfsc_drake.control.fixtures.fixture_parameters import tolerable_stiffness
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.physics.joint_sensors import EncoderOptions, encoder_resolution
from pfsc_drake.physics.moving_obstacle import NOISE_CUT
from pfsc_drake.robot.robot_model import RobotModel, mass_function

# share of a drive's torque by which one increment may change it
_LARGEST_SHARE = 0.3
_ROUNDING = 1.0 + 1e-9


def coarse_encoders(
    encoders: EncoderOptions, period: float, robot: RobotModel, law: FollowingLaw, q_J: np.ndarray
) -> list[str]:
    """Return a warning about encoders too coarse for a law of relative degree two.

    One increment changes a difference quotient by ``r / T_s``, to which a velocity gain k_1 of all
    outputs responds with the joint acceleration ``k_1 r / T_s``.

    Args:
        encoders: The encoders.
        period: Sampling time T_s [s].
        robot: Nominal model of the robot, N joints.
        law: The law.
        q_J: Joint coordinates at the start, shape (N,).
    """
    if not encoders.difference_quotient or law.linearization.relative_degree != 2:
        return []
    step = encoder_resolution(robot, encoders).max(axis=0) / period
    gain = float(law.stabilization.proportional[1].max())
    inertia = np.diag(np.array(mass_function(robot)(q_J))) + robot.D_M
    share = inertia * gain * step / robot.gather("effort_limit")
    worst = int(np.argmax(share))
    if not share[worst] > _LARGEST_SHARE:
        return []
    unit = "rad/s" if robot.gather("is_revolute")[worst] else "m/s"
    return [
        f"encoders: one increment of joint {worst + 1} changes its difference quotient by "
        f"{step[worst]:.2g} {unit}, to which the gains respond with {100.0 * share[worst]:.0f} % "
        f"of the torque of its drive; up to {100.0 * _LARGEST_SHARE:.0f} % are acceptable: "
        "finer encoders (encoders.link_increments, motor_increments), lower gains, or a measured "
        "velocity"
    ]


def obstacle_warnings(crossing: CrossingParameters | None) -> list[str]:
    """Return the obstacles to which the margin may be violated, one sentence each.

    Args:
        crossing: The obstacles, if there are any.
    """
    if crossing is None:
        return []
    watch, sensor, warnings = crossing.watch, crossing.sensor, []
    for k, obstacle in enumerate(crossing.moving):
        speed = obstacle.largest_speed
        if speed > watch.largest_speed * _ROUNDING:
            warnings.append(
                f"obstacles.moving[{k}] moves at up to {speed:.3g} m/s; the margin holds for "
                f"speeds up to obstacles.watch.largest_speed = {watch.largest_speed:g} m/s"
            )
        hasty, most = obstacle.largest_acceleration, watch.largest_acceleration
        if most is not None and hasty > most * _ROUNDING:
            warnings.append(
                f"obstacles.moving[{k}] accelerates with up to {hasty:.3g} m/s^2; the "
                "margin holds for accelerations up to "
                f"obstacles.watch.largest_acceleration = {most:g} m/s^2"
            )
    late = sensor.delay + sensor.period
    if late > watch.latency * _ROUNDING:
        warnings.append(
            f"obstacles.watch.latency = {watch.latency:g} s; measurements of obstacles.sensor are "
            f"up to {late:g} s old, its delay and its period together"
        )
    noise = NOISE_CUT * np.sqrt(3.0) * sensor.position_noise
    if noise > watch.uncertainty * _ROUNDING:
        warnings.append(
            f"obstacles.watch.uncertainty = {watch.uncertainty:g} m; noise of "
            f"obstacles.sensor.position_noise makes up to {noise:.3g} m"
        )
    noise = NOISE_CUT * np.sqrt(3.0) * sensor.velocity_noise
    if watch.largest_acceleration is not None and noise > watch.velocity_uncertainty * _ROUNDING:
        warnings.append(
            f"obstacles.watch.velocity_uncertainty = {watch.velocity_uncertainty:g} m/s; noise of "
            f"obstacles.sensor.velocity_noise makes up to {noise:.3g} m/s"
        )
    return warnings


def stiff_fixtures(fixtures: FixtureParameters, task: SpaceTask) -> list[str]:
    """Return the soft regions and guides that may oscillate with servos, one sentence each.

    Args:
        fixtures: Regions and guides.
        task: Task of the tool.
    """
    motion, command_dynamics = task.admittance, task.command_dynamics
    if not isinstance(command_dynamics, ServoDynamics):
        return []
    lag = command_dynamics.lag
    most = tolerable_stiffness(motion, lag)
    springs = {
        f"regions[{number}]": (region.stiffness, "region", "softer or hard")
        for number, region in enumerate(fixtures.regions)
        if region.stiffness is not None
    }
    for number, guide in enumerate(fixtures.guides):
        springs[f"guides[{number}]"] = guide.stiffness, "guide", "softer"
    return [
        f"fixtures.{key}.stiffness = {stiffness:g} N/m: compliance.tangential with "
        f"{motion.damping:g} N s/m tolerates {most:.2g} N/m where the lag of servos and bus, "
        f"{1e3 * lag:.2g} ms, is larger than modelled by a fifth or a tick; a stiffer {kind} may "
        f"oscillate: make it {cure}, or the damping larger"
        for key, (stiffness, kind, cure) in springs.items()
        if stiffness > most
    ]


def firm_guides(guides: Mapping[str, Guide], forces: Sequence[float]) -> list[str]:
    """Return the guides that a hand is too weak to leave, one sentence each.

    Args:
        guides: The paths that attract, by name.
        forces: Largest forces of the hands [N].
    """
    largest = max(forces, default=math.inf)
    return [
        f"fixtures.guides[{number}] ({name}): {guide.largest_force:.3g} N are needed to leave it, "
        f"and the hand has {largest:.3g} N: reduce stiffness or reach"
        for number, (name, guide) in enumerate(guides.items())
        if guide.largest_force > largest
    ]


def rest_warnings(
    teleoperation: TeleoperationParameters | None, hand: HandParameters | None, duration: float
) -> list[str]:
    """Return a warning if both sides do not come to rest at the same position in time.

    Waves in the channel when a hand releases the device return within a round trip, and decay in
    the next ones.

    Args:
        teleoperation: The teleoperation, if there is one.
        hand: The simulated hand at the leader, if there is one.
        duration: Simulated time [s].
    """
    if teleoperation is None or hand is None or hand.release >= duration:
        return []
    left = duration - hand.release - hand.grip_ramp
    channel, smoothing = teleoperation.channel, teleoperation.smoothing
    trip = 2.0 * (channel.delay + channel.jitter / 2.0 + 2.0 * smoothing)
    if left >= trip:
        return []
    return [
        f"hand.release = {hand.release:g} s; after the release leader and tool need round trips of "
        f"{trip:.2g} s until they rest at the same position, and {left:.2g} s are left"
    ]
