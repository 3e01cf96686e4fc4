"""What is said beforehand of obstacles that are not what the controller takes them for."""

import numpy as np

from diagrams.scenario.obstacles import CrossingParameters
from pfsc_drake.physics.moving_obstacle import NOISE_CUT

_ROUNDING = 1.0 + 1e-9


def obstacle_warnings(crossing: CrossingParameters | None) -> list[str]:
    """Return where the margin is not promised, one sentence each.

    Args:
        crossing: The obstacles, if there are any.
    """
    if crossing is None:
        return []
    watch, sensor, said = crossing.watch, crossing.sensor, []
    for k, obstacle in enumerate(crossing.moving):
        speed = obstacle.largest_speed
        if speed > watch.largest_speed * _ROUNDING:
            said.append(
                f"obstacles.moving[{k}] moves at up to {speed:.3g} m/s; no margin is kept from "
                f"what is faster than obstacles.watch.largest_speed = {watch.largest_speed:g} m/s"
            )
        hasty, most = obstacle.largest_acceleration, watch.largest_acceleration
        if most is not None and hasty > most * _ROUNDING:
            said.append(
                f"obstacles.moving[{k}] accelerates with up to {hasty:.3g} m/s^2; no "
                "margin is kept from what is hastier than "
                f"obstacles.watch.largest_acceleration = {most:g} m/s^2"
            )
    late = sensor.delay + sensor.period
    if late > watch.latency * _ROUNDING:
        said.append(
            f"obstacles.watch.latency = {watch.latency:g} s; what obstacles.sensor tells is up to "
            f"{late:g} s old, its delay and its period together"
        )
    noise = NOISE_CUT * np.sqrt(3.0) * sensor.position_noise
    if noise > watch.uncertainty * _ROUNDING:
        said.append(
            f"obstacles.watch.uncertainty = {watch.uncertainty:g} m; noise of "
            f"obstacles.sensor.position_noise makes up to {noise:.3g} m"
        )
    noise = NOISE_CUT * np.sqrt(3.0) * sensor.velocity_noise
    if watch.largest_acceleration is not None and noise > watch.velocity_uncertainty * _ROUNDING:
        said.append(
            f"obstacles.watch.velocity_uncertainty = {watch.velocity_uncertainty:g} m/s; noise of "
            f"obstacles.sensor.velocity_noise makes up to {noise:.3g} m/s"
        )
    return said
