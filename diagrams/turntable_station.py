"""The turntable of a station that carries the workpiece, and what it tells."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario.checks import require_whole_ticks
from diagrams.scenario.turntable import TurntableParameters
from diagrams.tasks.held_frame import HeldFrame
from pfsc_drake.blocks.block import Block
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.carried import DifferencedFrame
from pfsc_drake.control.manifolds.turntable import (
    AdvancedFrame,
    TurntableAxes,
    TurntableFrame,
    turntable_motion_function,
)
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.physics.turntable import TurntableDrive
from pfsc_drake.systems.block_system import BlockSystem

# before the names of all systems and signals of the turntable
TURNTABLE = "turntable_"
# s, between the samples of the planned motion; ticks by which angles may be late
_STEP, _MOST_TICKS = 4e-3, 100


@dataclass
class Turntable:
    """A turntable that carries the workpiece.

    Attributes:
        frame: The workpiece's frame, and its motion as the robot's controller knows it.
        plan: Returns its motion as it is planned, ``[p_WC, R_WC by rows]`` over time.
        motion: Function of the true angles and rates to the true frame and its rate.
        signals: What to log, by names with the prefix.
    """

    frame: HeldFrame
    plan: Callable[[], PiecewisePolynomialCurve]
    motion: ca.Function
    signals: dict[str, OutputPort]


def add_turntable(
    builder: DiagramBuilder, parameters: TurntableParameters, order: int, period: float
) -> Turntable:
    """Add a turntable, and what tells its motion to the robot's controller.

    Args:
        builder: Builder of the diagram.
        parameters: The turntable.
        order: Relative degree of the robot's law.
        period: Sampling time [s].

    Raises:
        InputError: If the table has no axes or stops, or a delay is no whole number of periods.
    """
    parameters.check()
    ticks = require_whole_ticks("turntable.delay", parameters.delay, period, _MOST_TICKS)
    n, command = len(parameters.axes), turntable_command(parameters)
    true = turntable_axes(parameters, RigidTransform())
    believed = turntable_axes(parameters, parameters.placement_error.transform())
    delay = parameters.delay
    if parameters.believed_delay is not None:
        delay = parameters.believed_delay

    def add(name: str, block: Block) -> BlockSystem:
        return builder.AddNamedSystem(f"{TURNTABLE}{name}", BlockSystem(block, period))

    followed = add("followed", TimedReference(_later(command, parameters.lag), 1, n, period))
    drive = add("drive", TurntableDrive(n, parameters.increments, ticks))
    builder.Connect(followed.GetOutputPort("reference"), drive.GetInputPort("followed"))
    highest = parameters.highest if parameters.derivatives == "known" else 0
    told = add("frame", TurntableFrame(believed, order, highest))
    builder.Connect(drive.GetOutputPort("measured"), told.GetInputPort("measured"))
    if highest:
        planned = add("command", TimedReference(_later(command, delay), order, n, period))
        builder.Connect(planned.GetOutputPort("reference"), told.GetInputPort("planned"))
    frame = told.GetOutputPort("frame_jet")
    if parameters.derivatives == "differenced":
        guess = add("differenced", DifferencedFrame(order, parameters.highest, period))
        builder.Connect(frame, guess.GetInputPort("frame_jet"))
        frame = guess.GetOutputPort("differenced")
    if delay > 0.0:
        now = add("advanced", AdvancedFrame(order, delay))
        builder.Connect(frame, now.GetInputPort("frame_jet"))
        frame = now.GetOutputPort("advanced")
    poses = turntable_motion_function(believed, 0)
    begin = command.derivatives(0.0, 0)[0]

    def plan() -> PiecewisePolynomialCurve:
        times = np.linspace(*command.domain, int(np.ceil(command.domain[1] / _STEP)) + 1)
        angles = command.derivatives(times, 0)[:, 0]
        values = np.array(poses.map(len(times))(angles.T)).T
        return PiecewisePolynomialCurve.between_rests(times, values)

    return Turntable(
        HeldFrame(np.array(poses(begin)).ravel(), order, frame),
        plan,
        turntable_motion_function(true, 1),
        {f"{TURNTABLE}motion": drive.GetOutputPort("motion"), f"{TURNTABLE}frame_jet": frame},
    )


def turntable_axes(parameters: TurntableParameters, shift: RigidTransform) -> TurntableAxes:
    """Return a turntable's axes and its workpiece.

    Args:
        parameters: The turntable.
        shift: Where it is taken to stand, in its own axes, beside where it stands.
    """
    directions = np.array([axis.direction for axis in parameters.axes])
    return TurntableAxes(
        _pose(parameters.base_pose.transform() @ shift),
        directions / np.linalg.norm(directions, axis=1)[:, None],
        np.array([axis.point for axis in parameters.axes]),
        _pose(parameters.workpiece.pose.transform()),
    )


def turntable_command(parameters: TurntableParameters) -> PiecewisePolynomialCurve:
    """Return the angles of all axes over time [rad], from rest to rest at every stop.

    Args:
        parameters: The turntable.
    """
    stops = np.deg2rad(parameters.stops_deg)
    ways = np.abs(np.diff(stops, axis=0)).max(axis=1)
    places = np.concatenate([[0.0], np.cumsum(ways)])
    along = rest_to_rest(
        places.tolist(),
        velocity=np.deg2rad(parameters.velocity_deg),
        acceleration=np.deg2rad(parameters.acceleration_deg),
        dwell=parameters.dwell,
    )
    middle = 0.5 * (along.breakpoints[1:] + along.breakpoints[:-1])
    reached = along.derivatives(middle, 0)[:, 0, 0]
    move = np.clip(np.searchsorted(places, reached, side="right") - 1, 0, len(ways) - 1)
    slopes = np.diff(stops, axis=0)[move] / ways[move, None]
    table = along.coefficients * slopes[:, None, :]
    table[:, 0] += stops[move] - slopes * places[move, None]
    return PiecewisePolynomialCurve(
        along.breakpoints, table, known_smoothness=int(min(along.smoothness, table.shape[1]))
    )


def _later(curve: PiecewisePolynomialCurve, delay: float) -> PiecewisePolynomialCurve:
    """Return a curve of time that comes later [s]."""
    smooth = int(min(curve.smoothness, curve.degree))
    return PiecewisePolynomialCurve(
        curve.breakpoints + delay, curve.coefficients, known_smoothness=smooth
    )


def _pose(X: RigidTransform) -> np.ndarray:
    return np.append(X.translation(), X.rotation().matrix().ravel())
