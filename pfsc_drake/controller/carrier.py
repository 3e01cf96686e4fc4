"""Motion of a workpiece on a robot or a turntable, for another controller."""

from typing import Literal

import numpy as np

from pfsc_drake.control.estimation.reaction import Reaction
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.frame_motion import DifferencedFrame, FlangeFrame, PlannedFrame
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE
from pfsc_drake.control.manifolds.turntable import AdvancedFrame, TurntableAxes, TurntableFrame
from pfsc_drake.controller.extension import Extension, OpenController
from pfsc_drake.geometry import PiecewisePolynomialCurve

# sources of the derivatives of a frame's motion
Derivatives = Literal["known", "differenced", "planned"]


class WorkpieceFrame(Extension):
    """Motion of the workpiece that a robot holds, for the controller of another one.

    Ports:
        frame_jet (output): Derivatives 0..order of ``[p_WC, R_WC by rows]``.

    Args:
        order: Highest derivative.
        derivatives: Source of the derivatives: the joint motion by the law, differences of the
            measured pose, or the plan.
        highest: Highest derivative that is known; the others are zero.
        placement: Nominal pose of the base relative to the model's, ``[p, R by rows]``, (12,).
    """

    def __init__(
        self,
        order: int,
        derivatives: Derivatives,
        highest: int,
        placement: np.ndarray,
    ) -> None:
        self._order, self._derivatives, self._highest = order, derivatives, highest
        self._placement = placement

    def after_law(self, assembly: OpenController) -> None:
        """Add the frame's motion."""
        law, order, highest = assembly.law, self._order, self._highest
        known = min(order, highest) if self._derivatives == "known" else 0
        degree = law.linearization.relative_degree
        flange = FlangeFrame(law.robot, degree, order, self._placement, known)
        jet = assembly.signals["joint_jet"]
        frame = assembly.add("flange_frame", flange, joint_jet=jet).GetOutputPort("frame_jet")
        if self._derivatives == "differenced":
            block = DifferencedFrame(order, highest, assembly.period)
            guess = assembly.add("differenced_frame", block, frame_jet=frame)
            frame = guess.GetOutputPort("differenced")
        elif self._derivatives == "planned":
            plan = assembly.planned_frame(self._placement)
            timed = TimedReference(plan, order, POSE_SIZE, assembly.period)
            planned = assembly.add("planned_motion", timed).GetOutputPort("reference")
            known_pose = PlannedFrame(order, highest)
            mix = assembly.add("planned_frame", known_pose, frame_jet=frame, planned=planned)
            frame = mix.GetOutputPort("mixed")
        assembly.show(frame_jet=frame)
        assembly.public.append("frame_jet")


class MeasuredReaction(Extension):
    """Force on the workpiece that a robot holds, as the sensor of the other robot measures it.

    Ports:
        tool_wrench (input): Measured on the tool at the tool point, world axes, shape (6,) [N, Nm].
        tool_pose (input): ``[y_t, R_e by rows]`` of that tool in the world, shape (12,) [m, 1].
    """

    measures = True

    def before_law(self, assembly: OpenController) -> None:
        """Add the reaction."""
        reaction = assembly.add(
            "measured_reaction",
            Reaction(),
            wrench=assembly.open("tool_wrench", 6),
            tool_pose=assembly.open("tool_pose", POSE_SIZE),
            workpiece_pose=assembly.signals["tool_pose"],
        )
        assembly.show(wrench_measured=reaction.GetOutputPort("reaction"))


class TurntableMotion(Extension):
    """Motion of the workpiece on a turntable, from measured angles and the command.

    Ports:
        table_angles (input): Measured angles of its axes, shape (N,) [rad].

    Args:
        axes: Nominal axes and workpiece.
        command: Commanded angles of all axes over time [rad].
        delay: Nominal age of the measurement [s].
        derivatives: Source of the derivatives: the command, or differences of the measured angles.
        highest: Highest derivative that is known; the others are zero.
    """

    def __init__(
        self,
        axes: TurntableAxes,
        command: PiecewisePolynomialCurve,
        delay: float,
        derivatives: Derivatives,
        highest: int,
    ) -> None:
        self._axes, self._command, self._delay = axes, command, delay
        self._derivatives, self._highest = derivatives, highest

    def before_projection(self, assembly: OpenController) -> None:
        """Add the frame's motion."""
        order, period = assembly.task.manifold.layout.order, assembly.period
        n, known = len(self._axes.directions), self._highest * (self._derivatives == "known")
        table = TurntableFrame(self._axes, order, known)
        sources = {"measured": assembly.open("table_angles", n)}
        if known:
            command = TimedReference(delay_curve(self._command, self._delay), order, n, period)
            sources["planned"] = assembly.add("table_command", command).GetOutputPort("reference")
        frame = assembly.add("table_frame", table, **sources).GetOutputPort("frame_jet")
        if self._derivatives == "differenced":
            block = DifferencedFrame(order, self._highest, period)
            guess = assembly.add("differenced_frame", block, frame_jet=frame)
            frame = guess.GetOutputPort("differenced")
        if self._delay > 0.0:
            now = assembly.add("advanced_frame", AdvancedFrame(order, self._delay), frame_jet=frame)
            frame = now.GetOutputPort("advanced")
        assembly.show(frame_jet=frame)


def delay_curve(curve: PiecewisePolynomialCurve, delay: float) -> PiecewisePolynomialCurve:
    """Return a delayed curve of time.

    Args:
        curve: The curve.
        delay: Delay [s].
    """
    smooth = int(min(curve.smoothness, curve.degree))
    return PiecewisePolynomialCurve(
        curve.breakpoints + delay, curve.coefficients, known_smoothness=smooth
    )
