"""Wrenches on bodies, applied to a plant."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, LeafSystem


class AppliedForces(LeafSystem):
    """Wrenches on bodies as a plant takes them.

    Ports:
        wrenches (input): ``[force, torque]`` on each of K bodies at its origin, world axes, shape
            (6 K,) [N, Nm].
        applied_spatial_force (output): For the port of that name of the plant, abstract.

    Args:
        bodies: The K bodies.
    """

    def __init__(self, bodies: list[BodyIndex]) -> None:
        super().__init__()
        self._applied = [ExternallyAppliedSpatialForce() for _ in bodies]
        for applied, body in zip(self._applied, bodies, strict=True):
            applied.body_index, applied.p_BoBq_B = body, np.zeros(3)
        self._wrenches = self.DeclareVectorInputPort("wrenches", 6 * len(bodies))
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc_applied,
            prerequisites_of_calc={self._wrenches.ticket()},
        )

    def _calc_applied(self, context: Context, output: Value) -> None:
        wrenches = self._wrenches.Eval(context).reshape(-1, 6)
        for applied, wrench in zip(self._applied, wrenches, strict=True):
            applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        # the value is a copy
        output.set_value(self._applied)
