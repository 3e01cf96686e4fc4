"""Laws: one record each, with all properties of the law."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.law import actuation
from pfsc_drake.control.law.actuation import DrivenMotion, DriveState
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# largest K_s epsilon D_b T_s / D_M for pure damping by (3.71); sampled, it is unstable
# from 2 on. Six axes of pfc_comau_6r leave the path by 0.41 mm at 1.56, by 0.06 mm at 0.3
FASTEST_DAMPING = 0.3


@dataclass
class ActuationOptions:
    """Options of the actuation models.

    Attributes:
        sampling_time: Sampling time ``T_s`` of the controller [s] (``visco_elastic``,
            ``elastic``); 0 for a continuous controller.
        boundary_layer_damping: Diagonal of ``epsilon D_b`` [s], shape (N,)
            (``singular_perturbation``).
        leads_torque: Whether torques are extrapolated to the middle of their hold (``rigid``), as
            always with the sampled elastic laws.
    """

    sampling_time: float = 1e-3
    boundary_layer_damping: np.ndarray | None = None
    leads_torque: bool = False


@dataclass(frozen=True)
class Law:
    """Law: actuation model and its properties.

    Attributes:
        name: Name in scenarios and calls.
        relative_degree: ``r``: the virtual output's r-th derivative is affine in the drives.
        drive: ``(robot, state, options)`` to the affine relation between drives and ``q^(r)``;
            refuses robots and options that do not suit the law.
        demand_order: Highest derivative of the joint coordinates in the drives' torques.
        lead: Extrapolation of the varying part of the drive input [sampling intervals].
        can_lead: Whether extrapolation to the middle of the hold is an option.
        on_motors: Whether the output is a function of the motors if joints are elastic.
        knows_links: Whether the law needs the links' side of elastic joints.
        inverts_springs: Whether the springs' deflection is part of the drives' motion.
        damps_springs: Whether torques of springs are damped by a fast part (3.71).
        fastest_resonance: Resonance of joints up to which the sampled law is accurate, in rad per
            sampling interval.
    """

    name: str
    relative_degree: int
    drive: Callable[[RobotModel, DriveState, ActuationOptions], DrivenMotion]
    demand_order: int
    lead: float = 0.0
    can_lead: bool = False
    on_motors: bool = False
    knows_links: bool = False
    inverts_springs: bool = False
    damps_springs: bool = False
    fastest_resonance: float = np.inf

    @property
    def commands_torque(self) -> bool:
        """Whether drives get torques, not velocities."""
        return self.relative_degree > 1


def _rigid(robot: RobotModel, state: DriveState, options: ActuationOptions) -> DrivenMotion:
    return actuation.rigid(robot, state, changes=options.leads_torque)


def _composite(robot: RobotModel, state: DriveState, options: ActuationOptions) -> DrivenMotion:
    damping = options.boundary_layer_damping
    if damping is None or np.shape(damping) != (robot.dimension,) or not np.min(damping) > 0:
        raise InputError(
            f"controller.boundary_layer_damping: {damping}; the law 'singular_perturbation' "
            f"needs {robot.dimension} positive values [s], {_damping_hint(robot, options)}"
        )
    return actuation.singular_perturbation(robot, state, damping)


def _visco_elastic(robot: RobotModel, state: DriveState, options: ActuationOptions) -> DrivenMotion:
    period = _sampling_time(options)
    if period == 0.0 and not np.all(robot.K_d > 0.0):
        raise InputError(
            f"joint damping: {robot.K_d}; the law 'visco_elastic' needs positive values "
            "when sampling_time is 0"
        )
    return actuation.visco_elastic(robot, state, period)


def _sampling_time(options: ActuationOptions) -> float:
    if not 0.0 <= options.sampling_time < np.inf:
        raise InputError(
            f"sampling_time: {options.sampling_time}; must be zero or a positive number of seconds"
        )
    return options.sampling_time


def _damping_hint(robot: RobotModel, options: ActuationOptions) -> str:
    """Return initial values of ``epsilon D_b``.

    They damp each motor against a link at rest by sqrt(1/2), if sampling permits.
    """
    elastic = robot.elastic_joints
    if not elastic.any():
        return "and elastic joints"
    K_s, D_M = robot.K_s[elastic], robot.D_M[elastic]
    damping = np.sqrt(2.0 * D_M / K_s)
    if options.sampling_time > 0.0:
        damping = np.minimum(damping, FASTEST_DAMPING * D_M / (K_s * options.sampling_time))
    values = np.full(robot.dimension, damping.min())
    values[elastic] = damping
    return f"perhaps [{', '.join(f'{value:.2g}' for value in values)}]"


LAWS = {
    law.name: law
    for law in (
        Law("velocity_servo", 1, lambda robot, state, _: actuation.velocity_servo(robot, state), 2),
        Law("rigid", 2, _rigid, 2, can_lead=True, on_motors=True),
        Law("singular_perturbation", 2, _composite, 3, knows_links=True, damps_springs=True),
        Law(
            "visco_elastic",
            3,
            _visco_elastic,
            4,
            lead=1.0,
            knows_links=True,
            inverts_springs=True,
        ),
        Law(
            "elastic",
            4,
            lambda robot, state, options: actuation.elastic(robot, state, _sampling_time(options)),
            4,
            lead=0.5,
            knows_links=True,
            inverts_springs=True,
            fastest_resonance=1.0,
        ),
    )
}
RELATIVE_DEGREE = {name: law.relative_degree for name, law in LAWS.items()}
