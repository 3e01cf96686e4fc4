"""Measured wrench to forces along the virtual output."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import Manifold, manifold_force_function


class ManifoldForceTransform(Block):
    """External wrench to generalized forces along a manifold, see :meth:`Manifold.force`.

    For a path (3.41), (3.44), (3.45): ``tau_par = e_par . f / beta``, ``tau_perp = e_perp . f``,
    ``tau_cross = e_cross . f``, ``tau_phi = T_ZYX'(phi_pd) R_d' mu``. Values that are not finite
    come through.

    Ports:
        wrench (input): Force [N] and torque [Nm] on the tool at the tool point, world
            axes, shape (6,).
        manifold_point (input): Where on the manifold the tool is, e.g. from
            :class:`Projector`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,); from
            :class:`ImpedanceFilter`. Only for manifolds with rotational coordinates.
        manifold_force (output): Forces along the coordinates, shape (m,) [N, Nm]; for a path
            ``(tau_par, tau_perp, tau_cross[, tau_phi])``.

    Args:
        manifold: The manifold.
        with_turning: Whether a torque acts along eta where the manifold's orientation
            turns, see :func:`turning_force`. (3.41) has no such term; with it the
            forces are those of the virtual work.
    """

    def __init__(self, manifold: Manifold, *, with_turning: bool = False) -> None:
        m, layout = len(manifold.coordinates), manifold.layout
        self._m, self._force = m, manifold_force_function(manifold, with_turning=with_turning)
        self.inputs = {"wrench": Port(6, "N, Nm"), "manifold_point": Port(layout.size)}
        if any(coordinate.kind is Kind.ROTATIONAL for coordinate in manifold.coordinates):
            self.inputs["reference"] = Port((layout.order + 1) * m, "m, rad, per s, ..")
        self.outputs, self.states = {"manifold_force": Port(m, "N, Nm")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        angles = u.reference[: self._m] if "reference" in self.inputs else ca.DM.zeros(self._m)
        return {"manifold_force": self._force(u.wrench, u.manifold_point, angles)}
