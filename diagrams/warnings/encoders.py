"""Encoders whose increments a law amplifies to jumps of the torque."""

import numpy as np

from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.physics.joint_sensors import EncoderOptions, encoder_resolution
from pfsc_drake.robot.robot_model import RobotModel, mass_function

# of a drive's torque, by which one increment may change it
_LARGEST_SHARE = 0.3


def coarse_encoders(
    encoders: EncoderOptions, period: float, robot: RobotModel, law: FollowingLaw, q_J: np.ndarray
) -> list[str]:
    """Return what to say of encoders too coarse for a law of relative degree two.

    One increment changes a difference quotient by ``r / T_s``, to which a velocity gain k_1 of all
    outputs answers with the joint acceleration ``k_1 r / T_s``.

    Args:
        encoders: The encoders.
        period: Sampling time T_s [s].
        robot: The robot as the controller knows it, N joints.
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
        f"{step[worst]:.2g} {unit}, to which the gains answer with {100.0 * share[worst]:.0f} % of "
        f"the torque of its drive; at most {100.0 * _LARGEST_SHARE:.0f} % let it follow quietly: "
        "finer encoders (encoders.link_increments, motor_increments), lower gains, or a velocity "
        "that is measured"
    ]
