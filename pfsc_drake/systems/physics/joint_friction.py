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

    ``tau_f = f_c sat(s + tau v / delta) + f_v v`` with the deflection s of the bristles as state;
    see :class:`BristleFriction` for the law and for sticking. For elastic joints ``v`` is the
    velocity of the motors and ``tau_f`` is ``tau_fM`` of (2.65b), for rigid joints the velocity of
    the joints.

    Drives are limited in ``tau_d``, not in ``tau_d - tau_f``: connect ``resistance`` to the plant's
    generalized forces (through the transpose of the rows from the plant's velocities to
    ``velocity``), beside its actuation.

    With a continuous plant, integrate at the step for which the bristles were designed
    (:func:`~pfsc_drake.physics.friction.bristles_for_step`) or with error control. With a discrete
    plant s is integrated between its ticks; choose the bristles accordingly.

    Ports:
        velocity (input): ``v`` [rad/s or m/s], shape (N,), or a vector of shape (M,), see ``rows``.
        friction_torque (output): ``tau_f`` [Nm or N], shape (N,).
        resistance (output): ``-tau_f``, the generalized force on the joints, shape (N,).

    State:
        Continuous: deflection ``s`` in [-1, 1] of each joint's bristles, shape (N,);
        0 by default, see :meth:`set_load`.

    Args:
        friction: The law with its parameters, N joints.
        drift: Change of all of ``tau_f`` with time, if any.
        rows: ``v`` is this matrix times the input, shape (N, M); the input itself by default.

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

        def add(name: str, system: LeafSystem, *sources: OutputPort) -> OutputPort:
            builder.AddNamedSystem(name, system)
            for k, source in enumerate(sources):
                builder.Connect(source, system.get_input_port(k))
            return system.get_output_port()

        # (sat(s + tau v / delta) - s) / tau is the rate of a low pass of sat(s + tau v / delta)
        bristles = FirstOrderLowPassFilter(time_constants=friction.relaxation)
        tips = MatrixGain((friction.relaxation / friction.presliding)[:, None] * rows)
        # with the sign of the resistance, which is read more often than the friction
        viscous = MatrixGain(-friction.viscous[:, None] * rows)
        s = add("deflection", bristles)
        sum_ = add("undeflected", Adder(2, n), s, add("tips", tips))
        bent = add("limit", Saturation(np.full(n, -1.0), np.ones(n)), sum_)
        builder.Connect(bent, bristles.get_input_port())
        dry = add("dry", Gain(k=-friction.coulomb), bent)
        resistance = add("sum", Adder(2, n), dry, add("viscous", viscous))
        if drift is not None:
            resistance = add("drift", _Drifting(n, drift), resistance)
        # a matrix, because a sum does not end as -0
        torque = add("sign", MatrixGain(-np.eye(n)), resistance)
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
        """Set friction to the torque of a static load, as in a joint that has been stuck.

        Args:
            context: Context of this system.
            torque: ``tau_f`` at rest [Nm or N], shape (N,); limited to ``f_c``.
        """
        context.SetContinuousState(self.law.deflection(torque))


class _Drifting(LeafSystem):
    """A torque times the ratio of friction to its value at the start."""

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
