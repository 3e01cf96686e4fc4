"""Warnings of a law on its robot, before it moves."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from pfsc_drake.control.compliance.impedance_parameters import Profile, SlowEnds
from pfsc_drake.control.compliance.tuned_impedance import (
    tolerable_inertia_error,
    tolerable_mass_error,
)
from pfsc_drake.control.fixtures.record import Mode
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import FASTEST_DAMPING
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.robust_gains import RobotError, SampledRobot
from pfsc_drake.control.law.soft_joints import bending, composite_law_error, soft_joints
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.controller.free_posture import warn_unused
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import ControllerParameters
from pfsc_drake.robot.robot_model import RobotModel, joint_resonances
from pfsc_drake.yaml.fields import spread

# relative, of masses and of stiffnesses, which gains should tolerate
_TOLERATED_ERROR = 0.05
# m per m/s^2, from which on joints are soft for laws of stiff joints. Of the arms of
# docs/studies/joint_stiffness.md, the errors of 5, 0.36 and 0.08 mm of linear theory are 1.1, 0.2
# and 0.07 mm at accelerations up to 2 m/s^2; where the loop is unstable in theory, they are 90 mm
_LARGEST_SOFTNESS = 1e-3


def law_warnings(
    parameters: ControllerParameters,
    robot: RobotModel,
    law: FollowingLaw,
    link_state: np.ndarray,
    sampled: Callable[[], SampledRobot],
) -> list[str]:
    """Return warnings of the performance of a sampled law, one sentence each.

    Args:
        parameters: The controller.
        robot: The robot.
        law: Its law.
        link_state: ``[q_J, v_J]`` at the start, shape (2N,).
        sampled: Returns the sampled loop at rest, if the law commands torques.
    """
    causes = [
        *_fast_resonance(parameters, robot, link_state),
        *_fast_damping(parameters, robot),
        *_soft_joints(parameters, robot, law, link_state),
    ]
    # if the law does not suit the robot, gains are not the cause
    return causes or _fragile_gains(parameters, law, sampled)


def _fast_resonance(
    parameters: ControllerParameters, robot: RobotModel, link_state: np.ndarray
) -> list[str]:
    period, fastest = parameters.sampling_time, parameters.law_record.fastest_resonance
    if np.isinf(fastest):
        return []
    resonance = joint_resonances(robot, link_state[: robot.dimension])[-1]
    if resonance * period <= fastest:
        return []
    return [
        f"the joints resonate at up to {resonance / (2.0 * np.pi):.3g} Hz, "
        f"{resonance * period:.2f} rad per sampling interval; above "
        f"{fastest:g} rad the law '{parameters.law}' loses accuracy and then "
        "oscillates: sample faster, or take the law 'visco_elastic' or 'singular_perturbation'"
    ]


def _fragile_gains(
    parameters: ControllerParameters, law: FollowingLaw, sampled: Callable[[], SampledRobot]
) -> list[str]:
    """Warn of gains that do not tolerate a small error of the model, on the loop at rest."""
    if law.linearization.relative_degree == 1:
        return []
    at_rest, gains = sampled(), law.gains
    advice = "poles: auto with a bandwidth chooses gains that do; 'margins' shows more"
    if at_rest.rate(gains, RobotError()) > 0.0:
        return [
            f"the loop of the law '{parameters.law}' with these gains is unstable at the start "
            f"even on a perfect model, sampled at {1e3 * parameters.sampling_time:g} ms: lower "
            "the gains or sample faster"
        ]
    error = at_rest.destabilizing_error(gains, _TOLERATED_ERROR)
    if error is None:
        return []
    return [
        f"the gains of the law '{parameters.law}' do not tolerate "
        f"{100.0 * _TOLERATED_ERROR:g} %: with {error} the loop is unstable at the start, and "
        f"about {100.0 * at_rest.largest_error(gains, error):.1f} % is tolerated; {advice}"
    ]


def _fast_damping(parameters: ControllerParameters, robot: RobotModel) -> list[str]:
    if not parameters.law_record.damps_springs:
        return []
    damping = np.array(spread(parameters.boundary_layer_damping, robot.dimension))
    # rigid joints among elastic ones have nothing to damp
    stiffness = np.where(robot.elastic_joints, robot.K_s, 0.0)
    rate = float(np.max(stiffness * damping * parameters.sampling_time / robot.D_M))
    if rate <= FASTEST_DAMPING * (1.0 + 1e-9):
        return []
    return [
        f"K_s epsilon D_b T_s / D_M is up to {rate:.2f}; above {FASTEST_DAMPING:g} the "
        "damping of the joint torques takes the tool off the path, and from 2 on, being sampled, "
        "it oscillates: lower controller.boundary_layer_damping or sample faster"
    ]


def _soft_joints(
    parameters: ControllerParameters, robot: RobotModel, law: FollowingLaw, link_state: np.ndarray
) -> list[str]:
    """Warn of joints that are too soft for a law of stiff joints."""
    manifold = law.linearization.manifold
    record = parameters.law_record
    if not (record.damps_springs or record.on_motors) or not robot.is_elastic:
        return []
    q_J = link_state[: robot.dimension]
    turns = any(coordinate.kind is Kind.ROTATIONAL for coordinate in manifold.coordinates)
    tool = manifold.tool
    joints = soft_joints(
        robot, q_J, oriented=turns, tool_axis=tool.tool_axis, yaw_axis=tool.yaw_axis
    )
    if record.on_motors:
        softness = bending(joints)
        what = "acts on the motors, and bending joints let the tool leave the path"
    else:
        posture = None if law.posture is None else law.posture.stabilization.proportional
        damping = np.array(spread(parameters.boundary_layer_damping, robot.dimension))
        softness = composite_law_error(joints, damping, _transversal_gains(law), posture)
        what = "assumes stiff joints, and lets the tool leave the path"
    resonance = joint_resonances(robot, q_J)[0] / (2.0 * np.pi)
    instead = "take the law 'elastic' or 'visco_elastic'"
    if np.isinf(softness):
        return [
            f"the joints resonate at {resonance:.3g} Hz, and the law '{parameters.law}' with "
            f"these gains is unstable on joints that soft: {instead}, or slower gains"
        ]
    if softness <= _LARGEST_SOFTNESS:
        return []
    return [
        f"the joints resonate at {resonance:.3g} Hz; the law '{parameters.law}' {what}, by up to "
        f"{1e3 * softness:.2g} mm for each m/s^2 of its acceleration: {instead}"
    ]


def _transversal_gains(law: FollowingLaw) -> np.ndarray:
    """Return the gains of a law, with transversal ones for tangential and free coordinates."""
    coordinates = law.linearization.manifold.coordinates
    along, across = (indices(coordinates, k) for k in (Kind.TANGENTIAL, Kind.TRANSVERSAL))
    gains = law.stabilization.proportional.copy()
    own = gains[:, across.start : across.start + 1]
    gains[:, along] = own
    gains[:, law.stabilization.is_free] = own
    return gains


def servo_warnings(bandwidth: float, robot: RobotModel, link_state: np.ndarray) -> list[str]:
    """Return a warning of servos that are faster than the joints behind them.

    They hold the motors against the oscillation of the links, and do not damp it.

    Args:
        bandwidth: Bandwidth of the servos [rad/s].
        robot: The robot.
        link_state: ``[q_J, v_J]`` at the start, shape (2N,).
    """
    if not robot.is_elastic:
        return []
    resonance = joint_resonances(robot, link_state[: robot.dimension])[0]
    if bandwidth <= resonance:
        return []
    return [
        f"servo.bandwidth = {bandwidth:g} rad/s is above the lowest resonance of the joints, "
        f"{resonance:.0f} rad/s; servos that fast do not damp it, and the loop may oscillate: "
        "lower servo.bandwidth and the gains"
    ]


def unused_parameters(parameters: ControllerParameters, law: FollowingLaw) -> list[str]:
    """Return warnings of parameters that the law does not use, one sentence each.

    Args:
        parameters: The controller.
        law: Its law.
    """
    return [*_friction_behind_servos(parameters), *warn_unused(parameters, law)]


def _friction_behind_servos(parameters: ControllerParameters) -> list[str]:
    if parameters.law_record.commands_torque or not parameters.friction.is_given:
        return []
    return [
        "controller.friction is not used: the servos of the law 'velocity_servo' overcome friction "
        "themselves"
    ]


def observed_force_warnings(
    compliance: ComplianceParameters, robot: RobotModel, law: FollowingLaw, rest: RestPosture
) -> list[str]:
    """Return a warning of a compliance that does not tolerate wrong masses of the model.

    Args:
        compliance: Compliance of the tool.
        robot: Nominal model of the robot.
        law: The law behind the compliance.
        rest: The start, and the manifold's point there.
    """
    linearization = law.linearization
    if compliance.source != "observed" or not compliance.is_given:
        return []
    rate, impedance = compliance.observed.rate, compliance.impedance()
    kinds = [impedance.of(coordinate.kind) for coordinate in linearization.manifold.coordinates]
    errors = np.array(
        [
            tolerable_inertia_error(
                least_of(kind.mass), least_of(kind.damping), _most(kind.stiffness), rate
            )
            for kind in kinds
        ]
    )
    inertia = ca.evalf(robot.mass_matrix(ca.SX(rest.q_J))).full()
    tolerated = tolerable_mass_error(inertia, slope_at_rest(law, rest), errors)
    if tolerated >= _TOLERATED_ERROR:
        return []
    return [
        f"compliance.source = observed tolerates nominal masses {100.0 * tolerated:.1f} % too "
        f"high at the start, not {100.0 * _TOLERATED_ERROR:g} %: larger masses or damping in "
        "compliance, or a slower compliance.observed.rate"
    ]


def slope_at_rest(law: FollowingLaw, rest: RestPosture) -> np.ndarray:
    """Return ``A = d yhat / dq`` at the start, shape (m, N).

    Args:
        law: The law.
        rest: The start, and the manifold's point there.
    """
    n, linearization = law.robot.dimension, law.linearization
    state = np.concatenate([rest.q_J, np.zeros(n), rest.q_J, np.zeros(n)])
    no_torque = np.zeros(n * (linearization.relative_degree - 1))
    return np.array(linearization.function(state, no_torque, rest.point)[1])


def least_of(profile: Profile | SlowEnds) -> float:
    """Return the least value of a profile.

    Args:
        profile: The profile.
    """
    if isinstance(profile, SlowEnds):
        return profile.least
    return min(profile.values, default=profile.value)


def _most(profile: Profile) -> float:
    return max(profile.values, default=profile.value)


# names of the values of the logged signal ``mode``
MODES = tuple(mode.name.lower() for mode in Mode)
