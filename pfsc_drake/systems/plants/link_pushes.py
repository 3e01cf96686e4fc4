"""Wrenches on the links of an arm, applied to a plant."""

from collections.abc import Sequence

from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.physics.link_forces import link_torque_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.link_places import LinkPlace


class LinkPushes(LeafSystem):
    """Applies wrenches to points of an arm's links.

    Forces and torques act **on the robot**; ``tau_ext = sum_k J_k(q_J)^T wrench_k`` is what they
    mean at the joints, with the sign of (2.65a), ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        wrenches (input): ``[force, torque]`` at each of K points, world axes, shape (6K,)
            [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,); not needed for the next.
        applied_spatial_force (output): For the port of that name of a plant, abstract; without
            points at which nothing acts.
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N], for plants that
            bear no forces on bodies.

    Args:
        chain: The arm, N joints.
        places: The K points.
    """

    def __init__(self, chain: SerialChain, places: Sequence[LinkPlace]) -> None:
        super().__init__()
        self.places = tuple(places)
        n, size = chain.dimension, len(self.places)
        points = [(place.link, place.p_LQ) for place in self.places]
        self._torque_of = BoundFunction(link_torque_function(chain, points))
        self._wrenches = self.DeclareVectorInputPort("wrenches", 6 * size)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc_applied,
            prerequisites_of_calc={self._wrenches.ticket()},
        )
        self.DeclareVectorOutputPort(
            "tau_ext",
            n,
            self._calc_tau_ext,
            prerequisites_of_calc={self._wrenches.ticket(), self._joint_state.ticket()},
        )

    def _calc_applied(self, context: Context, output: Value) -> None:
        applied, wrenches = [], self._wrenches.Eval(context)
        for k, place in enumerate(self.places):
            wrench = wrenches[6 * k : 6 * k + 6]
            if not any(wrench.tolist()):
                continue
            force = ExternallyAppliedSpatialForce()
            force.body_index, force.p_BoBq_B = place.body, place.p_BQ
            force.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
            applied.append(force)
        output.set_value(applied)

    def _calc_tau_ext(self, context: Context, output: BasicVector) -> None:
        wrenches = self._wrenches.Eval(context)
        if not any(wrenches.tolist()):
            output.SetZero()
            return
        arguments = self._torque_of.arguments
        arguments["q"][:] = self._joint_state.Eval(context)[: len(arguments["q"])]
        arguments["wrenches"][:] = wrenches
        self._torque_of.evaluate()
        output.SetFromVector(self._torque_of.results["tau_ext"])
