"""Measured wrench to forces along the virtual output."""

from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.manifolds.manifold import Kind, Manifold, manifold_force_function


class ManifoldForceTransform(LeafSystem):
    """External wrench to generalized forces along a manifold, see :meth:`Manifold.force`.

    For a path (3.41), (3.44), (3.45): ``tau_par = e_par . f / beta``, ``tau_perp = e_perp . f``,
    ``tau_cross = e_cross . f``, ``tau_phi = T_ZYX'(phi_pd) R_d' mu``.

    Ports:
        wrench (input): Force [N] and torque [Nm] on the tool at the tool point, world
            axes, shape (6,).
        manifold_point (input): Where on the manifold the tool is, e.g. from
            :class:`PathProjector`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,); from
            :class:`ImpedanceFilter`. Only for manifolds with rotational coordinates.
        manifold_force (output): Forces along the coordinates, shape (m,) [N, Nm]; for a path
            ``(tau_par, tau_perp, tau_cross[, tau_phi])``.

    It has no state, and lets values that are not finite through.

    Args:
        manifold: The manifold.
        with_turning: Whether a torque acts along eta where the manifold's orientation
            turns, see :func:`turning_force`. (3.41) has no such term; with it the
            forces are those of the virtual work.
    """

    def __init__(self, manifold: Manifold, *, with_turning: bool = False) -> None:
        super().__init__()
        function = manifold_force_function(manifold, with_turning=with_turning)
        self._function = BoundFunction(function)
        self._evaluate, self._result = self._function.evaluate, self._function.results["force"]
        self._m = m = len(manifold.coordinates)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._manifold_point = self.DeclareVectorInputPort("manifold_point", manifold.layout.size)
        sources = {self._wrench.ticket(), self._manifold_point.ticket()}
        self._reference: InputPort | None = None
        if any(coordinate.kind is Kind.ROTATIONAL for coordinate in manifold.coordinates):
            self._reference = self.DeclareVectorInputPort(
                "reference", (manifold.layout.order + 1) * m
            )
            sources.add(self._reference.ticket())
        self.DeclareVectorOutputPort(
            "manifold_force", m, self._calc_manifold_force, prerequisites_of_calc=sources
        )

    def _calc_manifold_force(self, context: Context, output: BasicVector) -> None:
        arguments = self._function.arguments
        arguments["wrench"][:] = self._wrench.Eval(context)
        arguments["manifold_point"][:] = self._manifold_point.Eval(context)
        if self._reference is not None:
            arguments["reference"][:] = self._reference.Eval(context)[: self._m]
        self._evaluate()
        output.SetFromVector(self._result)
