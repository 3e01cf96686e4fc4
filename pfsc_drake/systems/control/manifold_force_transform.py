"""Measured wrench to forces along the virtual output."""

from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.manifolds.path_force import manifold_force_function
from pfsc_drake.geometry import PathPointLayout


class ManifoldForceTransform(LeafSystem):
    """External wrench to manifold forces (3.41), (3.44), (3.45), see :func:`manifold_force`.

    ``tau_par = e_par . f / beta``, ``tau_perp = e_perp . f``,
    ``tau_cross = e_cross . f``, ``tau_phi = T_ZYX'(phi_pd) R_d' mu``.

    Ports:
        wrench (input): Force [N] and torque [Nm] on the tool at the tool point, world
            axes, shape (6,).
        path_point (input): From :class:`PathProjector`.
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) 6,), of
            which ``phi_pd`` is taken; from :class:`ImpedanceFilter`. Oriented paths only.
        manifold_force (output): ``(tau_par, tau_perp, tau_cross[, tau_phi])``,
            shape (m,) [N, N, N, Nm, Nm, Nm].

    It has no state, and lets values that are not finite through.

    Args:
        layout: Layout of the path point; an oriented one has m = 6, else m = 3.
        with_turning: Whether a torque acts along eta where the path's orientation
            turns, see :func:`turning_force`. (3.41) has no such term; with it the
            forces are those of the virtual work.
    """

    def __init__(self, layout: PathPointLayout, *, with_turning: bool = False) -> None:
        super().__init__()
        self._function = BoundFunction(manifold_force_function(layout, with_turning=with_turning))
        self._evaluate, self._result = self._function.evaluate, self._function.results["force"]
        m = 6 if layout.oriented else 3
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._path_point = self.DeclareVectorInputPort("path_point", layout.size)
        sources = {self._wrench.ticket(), self._path_point.ticket()}
        self._reference: InputPort | None = None
        if layout.oriented:
            self._reference = self.DeclareVectorInputPort("reference", (layout.order + 1) * m)
            sources.add(self._reference.ticket())
        self.DeclareVectorOutputPort(
            "manifold_force", m, self._calc_manifold_force, prerequisites_of_calc=sources
        )

    def _calc_manifold_force(self, context: Context, output: BasicVector) -> None:
        arguments = self._function.arguments
        arguments["wrench"][:] = self._wrench.Eval(context)
        arguments["path_point"][:] = self._path_point.Eval(context)
        if self._reference is not None:
            arguments["phi"][:] = self._reference.Eval(context)[3:6]
        self._evaluate()
        output.SetFromVector(self._result)
