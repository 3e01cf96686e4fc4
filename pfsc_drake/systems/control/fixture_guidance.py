"""Guidance by hand with virtual fixtures, as a system."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    EventStatus,
    LeafSystem,
    State,
)

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.fixtures.guidance import GuidanceStep
from pfsc_drake.control.fixtures.labels import Mode
from pfsc_drake.control.fixtures.lead import Lead
from pfsc_drake.control.fixtures.program import NearRegion
from pfsc_drake.control.fixtures.record import GuidanceRecord
from pfsc_drake.control.fixtures.robot_limits import RobotLimits
from pfsc_drake.control.fixtures.vectors import Vector
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function
from pfsc_drake.systems.optional_input import value_or_none

_STILL = (0.0, 0.0, 0.0)


class Guidance(Protocol):
    """Rules that lead a tool, e.g. :class:`ProgramGuidance`."""

    @property
    def lead(self) -> Lead:
        """What is between the asked velocity and the tool."""

    def start(self, y: Vector) -> Any:
        """Return the memory of a tool at rest at y [m]."""

    def step(
        self,
        memory: Any,
        y: Sequence[float],
        velocity: Sequence[float],
        force: Vector,
        active: Sequence[float] | None = None,
        damping: float | None = None,
        limits: Sequence[NearRegion] = (),
    ) -> GuidanceStep:
        """Return what to do at a tick."""


class _Known(NamedTuple):
    """What a tick goes by: memory of the rules (None before the first), last force, readiness."""

    memory: Any = None
    force: Vector = _STILL
    ready: bool = False


class _Kept(NamedTuple):
    """What was known before the last tick, at a time [s], and what is since; never changed."""

    time: float = -math.inf
    before: _Known = _Known()
    after: _Known = _Known()

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Kept":
        """Return itself, so that a simulation's copies of its state cost nothing."""
        return self


