"""A law with all that tells it of forces and friction, and of where spare joints are to be."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.following.believed import Believed
from pfsc_drake.following.external_torque import add_external_torque
from pfsc_drake.following.friction import add_friction_compensation
from pfsc_drake.following.observed_forces import add_observed_forces
from pfsc_drake.following.options.compliance import ObservedForceParameters
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.faults import FaultParameters
from pfsc_drake.following.posture import add_posture_reference
from pfsc_drake.following.safety import supervision
from pfsc_drake.systems.control.following_controller import FollowingController

# what an observer tells
_OBSERVED = ("tau_ext_observed", "wrench_observed")


def add_controller(
    builder: DiagramBuilder,
    law: FollowingLaw,
    believed: Believed,
    options: ControllerParameters,
    faults: FaultParameters,
    ports: dict[str, OutputPort],
    tool: ObservedForceParameters | None = None,
) -> tuple[FollowingController, dict[str, OutputPort], dict[str, OutputPort]]:
    """Add a law and connect all of its inputs but ``reference`` and ``alarms``.

    Args:
        builder: Builder of the diagram.
        law: The law.
        believed: The robot.
        options: What is chosen of the controller.
        faults: What is a fault.
        ports: ``joint_state``, ``manifold_point``, and what there is of ``wrench_ext``,
            ``wrench_measured``, ``push_torque``.
        tool: How forces on the tool are observed for compliance, if they are.

    Returns:
        The controller; the ports given with all that was added (see the functions that add it);
        and what of that is worth a look: ``friction_estimate``, ``tau_ext_observed``,
        ``wrench_observed``, ``posture_reference``.

    Raises:
        InputError: If external torques, friction or posture do not suit the law.
    """
    watched = supervision(options.law, faults, believed)
    controller = builder.AddNamedSystem(
        "following_controller", FollowingController(law, options.sampling_time, watched)
    )
    robot, signals = believed.robot, dict(ports)
    signals |= add_external_torque(builder, robot, options, controller, signals)
    friction, logged = add_friction_compensation(builder, believed, options, controller, signals)
    if friction is not None:
        signals["friction"] = friction
    signals |= add_observed_forces(builder, believed, options, tool, controller, signals)
    logged |= {name: signals[name] for name in _OBSERVED if name in signals}
    logged |= add_posture_reference(builder, robot, options, law, controller, signals)
    for name in ("joint_state", "manifold_point"):
        builder.Connect(signals[name], controller.GetInputPort(name))
    return controller, signals, logged
