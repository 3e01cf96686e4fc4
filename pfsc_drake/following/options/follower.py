"""A whole controller."""

from dataclasses import dataclass, field

import numpy as np

from pfsc_drake.control.law.timed_reference import StreamLimits
from pfsc_drake.following.options.compliance import ComplianceParameters
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.faults import FaultParameters

# 1/s, of poles that nobody chooses
BANDWIDTH = 20.0


@dataclass
class FollowerOptions:
    """What can be chosen of a path or surface following controller.

    Attributes:
        bandwidth: Of the error dynamics [1/s], for coordinates without gains of their own; their
            poles are chosen by it, see :class:`GainParameters`.
        controller: Gains, limits, friction, forces, posture, sampling time. Its law is the one
            that the controller is added with.
        faults: What is a fault.
        friction: Coefficients f_c and f_v of the drives that are believed, each (N,).
        posture: From where the posture at the start is looked for, shape (N,) [rad or m]; the
            middle of the joints' limits if omitted.
        transition: How long the reference takes from where the tool is at the start to the motion
            that is wanted [s]; 0 for no such transition.
        compliance: How the tool yields to a hand or to what it touches; by default not at all.
        override: Whether there is a port for the pace of the motion, see :class:`TimedReference`.
        stream: How fast the tool goes along a path to way points that come while it moves, by a
            port of their own, in place of a motion over time; None for the latter.
        measures: What is measured: ``plant_state``, the state ``[q, v]`` of the plant, or
            ``joint_state``, ``[q_J, v_J, q_M, v_M]``.
    """

    bandwidth: float = BANDWIDTH
    controller: ControllerParameters = field(default_factory=ControllerParameters)
    faults: FaultParameters = field(default_factory=FaultParameters)
    friction: tuple[np.ndarray, np.ndarray] | None = None
    posture: np.ndarray | None = None
    transition: float = 0.0
    compliance: ComplianceParameters = field(default_factory=ComplianceParameters)
    override: bool = False
    stream: StreamLimits | None = None
    measures: str = "plant_state"
