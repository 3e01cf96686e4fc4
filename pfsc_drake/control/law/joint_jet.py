"""Joint motion by the law: from the measured state and the commanded highest derivative."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.linear_algebra import solve
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.exact_linearization import Relation
from pfsc_drake.control.law.following_law import LawLayout
from pfsc_drake.control.law.linearization import Linearization


class JointJet(Block):
    """Joint coordinates with all derivatives up to the commanded one.

    Derivatives 0..r-1 follow from the measured state, see :mod:`actuation`. The r-th is commanded
    in this sample: the drive input contains ``varying_input = gain q^(r) + drift``, so that
    ``q^(r) = gain^-1 (varying_input - drift)``. The motion of a workpiece on the robot follows
    from it without a difference quotient.

    Ports:
        relation (input): Relation of drives and virtual output, from :class:`ExactLinearization`.
        evaluation (input): The law's result, laid out by its ``layout``.
        joint_jet (output): Derivatives 0..r by rows, shape ((r + 1) N,) [rad or m, per s, ..].

    Args:
        linearization: Linearization of the relation.
        layout: Layout of the law's result.
    """

    def __init__(self, linearization: Linearization, layout: LawLayout) -> None:
        self._linearization, self._layout = linearization, layout
        self._highest = _highest_derivative(linearization.num_joints)
        n, r = linearization.num_joints, linearization.relative_degree
        relation = Port(Relation.size(linearization))
        self.inputs = {"relation": relation, "evaluation": Port(layout.size)}
        self.outputs = {"joint_jet": Port(n * (r + 1), "rad or m, per s, ..")}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        relation = Relation.of(u.relation, self._linearization)
        varying_input = u.evaluation[self._layout.varying_input]
        top = self._highest(relation.gain, varying_input - relation.drift)
        return {"joint_jet": ca.vertcat(ca.vec(relation.motion), top)}


@once_per_content()
def _highest_derivative(n: int) -> ca.Function:
    """Return ``(gain, varying_input - drift) -> q^(r)``, shapes (n, n), (n,) and (n,)."""
    gain, rest = ca.SX.sym("gain", n, n), ca.SX.sym("rest", n)
    return ca.Function("highest_derivative", [gain, rest], [solve(gain, rest)[0]])
