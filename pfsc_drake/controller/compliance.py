"""Compliance: from forces on the tool to the reference of the law."""

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.compliance.impedance import DAMPING, MASS, STIFFNESS, ImpedanceLaw
from pfsc_drake.control.compliance.impedance_filter import (
    GuidedMotion,
    ImpedanceFilter,
    ManifoldForceTransform,
)
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance
from pfsc_drake.control.compliance.path_ends import PathEnds
from pfsc_drake.control.compliance.pressing import Pressing
from pfsc_drake.control.compliance.tuned_impedance import ImpedanceTuner, TuningParameters
from pfsc_drake.control.fixtures.robot_limits import RobotLimits
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.manifolds.coordinate import Coordinate, Kind
from pfsc_drake.control.manifolds.manifold import Manifold, indices
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem

# highest derivative of the external reference in the filter, see ImpedanceLaw
_DESIRED_ORDER = 4


def has_impedance(compliance: ComplianceParameters, manifold: Manifold) -> bool:
    """Return whether an impedance changes the reference of the law.

    In space guidance moves the tool, so that only the angles need an impedance.

    Args:
        compliance: Compliance of the tool.
        manifold: Followed manifold.
    """
    if manifold.name != SpaceManifold.name:
        return compliance.is_given
    return ComplianceParameters(rotational=compliance.rotational).is_given


def reference_order(compliance: ComplianceParameters, linearization: Linearization) -> int:
    """Return the highest derivative of the external reference that is needed.

    Args:
        compliance: Compliance of the tool.
        linearization: Linearization of the law.

    Raises:
        InputError: If the law does not support the compliance.
    """
    if not has_impedance(compliance, linearization.manifold):
        return linearization.relative_degree
    if linearization.manifold.follows_time:
        raise InputError(
            "compliance: controller.manifold = trajectory has no path coordinates that could "
            "comply; must be path"
        )
    return max(linearization.relative_degree, _DESIRED_ORDER)


def force_ports(
    compliance: ComplianceParameters, ports: dict[str, OutputPort]
) -> tuple[OutputPort, OutputPort]:
    """Return the wrench for the compliance of a tool, and whether it is valid.

    Args:
        compliance: Compliance of the tool.
        ports: ``wrench_measured`` and ``tared``, or without a sensor ``wrench_observed`` and
            ``ready``; ``wrench_led`` with further forces than the measured ones, if there is one.
    """
    names = ("wrench_measured", "tared")
    if compliance.source == "observed":
        names = ("wrench_observed", "ready")
    return ports.get("wrench_led", ports[names[0]]), ports[names[1]]


