"""Relation between drives and virtual output at a sample, the basis of the law."""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices


class Relation(NamedTuple):
    """Results of :class:`Linearization`'s function: ``yhat^(r) = A q^(r) + b``, and the drives.

    Attributes:
        Y: Derivatives 0..r-1 of the virtual output in columns, shape (m, r).
        A: Decoupling matrix, shape (m, N).
        b: Shape (m,).
        gain: Gain of the drives' ``u = gain q^(r) + drift + offset``, shape (N, N).
        drift: Shape (N,).
        offset: Shape (N,).
        motion: Derivatives 0..r-1 of the joint coordinates in columns, shape (N, r).
    """

    Y: Any
    A: Any
    b: Any
    gain: Any
    drift: Any
    offset: Any
    motion: Any

    @classmethod
    def size(cls, linearization: Linearization) -> int:
        """Return the number of all elements.

        Args:
            linearization: Linearization of the relation.
        """
        return sum(rows * columns for rows, columns in _shapes(linearization))

    @classmethod
    def of(cls, vector: Any, linearization: Linearization) -> "Relation":
        """Return the parts of a vector, in which matrices lie by columns.

        Args:
            vector: Shape (size,).
            linearization: Linearization of the relation.
        """
        shapes = _shapes(linearization)
        ends = np.cumsum([0, *(rows * columns for rows, columns in shapes)]).tolist()
        parts = zip(ca.vertsplit(vector, ends), shapes, strict=True)
        return cls(*[ca.reshape(part, *shape) for part, shape in parts])


class ExactLinearization(Block):
    """Relation of the virtual output's r-th derivative to the drives (3.28).

    It takes the larger part of a law's computation, and is evaluated once a sample.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): Point of the manifold closest to the tool.
        tau_ext (input, optional): External joint torques and their derivatives up to order
            r - 2 by rows [Nm or N, per s, ..], shape ((r - 1) N,); zero if not connected.
            Only for r > 1.
        reference (input): Derivatives 0..r of the virtual output's reference by rows, shape
            ((r + 1) m,); only of a manifold that follows time.
        relation (output): A :class:`Relation`, matrices by columns.

    Args:
        linearization: The compiled relation.
    """

    def __init__(self, linearization: Linearization) -> None:
        self._linearization = linearization
        n, r = linearization.num_joints, linearization.relative_degree
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "manifold_point": Port(linearization.manifold.layout.size),
        }
        if r > 1:
            self.inputs["tau_ext"] = Port((r - 1) * n, "Nm or N, per s, ..", optional=True)
        if linearization.manifold.follows_time:
            self.inputs["reference"] = Port((r + 1) * linearization.num_outputs, "m or rad, ..")
        self.outputs, self.states = {"relation": Port(Relation.size(linearization))}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        linearization, progress = self._linearization, []
        if linearization.manifold.follows_time:
            along = indices(linearization.manifold.coordinates, Kind.TANGENTIAL)
            y_p = ca.vertsplit(u.reference, linearization.num_outputs)
            progress = [ca.vertcat(*[y[along] for y in y_p])]
        size = linearization.num_joints * max(linearization.relative_degree - 1, 0)
        tau_ext = getattr(u, "tau_ext", None)
        results = linearization.function(
            u.joint_state,
            ca.DM.zeros(size) if tau_ext is None else tau_ext,
            u.manifold_point,
            *progress,
        )
        return {"relation": ca.vertcat(*[ca.vec(result) for result in results])}


def _shapes(linearization: Linearization) -> list[tuple[int, int]]:
    """Return the shapes of a relation's parts."""
    n, m, r = (
        linearization.num_joints,
        linearization.num_outputs,
        linearization.relative_degree,
    )
    return [(m, r), (m, n), (m, 1), (n, n), (n, 1), (n, 1), (n, r)]
