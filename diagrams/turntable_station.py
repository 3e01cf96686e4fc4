"""The turntable of a station that carries the workpiece."""

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import casadi as ca
import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario.turntable import TurntableParameters
from pfsc_drake.checks import require_whole_ticks
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.turntable import TurntableAxes, turntable_motion_function
from pfsc_drake.controller.carrier import Derivatives, TurntableMotion, delay_curve
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.physics.turntable import TurntableDrive
from pfsc_drake.systems.block_system import BlockSystem

# beginning of the names of all systems and signals of the turntable
TURNTABLE = "turntable_"
# s, between the samples of the planned motion; ticks by which angles may be late
_STEP, _MOST_TICKS = 4e-3, 100


@dataclass
class Turntable:
    """A turntable that carries the workpiece.

    Attributes:
        parameters: Its parameters in the scenario.
    """

    parameters: TurntableParameters

    @cached_property
    def command(self) -> PiecewisePolynomialCurve:
        """Commanded angles of all axes over time [rad]."""
        return turntable_command(self.parameters)

    @property
    def _nominal(self) -> TurntableAxes:
        return turntable_axes(self.parameters, self.parameters.placement_error.transform())

    @property
    def frame(self) -> np.ndarray:
        """Nominal pose of the workpiece at the start, ``[p_WC, R_WC by rows]``, shape (12,)."""
        begin = self.command.derivatives(0.0, 0)[0]
        return np.array(turntable_motion_function(self._nominal, 0)(begin)).ravel()

    @cached_property
    def motion(self) -> ca.Function:
        """Function of the actual angles and rates to the actual frame and its rate."""
        return turntable_motion_function(turntable_axes(self.parameters, RigidTransform()), 1)

    @property
    def known_motion(self) -> TurntableMotion:
        """Motion of the workpiece in the model of the robot's controller."""
        table = self.parameters
        delay = table.delay if table.nominal_delay is None else table.nominal_delay
        derivatives = cast(Derivatives, table.derivatives)
        return TurntableMotion(self._nominal, self.command, delay, derivatives, table.highest)

    @cached_property
    def planned(self) -> PiecewisePolynomialCurve:
        """Planned motion of the workpiece over time."""
        command, poses = self.command, turntable_motion_function(self._nominal, 0)
        times = np.linspace(*command.domain, int(np.ceil(command.domain[1] / _STEP)) + 1)
        angles = command.derivatives(times, 0)[:, 0]
        values = np.array(poses.map(len(times))(angles.T)).T
        return PiecewisePolynomialCurve.between_rests(times, values)

    def add(self, builder: DiagramBuilder, period: float) -> dict[str, OutputPort]:
        """Add its drives and encoders.

        Args:
            builder: Builder of the diagram.
            period: Sampling time [s].

        Returns:
            ``turntable_motion``, actual angles and rates, and ``table_angles``, measured.

        Raises:
            InputError: If the table has no axes or stops, or a delay is no whole number of periods.
        """
        table, n = self.parameters, len(self.parameters.axes)
        ticks = require_whole_ticks("turntable.delay", table.delay, period, _MOST_TICKS)
        timed = TimedReference(delay_curve(self.command, table.lag), 1, n, period)
        followed = builder.AddNamedSystem(f"{TURNTABLE}followed", BlockSystem(timed, period))
        block = TurntableDrive(n, table.increments, ticks)
        drive = builder.AddNamedSystem(f"{TURNTABLE}drive", BlockSystem(block, period))
        builder.Connect(followed.GetOutputPort("reference"), drive.GetInputPort("followed"))
        return {
            f"{TURNTABLE}motion": drive.GetOutputPort("motion"),
            "table_angles": drive.GetOutputPort("measured"),
        }


def turntable_axes(parameters: TurntableParameters, shift: RigidTransform) -> TurntableAxes:
    """Return a turntable's axes and its workpiece.

    Args:
        parameters: The turntable.
        shift: Pose error of its base, in its own axes.
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
    distances = np.abs(np.diff(stops, axis=0)).max(axis=1)
    travel = np.concatenate([[0.0], np.cumsum(distances)])
    along = rest_to_rest(
        travel.tolist(),
        velocity=np.deg2rad(parameters.velocity_deg),
        acceleration=np.deg2rad(parameters.acceleration_deg),
        dwell=parameters.dwell,
    )
    middle = 0.5 * (along.breakpoints[1:] + along.breakpoints[:-1])
    reached = along.derivatives(middle, 0)[:, 0, 0]
    move = np.clip(np.searchsorted(travel, reached, side="right") - 1, 0, len(distances) - 1)
    slopes = np.diff(stops, axis=0)[move] / distances[move, None]
    table = along.coefficients * slopes[:, None, :]
    table[:, 0] += stops[move] - slopes * travel[move, None]
    return PiecewisePolynomialCurve(
        along.breakpoints, table, known_smoothness=int(min(along.smoothness, table.shape[1]))
    )


def _pose(X: RigidTransform) -> np.ndarray:
    return np.append(X.translation(), X.rotation().matrix().ravel())
