"""Coulomb and viscous friction of the joints."""

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    Diagram,
    DiagramBuilder,
    LeafSystem,
    OutputPort,
)
from pydrake.systems.primitives import (
    Adder,
    FirstOrderLowPassFilter,
    Gain,
    MatrixGain,
    Saturation,
)

from pfsc_drake.physics.friction import BristleFriction, FrictionDrift


class JointFriction(Diagram):
    """Friction torques (2.34), (2.41) beside the drive torques.

    ``tau_f = f_c sat(s + tau v / delta) + f_v v`` with the
    deflection s of the bristles as state; see :class:`BristleFriction` for the law and
    for what sticking means. For elastic joints the velocity is that of the motors and
    ``tau_f`` is ``tau_fM`` of (2.65b), for rigid joints it is that of the joints.

    Drives are limited in ``tau_d``, not in ``tau_d - tau_f``: connect ``resistance`` to the
    plant's generalized forces (through the transpose of the rows that give ``velocity`` from
    the plant's velocities), beside its actuation.

    With a continuous plant, integrate at the step the bristles were made for
    (:func:`~pfsc_drake.physics.friction.bristles_for_step`) or with error control. With a
    discrete plant s is integrated between its ticks; choose the bristles accordingly.

    Ports:
        velocity (input): ``v`` [rad/s or m/s], shape (N,), or what it is rows of, shape (M,).
        friction_torque (output): ``tau_f`` [Nm or N], shape (N,).
        resistance (output): ``-tau_f``, the generalized force on the joints, shape (N,).

    State:
        Continuous: deflection ``s`` in [-1, 1] of each joint's bristles, shape (N,);
        0 by default, see :meth:`set_load`.

    Args:
        friction: The law with its parameters, N joints.
        drift: How all of ``tau_f`` changes with time, if it does.
        rows: ``v`` is these times the input, shape (N, M); the input itself by default.

    Attributes:
        law: The law with its parameters, N joints.
    """

    def __init__(
        self,
        friction: BristleFriction,
        drift: FrictionDrift | None = None,
        rows: np.ndarray | None = None,
    ) -> None:
        super().__init__()
        self.law, self._drift = friction, drift
        n = friction.dimension
        rows = np.eye(n) if rows is None else rows
        builder = DiagramBuilder()

        def added(name: str, system: LeafSystem, *sources: OutputPort) -> OutputPort:
            builder.AddNamedSystem(name, system)
            for k, source in enumerate(sources):
                builder.Connect(source, system.get_input_port(k))
            return system.get_output_port()

        # (sat(s + tau v / delta) - s) / tau is what a low pass does with sat(s + tau v / delta)
        bristles = FirstOrderLowPassFilter(time_constants=friction.relaxation)
        tips = MatrixGain((friction.relaxation / friction.presliding)[:, None] * rows)
        # with the sign of the resistance, which is read more often than the friction
        viscous = MatrixGain(-friction.viscous[:, None] * rows)
        s = added("deflection", bristles)
        sum_ = added("undeflected", Adder(2, n), s, added("tips", tips))
        bent = added("limit", Saturation(np.full(n, -1.0), np.ones(n)), sum_)
        builder.Connect(bent, bristles.get_input_port())
        dry = added("dry", Gain(k=-friction.coulomb), bent)
        resistance = added("sum", Adder(2, n), dry, added("viscous", viscous))
        if drift is not None:
            resistance = added("drift", _Drifting(n, drift), resistance)
        # as a matrix, for a sum does not end as -0
        torque = added("sign", MatrixGain(-np.eye(n)), resistance)
        builder.ExportInput(tips.get_input_port(), "velocity")
        builder.ConnectInput("velocity", viscous.get_input_port())
        builder.ExportOutput(torque, "friction_torque")
        builder.ExportOutput(resistance, "resistance")
        builder.BuildInto(self)

    def coefficients(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return f_c [Nm or N] and f_v [Nm s/rad or N s/m] over time, each (samples, N).

        Args:
            times: Shape (samples,) [s].
        """
        scale = np.ones(len(times)) if self._drift is None else self._drift.scale(times)
        return np.outer(scale, self.law.coulomb), np.outer(scale, self.law.viscous)

    def set_load(self, context: Context, torque: np.ndarray) -> None:
        """Let friction carry a load from the start, as in a joint that has been stuck.

        Args:
            context: Context of this system.
            torque: ``tau_f`` at rest [Nm or N], shape (N,); limited to ``f_c``.
        """
        context.SetContinuousState(self.law.deflection(torque))


class _Drifting(LeafSystem):
    """A torque times what friction is in units of that at the start."""

    def __init__(self, size: int, drift: FrictionDrift) -> None:
        super().__init__()
        self._drift = drift
        self._torque = self.DeclareVectorInputPort("torque", size)
        self.DeclareVectorOutputPort(
            "scaled",
            size,
            self._calc,
            prerequisites_of_calc={self._torque.ticket(), self.time_ticket()},
        )

    def _calc(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._drift.scale(context.get_time()) * self._torque.Eval(context))
