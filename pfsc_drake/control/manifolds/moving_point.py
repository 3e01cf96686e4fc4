"""Trajectory tracking on jets: the tool against a point that moves along a path with time."""

import casadi as ca

from pfsc_drake import jets
from pfsc_drake.control.manifolds.path import PathGeometry, PathManifold, orientation_error
from pfsc_drake.control.manifolds.path_force import rotational_force
from pfsc_drake.jets import Jet


def trajectory_errors(y: Jet, R_e: Jet, path: PathGeometry, eta_d: Jet) -> list[Jet]:
    """Return the errors ``y_t - sigma_t(theta_d(t))`` and the ZYX angles of ``R_d' R_e``.

    The classical counterpart of the path coordinates (Sec. 3.8.4): the reference point
    is given by time, ``theta_d' = eta_d' / |sigma'|``, whatever the tool does.

    Args:
        y: Tool point ``y_t`` [m], vector jet of order r >= 1.
        R_e: Tool orientation, matrix jet of order r.
        path: The path at the reference point.
        eta_d: Arc length of the reference point over time [m], scalar jet of order r.

    Returns:
        3 or 6 scalar jets of order r [m, m, m, rad, rad, rad], world axes.
    """

    def rate(theta: Jet) -> Jet:
        tangent = jets.compose(path.position[1:], theta)
        return eta_d.differentiate() / jets.sqrt(jets.dot(tangent, tangent))

    theta_d = jets.solve_ode(rate, ca.SX(0), y.order)
    error = y - jets.compose(path.position, theta_d)
    position = [error[i] for i in range(3)]
    if not path.quaternion:
        return position
    return [*position, *orientation_error(R_e, jets.compose(path.quaternion, theta_d))]


class MovingPoint(PathManifold):
    """The point that moves along a path with time, as a manifold.

    Its coordinates are the errors of :func:`trajectory_errors` in world axes; the first takes
    the place, and the gains, of the tangential one.
    """

    name = "trajectory"
    follows_time = True

    def virtual_output(self, y: Jet, R_e: Jet, point: ca.SX, lead: Jet) -> list[Jet]:
        """Return :func:`trajectory_errors`."""
        return trajectory_errors(y, R_e, self.geometry(point), lead)

    def force(
        self, wrench: ca.SX, point: ca.SX, reference: ca.SX, *, with_turning: bool = False
    ) -> ca.SX:
        """Return the force in world axes and, with orientation, (3.44), (3.45)."""
        if not self.layout.oriented:
            return wrench[:3]
        rotational = rotational_force(wrench[3:], point, self.layout, reference[3:6])
        return ca.vertcat(wrench[:3], rotational)
