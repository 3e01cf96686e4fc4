"""What a law will not do well on a robot."""

import numpy as np

from diagrams.scenario import ControllerParameters, PathFollowingScenario
from pfsc_drake.robot.resonance import joint_resonances
from pfsc_drake.robot.robot_model import RobotModel

# rad per sampling interval, up to which the exact elastic law keeps its accuracy
_FASTEST_RESONANCE = 1.0
# K_s epsilon D_b T_s / D_M, up to which the sampled damping (3.71) is stable with some margin
_FASTEST_DAMPING = 1.8


def law_warnings(
    scenario: PathFollowingScenario, robot: RobotModel, link_state: np.ndarray
) -> list[str]:
    """Return what a scenario's sampled law will not do well, one sentence each.

    Args:
        scenario: The scenario.
        robot: The robot.
        link_state: ``[q_J, v_J]`` at the start, shape (2N,).
    """
    parameters = scenario.controller
    return [
        *_fast_resonance(parameters, robot, link_state),
        *_fast_damping(parameters, robot),
        *_unknown_forces(scenario, robot),
    ]


def _fast_resonance(
    parameters: ControllerParameters, robot: RobotModel, link_state: np.ndarray
) -> list[str]:
    if parameters.law != "elastic":
        return []
    period = parameters.sampling_time
    resonance = joint_resonances(robot, link_state[: robot.dimension])[-1]
    if resonance * period <= _FASTEST_RESONANCE:
        return []
    return [
        f"the joints resonate at up to {resonance / (2.0 * np.pi):.0f} Hz, "
        f"{resonance * period:.2f} rad per sampling interval; above "
        f"{_FASTEST_RESONANCE:g} rad the law 'elastic' loses accuracy and then "
        "oscillates: sample faster, or take the law 'visco_elastic' or 'singular_perturbation'"
    ]


def _fast_damping(parameters: ControllerParameters, robot: RobotModel) -> list[str]:
    if parameters.law != "singular_perturbation":
        return []
    damping = np.array(parameters.boundary_layer_damping)
    rate = float(np.max(robot.K_s * damping * parameters.sampling_time / robot.D_M))
    if rate <= _FASTEST_DAMPING:
        return []
    return [
        f"K_s epsilon D_b T_s / D_M is up to {rate:.2f}; above {_FASTEST_DAMPING:g} the "
        "sampled damping of the joint torques oscillates: lower "
        "controller.boundary_layer_damping or sample faster"
    ]


def _unknown_forces(scenario: PathFollowingScenario, robot: RobotModel) -> list[str]:
    parameters = scenario.controller
    scripted = bool(scenario.forces) or scenario.hold_back.force != 0.0
    pushed = scripted or scenario.hand is not None
    exact = parameters.law in ("elastic", "visco_elastic") and robot.is_elastic
    if not (exact and pushed and parameters.external_torque.source == "none"):
        return []
    return [
        f"forces act on the tool that the law '{parameters.law}' does not know of; it takes them "
        "for deflections of the joints and may leave the path: choose "
        "controller.external_torque.source 'measured' or 'known'"
    ]
