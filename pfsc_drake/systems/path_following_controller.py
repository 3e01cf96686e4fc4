"""The path following law as a Drake system."""

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import (
    BasicVector,
    CacheEntry,
    Context,
    DiscreteValues,
    LeafSystem,
    ValueProducer,
)

from pfsc_drake.control.path_law import Fault, LawOutput, PathLaw


class PathFollowingController(LeafSystem):
    """Exact linearization and stabilization along a path, see :class:`PathLaw`.

    With ``yhat = (eta, xi_1, xi_2[, phi])`` and relative degree r the closed loop is
    ``e^(r) + a_r e^(r-1) + ... + a_1 e + a_0 int e = 0``, ``e = yhat - yhat_p``.

    After a fault (:class:`Fault`) the drives hold the links against gravity and
    brake; only a new initialization leaves that state.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        path_point (input): From :class:`PathProjector`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,).
        drive (output): Drive torques within their limits [Nm], shape (N,); for
            velocity servos the reference velocities [rad/s].
        manifold_state (output): Derivatives 0..r-1 of ``yhat`` by rows, shape (r m,).
        virtual_input (output): ``v``, shape (m,).
        status (output): ``[fault, rcond, saturated drives]``, shape (3,).

    State:
        Discrete: integral of the error, shape (m,); latched fault, shape (1,);
        last state without fault, shape (4N,); part of the drive input that is
        extrapolated over the hold, shape (N,).

    Args:
        law: The law.
        period: Sampling time [s].
    """

    def __init__(self, law: PathLaw, period: float) -> None:
        super().__init__()
        self._law, self._period = law, period
        linearization = law.linearization
        n, m, r = (
            linearization.num_joints,
            linearization.num_outputs,
            linearization.relative_degree,
        )
        self._num_outputs = m
        self._integral = self.DeclareDiscreteState(m)
        self._latched = self.DeclareDiscreteState(1)
        self._last_good = self.DeclareDiscreteState(4 * n)
        self._held = self.DeclareDiscreteState(np.full(n, np.nan))
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._path_point = self.DeclareVectorInputPort("path_point", linearization.layout.size)
        self._reference = self.DeclareVectorInputPort("reference", (r + 1) * m)
        self._output: CacheEntry = self.DeclareCacheEntry(
            "law output",
            ValueProducer(allocate=_allocate, calc=self._calc_law),
            {
                self._joint_state.ticket(),
                self._path_point.ticket(),
                self._reference.ticket(),
                self.discrete_state_ticket(self._integral),
                self.discrete_state_ticket(self._latched),
                self.discrete_state_ticket(self._held),
            },
        )
        ticket = {self._output.ticket()}
        self.DeclareVectorOutputPort("drive", n, self._calc_drive, prerequisites_of_calc=ticket)
        self.DeclareVectorOutputPort(
            "manifold_state", r * m, self._calc_manifold_state, prerequisites_of_calc=ticket
        )
        self.DeclareVectorOutputPort(
            "virtual_input", m, self._calc_virtual_input, prerequisites_of_calc=ticket
        )
        self.DeclareVectorOutputPort("status", 3, self._calc_status, prerequisites_of_calc=ticket)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def fault(self, context: Context) -> Fault:
        """Return the fault that holds at the present instant."""
        return self._evaluate(context).fault

    def _evaluate(self, context: Context) -> LawOutput:
        return self._output.EvalAbstract(context).get_value()

    def _calc_law(self, context: Context, value: AbstractValue) -> None:
        state = self._joint_state.Eval(context)
        result = self._law.evaluate(
            state,
            self._path_point.Eval(context),
            self._reference.Eval(context),
            context.get_discrete_state(self._integral).value(),
            context.get_discrete_state(self._held).value(),
        )
        latched = context.get_discrete_state(self._latched).GetAtIndex(0)
        if latched or result.fault:
            last_good = context.get_discrete_state(self._last_good).value()
            result = result._replace(
                drive=self._law.safe_drive(state, last_good), fault=Fault(latched or result.fault)
            )
        value.set_value(result)

    def _calc_drive(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._evaluate(context).drive)

    def _calc_manifold_state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._evaluate(context).Y.ravel())

    def _calc_virtual_input(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._evaluate(context).v)

    def _calc_status(self, context: Context, output: BasicVector) -> None:
        result = self._evaluate(context)
        output.SetFromVector([float(result.fault), result.rcond, float(result.saturated)])

    def _update(self, context: Context, state: DiscreteValues) -> None:
        result = self._evaluate(context)
        if result.fault:
            state.set_value(self._latched, [float(result.fault)])
            return
        state.set_value(self._last_good, self._joint_state.Eval(context))
        state.set_value(self._held, result.held)
        if self._law.stabilization.has_integral_part:
            error = result.Y[0] - self._reference.Eval(context)[: self._num_outputs]
            integral = context.get_discrete_state(self._integral).value()
            state.set_value(self._integral, integral + self._period * error)


def _allocate() -> AbstractValue:
    return Value(object())
