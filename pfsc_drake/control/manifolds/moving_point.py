"""Trajectory tracking: errors of the tool against a point that moves along a path with time."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.control.manifolds.forces import force_components
from pfsc_drake.control.manifolds.orientation import quaternion_rotation
from pfsc_drake.control.manifolds.path import (
    PathGeometry,
    PathManifold,
    rotate_components,
    transport,
)
from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.jets import Jet


def trajectory_errors(y: Jet, R_e: Jet, path: PathGeometry, eta_d: Jet) -> list[Jet]:
    """Return the errors ``y_t - sigma_t(theta_d(t))`` and the angles of ``R_d' R_e``.

    The classical counterpart of the path coordinates (Sec. 3.8.4): the reference point
    depends on time only, ``theta_d' = eta_d' / |sigma'|``, not on the tool. The errors are
    resolved in the parallel transport frame of that point, so that they have the gains of the
    path coordinates whose names they share.

    Args:
        y: Tool point ``y_t`` [m], vector jet of order r >= 1.
        R_e: Tool orientation, matrix jet of order r.
        path: The path at the reference point.
        eta_d: Arc length of the reference point over time [m], scalar jet of order r.

    Returns:
        3 to 6 scalar jets of order r [m, m, m, rad, rad, rad]: along the tangent and the two
        normals of the reference point, and angles, see :meth:`ToolOrientation.error`.
    """

    def rate(theta: Jet) -> Jet:
        tangent = jets.compose(path.position[1:], theta)
        return eta_d.differentiate() / jets.sqrt(jets.dot(tangent, tangent))

    theta_d = jets.solve_ode(rate, ca.SX(0), y.order)
    error = y - jets.compose(path.position, theta_d)
    tangent = jets.compose(path.position[1:], theta_d)
    e_par = tangent / jets.sqrt(jets.dot(tangent, tangent))
    e_perp = transport(path.normal, e_par)
    axes = (e_par, e_perp, jets.cross(e_par, e_perp))
    position = [jets.dot(axis, error) for axis in axes]
    if path.turn:
        position[1:] = rotate_components(
            position[1:], jets.compose([ca.SX(0), *path.turn], theta_d)
        )
    if not path.quaternion:
        return position
    R_d = quaternion_rotation(jets.compose(path.quaternion, theta_d))
    return [*position, *path.tool.error(R_e, R_d)]


class MovingPoint(PathManifold):
    """Point that moves along a path with time, as a manifold.

    Its coordinates are the errors of :func:`trajectory_errors`, in the order of a path's
    coordinates and named like them.
    """

    name = "trajectory"
    follows_time = True

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Sequence[Jet]) -> list[Jet]:
        """Return :func:`trajectory_errors`."""
        return trajectory_errors(y, R_e, self.geometry(point), lead[0])

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return the force along the axes of the errors and, with orientation, (3.44), (3.45)."""
        translational = force_components(wrench[:3], point, self.layout)
        if not self.layout.oriented:
            return translational
        _, rotational = self.rotational_force(wrench[3:], point, reference[3:])
        return ca.vertcat(translational, rotational)


_SAMPLES, _STEPS = 2001, 6


class TrajectoryPoint(Block):
    """Path at the arc length that the reference prescribes, in place of the tool's projection.

    Ports:
        reference (input): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,);
            its first entry is the arc length ``eta_d`` [m].
        manifold_point (output): The path at ``eta_d``, laid out by ``layout``.

    Args:
        path: The path.
        relative_degree: ``r`` of the law that reads the output.
        num_outputs: ``m``.

    Attributes:
        layout: Layout of the manifold's point.
    """

    def __init__(self, path: Path, relative_degree: int, num_outputs: int) -> None:
        self._at = path.evaluator(relative_degree).at
        self.layout: PathPointLayout = path.evaluator(relative_degree).layout
        self._length = path.length if path.closed else np.inf
        self._period = path.position.period
        self._theta = np.linspace(*path.position.domain, _SAMPLES)
        self._eta = np.array([path.arc_length(theta) for theta in self._theta])
        self.inputs = {"reference": Port((relative_degree + 1) * num_outputs)}
        self.outputs, self.states = {"manifold_point": Port(self.layout.size)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"manifold_point": self._at(self._parameter(ca.MX(u.reference[0])))}

    def _parameter(self, eta: ca.MX) -> ca.MX:
        """Return the parameter with an arc length, by Newton's method from a table."""
        revolutions = ca.floor(eta / self._length)
        within = eta - (revolutions * self._length if np.isfinite(self._length) else 0.0)
        lengths, parameters = ca.MX(ca.DM(self._eta)), ca.MX(ca.DM(self._theta))
        k = ca.low(lengths, within, {"lookup_mode": "binary"})
        share = (within - lengths[k]) / (lengths[k + 1] - lengths[k])
        theta = parameters[k] + share * (parameters[k + 1] - parameters[k])
        for _ in range(_STEPS):
            point = self._at(theta)
            slope = point[self.layout.position][3:6]
            theta += (within - point[self.layout.eta]) / ca.norm_2(slope)
        return theta + revolutions * self._period