class FixtureGuidance(LeafSystem):
    """Leads the tool where a hand pulls it, and nowhere that it must not go, see `Guidance`.

    A force moves the reference after one period, as in :class:`ImpedanceFilter`; where the tool
    is counts at once. So there is no algebraic loop through drives and force sensor. An abstract
    state is updated before the discrete ones of a tick; so the outputs stay what they were until
    time goes on, and whoever is sampled at a tick sees the same.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).
        wrench (input): ``[force, torque]`` of the hand on the tool, world axes, shape (6,).
        ready (input): Until it first rises above 0.5, forces count as zero, shape (1,).
        active (input, optional): Which regions are switched on, above 0.5, shape (M,); all of them
            if not connected.
        damping (input, optional): Of the free motion, shape (1,) [N s/m]; that of the rules where
            it is negative, or not connected.
        reference (output): Derivatives 0..p of the reference by rows, shape ((p + 1) m,), of which
            only the first three columns, those of the tool point, are not zero.
        mode (output): A :class:`~pfsc_drake.control.fixtures.labels.Mode`, shape (1,).
        record (output): What there is to log, laid out by ``layout``.

    A force that is not finite counts as zero; that the robot stops then is the affair of whoever
    measures it.

    State:
        Abstract: memory of the rules, None before the first tick, the force of the last tick [N]
        and whether ready; with the time of the last tick, and what they were before it.

    Args:
        guidance: The rules.
        robot: The robot as it is believed, N joints.
        order: p, highest derivative of the reference.
        num_outputs: m.
        layout: Of the record.
        period: Sampling time [s].
        limits: What the robot can do; if omitted, nothing limits what is asked of it.
    """

    def __init__(
        self,
        guidance: Guidance,
        robot: RobotModel,
        order: int,
        num_outputs: int,
        layout: GuidanceRecord,
        period: float,
        limits: RobotLimits | None = None,
    ) -> None:
        super().__init__()
        self._limits = limits
        self._guidance, self._order, self.layout = guidance, order, layout
        self._num_outputs, self._n = num_outputs, robot.dimension
        kept = self.abstract_state_ticket(self.DeclareAbstractState(Value(_Kept())))
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * self._n)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._ready = self.DeclareVectorInputPort("ready", 1)
        self._active = self.DeclareVectorInputPort("active", layout.num_regions)
        self._damping = self.DeclareVectorInputPort("damping", 1)
        inputs = (self._joint_state, self._active, self._damping)
        sources = {*(port.ticket() for port in inputs), kept, self.time_ticket()}
        self._step = self.DeclareAbstractOutputPort(
            "step", lambda: Value(None), self._calc_step, prerequisites_of_calc=sources
        )
        # written at every evaluation
        self._reference = np.zeros((order + 1) * num_outputs)
        self._of_tool = self._reference.reshape(order + 1, num_outputs)[:, :3]
        self.DeclareVectorOutputPort(
            "reference", self._reference.size, self._calc_reference, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "record", layout.size, self._calc_record, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort("mode", 1, self._calc_mode, prerequisites_of_calc=sources)
        self.DeclareInitializationUnrestrictedUpdateEvent(self._initialize)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)
        function = BoundFunction(tool_motion_function(robot))
        self._q, self._v = function.arguments["q"], function.arguments["v"]
        self._motion, self._evaluate = function.results["motion"], function.evaluate

    @property
    def lag(self) -> float:
        """How much later the tool is where the rules see it [s]."""
        return self._guidance.lead.lag

    def set_place(self, context: Context, y_t: np.ndarray) -> None:
        """Let the tool have rested at a place until now.

        Args:
            context: The system's own.
            y_t: Tool point [m], shape (3,).
        """
        x, y, z = y_t.tolist()
        known = self._known(context)._replace(memory=self._guidance.start((x, y, z)))
        context.SetAbstractState(0, _Kept(after=known))

    def _known(self, context: Context) -> _Known:
        """Return what the outputs go by now."""
        kept: _Kept = context.get_abstract_state(0).get_value()
        return kept.before if context.get_time() <= kept.time else kept.after

    def _tool(self, context: Context) -> list[float]:
        """Return ``[y_t, y_t']`` as measured."""
        state = self._joint_state.Eval(context)
        self._q[:], self._v[:] = state[: self._n], state[self._n : 2 * self._n]
        self._evaluate()
        motion: list[float] = self._motion.tolist()
        return motion[:3] + motion[12:15]

    def _calc_step(self, context: Context, output: AbstractValue) -> None:
        motion, (memory, force, ready) = self._tool(context), self._known(context)
        if not math.isfinite(sum(motion)):  # the law stops the robot
            output.set_value((None, motion))
            return
        if memory is None:
            memory = self._guidance.start((motion[0], motion[1], motion[2]))
        asked = value_or_none(self._damping, context)
        damping = asked.item() if asked is not None and asked.item() >= 0.0 else None
        step = self._guidance.step(
            memory,
            motion[:3],
            motion[3:],
            force if ready else _STILL,
            self._switches(context),
            damping,
            self._of_robot(),
        )
        output.set_value((step, motion))

    def _of_robot(self) -> Sequence[NearRegion]:
        """Return what the robot can do, in the state that was looked at last."""
        if self._limits is None:
            return ()
        return self._limits.rows(self._q, self._v, self.layout.num_regions)

    def _calc_reference(self, context: Context, output: BasicVector) -> None:
        step, motion = self._step.Eval(context)
        self._of_tool[:] = 0.0
        self._of_tool[0] = motion[:3]
        if step is not None:
            self._of_tool[:] = self._guidance.lead.reference(
                step.lead, motion[:3], step.velocity, self._order
            )
        output.SetFromVector(self._reference)

    def _calc_mode(self, context: Context, output: BasicVector) -> None:
        step, _ = self._step.Eval(context)
        output.SetFromVector([Mode.FREE if step is None else step.mode])

    def _calc_record(self, context: Context, output: BasicVector) -> None:
        step, _ = self._step.Eval(context)
        force = self._known(context).force
        output.SetFromVector(self.layout.row(step, force, self._switches(context)))

    def _switches(self, context: Context) -> list[float] | None:
        """Return which regions are switched on, None for all of them."""
        active = value_or_none(self._active, context)
        return None if active is None else active.tolist()

    def _initialize(self, context: Context, state: State) -> EventStatus:
        state.get_mutable_abstract_state(0).set_value(_Kept())
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: State) -> None:
        (step, _), before = self._step.Eval(context), self._known(context)
        f_x, f_y, f_z = self._wrench.Eval(context)[:3].tolist()
        known = math.isfinite(f_x + f_y + f_z)
        after = _Known(
            before.memory if step is None else step.memory,
            (f_x, f_y, f_z) if known else _STILL,
            before.ready or bool(self._ready.Eval(context)[0] > 0.5),
        )
        state.get_mutable_abstract_state(0).set_value(_Kept(context.get_time(), before, after))
