"""What a fixed joint of a plant bears."""

from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, WeldJoint
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.errors import InputError


class JointReaction(LeafSystem):
    """One of a plant's reaction forces as a vector.

    Ports:
        reaction_forces (input): The plant's reaction forces, abstract.
        reaction (output): ``[torque, force]`` on the joint's child, axes and origin of the joint's
            frame on it, shape (6,) [Nm, N].

    Args:
        index: Of the joint in the plant's reactions, see :func:`reaction_index`.
    """

    def __init__(self, index: int) -> None:
        super().__init__()
        self._index = index
        self._forces = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self.DeclareVectorOutputPort(
            "reaction", 6, self._calc_reaction, prerequisites_of_calc={self._forces.ticket()}
        )

    def _calc_reaction(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._forces.Eval(context)[self._index].get_coeffs())


def reaction_index(plant: MultibodyPlant, joint: Joint) -> int:
    """Return where a joint stands in a plant's reaction forces.

    Args:
        plant: A finalized plant.
        joint: The joint with the sensor in it.

    Raises:
        InputError: If the joint is not fixed.
    """
    if not isinstance(joint, WeldJoint):
        raise InputError(
            f"joint '{joint.name()}' of the force/torque sensor: type '{joint.type_name()}'; "
            "must be a fixed joint"
        )
    # reactions are numbered without gaps, also where joints were removed
    return list(plant.GetJointIndices()).index(joint.index())
