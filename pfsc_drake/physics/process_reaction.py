"""What a process at the tool truly does to whoever holds the workpiece."""

from pfsc_drake.control.estimation.reaction import Reaction


class ProcessReaction(Reaction):
    """:class:`~pfsc_drake.control.estimation.reaction.Reaction` of the true wrench and poses.

    It belongs to the world: no controller reads it unless it is to know forces.
    """