def add_compliance(
    builder: DiagramBuilder,
    options: FollowerOptions,
    linearization: Linearization,
    robot: RobotModel,
    task: Task,
    posture: np.ndarray,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add everything between the measured forces on the tool and the reference of the law.

    Args:
        builder: Builder of the diagram.
        options: Compliance of the tool, stream of its motion, and an operator's settings.
        linearization: Linearization of the law that follows the reference.
        robot: Nominal model of the robot, N joints.
        task: Task of the tool without forces.
        posture: Joint coordinates at the start, shape (N,) [rad or m].
        ports: Those of :func:`force_ports`, and ``joint_state``, ``manifold_point``,
            ``manifold_state`` and ``desired_reference`` with derivatives up to
            :func:`reference_order`; with an operator ``impedance_request``.

    Returns:
        ``reference`` for the law, and for the log ``desired_reference``, ``manifold_force``, with
        a force reference ``press``, with an operator ``impedance`` and ``tank``, else where it
        varies ``damping`` of every coordinate; with hand guiding, ``limit_force``;
        ``compliance_status``, an :class:`ImpedanceStatus`, and with a force reference
        ``press_lost``, whether the force is too far from it.

    Raises:
        InputError: If the compliance does not suit the law.
    """
    manifold, compliance = linearization.manifold, options.compliance
    period = options.controller.sampling_time
    impedance_parameters = compliance.impedance()
    if manifold.name == SpaceManifold.name:
        # guidance moves the tool, see add_guidance
        impedance_parameters.tangential = CoordinateImpedance()
    law = ImpedanceLaw(
        impedance_parameters.on_path(task.length),
        manifold.coordinates,
        linearization.relative_degree,
        period,
        desired_order=reference_order(compliance, linearization),
        revolution=task.revolution,
    )
    limits = _limits(compliance, linearization.manifold, robot, posture, period)
    free = None if limits is None else limits.tangential
    ends = _ends(law, manifold, compliance.limits.settling)
    yielding = ImpedanceFilter(law, start="actual", free=free, ends=ends)
    impedance = builder.AddNamedSystem("impedance_filter", BlockSystem(yielding, period))
    along = ManifoldForceTransform(manifold, with_turning=compliance.with_turning)
    transform = builder.AddNamedSystem("manifold_force_transform", BlockSystem(along, period))
    reference = impedance.GetOutputPort("reference")
    force = transform.GetOutputPort("manifold_force")
    wrench, ready = force_ports(compliance, ports)
    builder.Connect(wrench, transform.GetInputPort("wrench"))
    builder.Connect(ports["manifold_point"], transform.GetInputPort("manifold_point"))
    if transform.HasInputPort("reference"):
        builder.Connect(reference, transform.GetInputPort("reference"))
    force_signals = {"manifold_force": force, "reference": reference, "ready": ready}
    end = task.end if options.stream is None else math.inf
    signals = _add_press(builder, compliance, law, manifold.coordinates, force_signals, end)
    builder.Connect(signals.pop("pressed_force", force), impedance.GetInputPort("manifold_force"))
    builder.Connect(ready, impedance.GetInputPort("ready"))
    for name in ("desired_reference", "manifold_state"):
        builder.Connect(ports[name], impedance.GetInputPort(name))
    desired = ports["desired_reference"]
    if limits is not None:
        signals["limit_force"] = _add_limits(builder, limits, impedance, ports)
    # where guidance moves the tool, the impedance is constant
    operator = options.operator
    if operator is not None and manifold.name != SpaceManifold.name:
        signals |= _add_tuner(builder, operator.tuning, manifold.coordinates, law, impedance, ports)
    elif not law.is_constant:
        signals["damping"] = impedance.GetOutputPort("damping")
    return signals | {
        "reference": reference,
        "desired_reference": desired,
        "manifold_force": force,
        "compliance_status": impedance.GetOutputPort("status"),
    }


def _ends(law: ImpedanceLaw, manifold: Manifold, settling: float) -> PathEnds | None:
    """Return the ends of an open path, between which the reference stays."""
    for k, coordinate in enumerate(manifold.coordinates):
        if np.isfinite(coordinate.ends).all():
            return PathEnds(law, k, coordinate.ends, settling)
    return None


def _limits(
    compliance: ComplianceParameters,
    manifold: Manifold,
    robot: RobotModel,
    start: np.ndarray,
    period: float,
) -> GuidedMotion | None:
    """Return the robot's limits for hand guiding along a manifold, if the tool is guided."""
    parameters, stiffness = compliance.limits, compliance.tangential.stiffness
    guided = bool(stiffness.at) or np.isfinite(stiffness.value)
    if not (guided and parameters.on and isinstance(manifold, PathManifold | SurfaceManifold)):
        return None
    limits = RobotLimits(
        robot,
        parameters,
        start,
        oriented=manifold.is_oriented,
        tool_axis=manifold.tool.tool_axis,
        yaw_axis=manifold.tool.yaw_axis,
    )
    return GuidedMotion(limits, manifold, period)


def _add_limits(
    builder: DiagramBuilder,
    limits: GuidedMotion,
    impedance: BlockSystem,
    ports: dict[str, OutputPort],
) -> OutputPort:
    """Limit the filter to the speed of the robot; return the forces against the operator."""
    system = builder.AddNamedSystem("motion_limits", BlockSystem(limits, impedance.period))
    sources = {"desired_speed": impedance.GetOutputPort("desired_speed")}
    sources |= {name: ports[name] for name in ("joint_state", "manifold_point")}
    for name, port in sources.items():
        builder.Connect(port, system.GetInputPort(name))
    builder.Connect(system.GetOutputPort("allowed_speed"), impedance.GetInputPort("allowed_speed"))
    return system.GetOutputPort("limit_force")


def _add_tuner(
    builder: DiagramBuilder,
    tuning: TuningParameters,
    coordinates: Sequence[Coordinate],
    law: ImpedanceLaw,
    impedance: BlockSystem,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Let an operator change the impedance; return the present impedance and its energy tank."""
    initial = _impedance_at_origin(law)
    # rigid coordinates have no mass of their own
    soft = np.isfinite(initial[STIFFNESS])
    along = initial[MASS, indices(coordinates, Kind.TANGENTIAL)].max()
    masses = np.where(soft, initial[MASS], along)
    masses[indices(coordinates, Kind.ROTATIONAL)] = initial[
        MASS, indices(coordinates, Kind.ROTATIONAL)
    ]
    block = ImpedanceTuner(tuning, law, coordinates, masses)
    sources = {
        "request": ports["impedance_request"],
        "manifold_state": ports["manifold_state"],
        "reference": impedance.GetOutputPort("reference"),
        "desired_reference": ports["desired_reference"],
    }
    tuner = builder.AddNamedSystem("impedance_tuner", BlockSystem(block, law.period))
    for name, port in sources.items():
        builder.Connect(port, tuner.GetInputPort(name))
    builder.Connect(tuner.GetOutputPort("impedance"), impedance.GetInputPort("impedance"))
    return {name: tuner.GetOutputPort(name) for name in ("impedance", "tank")}


def _add_press(
    builder: DiagramBuilder,
    compliance: ComplianceParameters,
    law: ImpedanceLaw,
    coordinates: Sequence[Coordinate],
    ports: dict[str, OutputPort],
    end: float,
) -> dict[str, OutputPort]:
    """Add :class:`Pressing`, if there is a force reference, and return its outputs."""
    press = compliance.press
    if press is None:
        return {}
    across = indices(coordinates, Kind.TRANSVERSAL)
    if across.stop - across.start != 1:
        raise InputError(
            "compliance.press: must be null unless controller.manifold is surface, which has one "
            "transversal coordinate"
        )
    mass, damping = _impedance_at_origin(law)[[MASS, DAMPING], across.start]
    if not damping > 0.0:
        raise InputError(
            f"compliance.transversal.damping = {damping:g}: must be positive where a tool presses, "
            "whose speed towards the workpiece is force / damping"
        )
    pressing = Pressing(
        press.over_time(end, stiffest=damping**2 / (4.0 * mass)),
        press.touching,
        across.start,
        len(coordinates),
        ports["reference"].size(),
        law.period,
        press.allowed_difference,
        press.retreat_begin(end),
    )
    system = builder.AddNamedSystem("pressing", BlockSystem(pressing, law.period))
    for name, port in ports.items():
        builder.Connect(port, system.GetInputPort(name))
    signals = {name: system.GetOutputPort(name) for name in ("press", "pressed_force")}
    return signals | {"press_lost": system.GetOutputPort("lost")}


def _impedance_at_origin(law: ImpedanceLaw) -> np.ndarray:
    """Return masses, dampings and stiffnesses where all coordinates are zero, shape (3, m)."""
    found: np.ndarray = ca.DM(law.impedance(ca.DM.zeros(law.num_outputs))).full().reshape(3, -1)
    return found
