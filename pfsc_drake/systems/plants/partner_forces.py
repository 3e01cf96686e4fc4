"""What several partners do to bodies that touch them, from a plant's contact results."""

from collections.abc import Collection, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class PartnerForces(LeafSystem):
    """Sums the point contact forces of each of K partners on whatever touches it.

    Ports:
        contact_results (input): Of the plant, abstract.
        forces (output): Forces by the partners one after the other, world axes, shape (3 K,) [N].

    Args:
        partners: Contact geometries of each partner; no two partners touch each other.
    """

    def __init__(self, partners: Sequence[Collection[GeometryId]]) -> None:
        super().__init__()
        self._partners = {g: k for k, partner in enumerate(partners) for g in partner}
        self._size = len(partners)
        self._results = self.DeclareAbstractInputPort("contact_results", Value[ContactResults]())
        self.DeclareVectorOutputPort(
            "forces",
            3 * len(partners),
            self._calc_forces,
            prerequisites_of_calc={self._results.ticket()},
        )

    def _calc_forces(self, context: Context, output: BasicVector) -> None:
        results, forces = self._results.Eval(context), np.zeros((self._size, 3))
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair, force = info.point_pair(), info.contact_force()  # on B
            if pair.id_A in self._partners:
                forces[self._partners[pair.id_A]] += force
            elif pair.id_B in self._partners:
                forces[self._partners[pair.id_B]] -= force
        output.SetFromVector(forces.ravel())
