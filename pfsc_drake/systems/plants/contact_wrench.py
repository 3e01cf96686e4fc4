"""What the environment does to a body, from a plant's contact results."""

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class ContactWrench(LeafSystem):
    """Sums the hydroelastic contact forces on one body.

    Ports:
        contact_results (input): Of the plant, abstract.
        tool_pose (input): ``[y_t, R_e]``, shape (12,); the torque is about ``y_t``.
        wrench (output): ``[force, torque]`` on the body, world axes, shape (6,) [N, Nm].

    Args:
        geometries: Contact geometries of the body.
    """

    def __init__(self, geometries: list[GeometryId]) -> None:
        super().__init__()
        self._geometries = frozenset(geometries)
        self._results = self.DeclareAbstractInputPort("contact_results", Value[ContactResults]())
        self._pose = self.DeclareVectorInputPort("tool_pose", 12)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self._results.ticket(), self._pose.ticket()},
        )

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        results, y_t = self._results.Eval(context), self._pose.Eval(context)[:3]
        wrench = np.zeros(6)
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface, F_Ac_W = info.contact_surface(), info.F_Ac_W()
            on_M, on_N = surface.id_M() in self._geometries, surface.id_N() in self._geometries
            # F_Ac_W acts on the body of M, the opposite on that of N
            sign = float(on_M) - float(on_N)
            force = sign * F_Ac_W.translational()
            wrench[:3] += force
            wrench[3:] += sign * F_Ac_W.rotational() + np.cross(surface.centroid() - y_t, force)
        output.SetFromVector(wrench)
