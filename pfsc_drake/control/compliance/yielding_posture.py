"""The posture reference of joints beyond the number of outputs, as it yields and is pulled."""

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.cases import all_finite, where
from pfsc_drake.control.compliance.null_space_impedance import NullSpaceImpedance
from pfsc_drake.control.law.decoupling import free_torque, scale_of
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.posture_potential import POTENTIALS, free_motion_function
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# of a joint's velocity limit, up to which a posture is pulled
_LARGEST_SPEED = 0.5


class YieldingPosture:
    """A :class:`NullSpaceImpedance` under external torques and the pull of a potential.

    With ``N'`` the projection on what leaves the outputs alone, the posture is driven by
    ``u = N' (tau_ext + pull_stiffness (-dV/dq))``.

    What pulls, spring or potential, is scaled down as a whole where the damper alone would let
    it move a joint faster than half its velocity limit: far from its goal a posture must not
    take away what the drives need for the outputs.

    Args:
        robot: The robot, N joints.
        manifold: What it follows.
        posture: How the law follows the posture; its weight decides the projection.
        impedance: How the posture moves.
        potential: ``V``, one of ``POTENTIALS``, or empty for none.
        pull_stiffness: Of the potential [Nm/rad or N/m], not negative.

    Raises:
        InputError: If the potential is unknown, or its stiffness negative.
    """

    def __init__(
        self,
        robot: RobotModel,
        manifold: Manifold,
        posture: Posture,
        impedance: NullSpaceImpedance,
        potential: str = "",
        pull_stiffness: float = 0.0,
    ) -> None:
        if potential and potential not in POTENTIALS:
            raise InputError(f"potential: '{potential}'; must be one of {', '.join(POTENTIALS)}")
        if not 0.0 <= pull_stiffness < np.inf:
            raise InputError(
                f"pull_stiffness: {pull_stiffness}; must be zero or positive, and finite"
            )
        self.impedance, self._n = impedance, robot.dimension
        self.size = (impedance.relative_degree + 1) * self._n
        self._pulls = pull_stiffness if potential else 0.0
        self._free = BoundFunction(
            _free_torques_function(robot, manifold, posture, potential, self._pulls)
        )
        speed = _LARGEST_SPEED * robot.gather("velocity_limit")
        self._largest = impedance.parameters.damping * speed

    def start(self, posture: np.ndarray) -> np.ndarray:
        """Return the state at rest in a posture (N,), flat, shape ((r + 1) N,)."""
        return self.impedance.start(posture).ravel()

    def update(
        self,
        state: np.ndarray,
        q: np.ndarray,
        point: np.ndarray,
        torque: np.ndarray | None,
        goal: np.ndarray,
    ) -> np.ndarray:
        """Return the state one period later, shape ((r + 1) N,).

        Args:
            state: Derivatives 0..r of ``q_0`` by rows, shape ((r + 1) N,).
            q: Joint coordinates, shape (N,).
            point: The manifold's point next to the tool.
            torque: External torques, shape (N,) [Nm or N]; None for none.
            goal: Where the spring pulls, shape (N,).
        """
        rows = state.reshape(-1, self._n)
        free = np.zeros(self._n)
        spring = self.impedance.parameters.stiffness * (goal - rows[0])
        pull = spring
        if torque is not None or self._pulls:
            free, pulled = self._free_torques(q, point, torque)
            free, pull = free + pulled, spring + pulled
        excess = float(np.max(np.abs(pull) / self._largest))
        if excess > 1.0:
            free = free - (1.0 - 1.0 / excess) * pull
        return self.impedance.update(rows, free, goal).ravel()

    def _free_torques(
        self, q: np.ndarray, point: np.ndarray, torque: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of external torques and pull that do no work on the outputs.

        NaN if not finite, each (N,).
        """
        arguments, results = self._free.arguments, self._free.results
        arguments["q"][:], arguments["manifold_point"][:] = q, point
        arguments["torque"][:] = 0.0 if torque is None else torque
        self._free.evaluate()
        return results["free"].copy(), results["pulled"].copy()


def _free_torques_function(
    robot: RobotModel, manifold: Manifold, posture: Posture, potential: str, stiffness: float
) -> ca.Function:
    """Return ``(q, manifold_point, torque) -> (free, pulled)``, the last three (N,).

    They are the parts of external torques and pull that do no work on the outputs; the first is of
    NaN, the second zero, if something is not finite.
    """
    q, torque = ca.SX.sym("q", robot.dimension), ca.SX.sym("torque", robot.dimension)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    inertial = posture.weight is None
    A, pull, weight = free_motion_function(robot, manifold, potential, inertial=inertial)(q, point)
    scale = scale_of(weight) if inertial else posture.scale
    finite = all_finite(A, pull, torque)
    free = where(finite, free_torque(A, torque, scale), np.nan)
    pulled = where(finite, free_torque(A, stiffness * pull, scale), 0.0)
    return ca.Function(
        "free_torques",
        [q, point, torque],
        ca.cse([ca.densify(free), ca.densify(pulled)]),
        ["q", "manifold_point", "torque"],
        ["free", "pulled"],
    )
