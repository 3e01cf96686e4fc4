"""What the joints of a robot do that its task leaves free."""

import dataclasses as dc

import numpy as np

from pfsc_drake.checks import (
    LARGEST_ANGLE,
    require,
    require_not_negative,
    require_positive,
)

POSTURE_TASKS = ("reference", "limits", "conditioning", "elbow")
_WEIGHTS = ("identity", "inertia", "range")
_TORQUE_SOURCES = ("none", "known", "observed")
_ELBOW_JOINTS = (2, 4, 6)


@dc.dataclass
class PostureParameters:
    """Posture of a robot with more joints than the task has outputs.

    The joints stay next to a posture reference as far as the outputs let them, with the poles of
    ``controller.gains.<law>.posture``, by default those of ``xi``. The reference starts where the
    joints start, and moves like a mass with damper and spring behind a filter that makes it
    smooth enough for the law.

    Attributes:
        task: ``reference``: towards ``reference_deg``; ``limits``: away from the joints' limits;
            ``conditioning``: to where the outputs are easy to move; ``elbow``: as
            ``reference``, and the elbow's swivel angle stays that of the reference exactly.
        reference_deg: Where the posture goes [deg], m for slides; empty for where it starts.
        weight: By what deviations of the joints are judged: ``identity``, all alike; ``inertia``,
            the robot's; ``range``, in proportion to what the limits allow.
        joint_weights: The same as one positive number per joint; empty for ``weight``.
        elbow_joints: Numbers of the joints whose origins are shoulder, elbow and wrist, the first
            joint being 1.
        inertia: Of the posture in the null space, every joint [kg m^2 or kg].
        damping: Of the same [Nm s/rad or N s/m].
        stiffness: Of its spring [Nm/rad or N/m], or of the pull of ``limits`` and
            ``conditioning``; 0 for a posture that stays where it is left.
        filter_rate: Of the filter [rad/s].
        yields: To which external torques it yields: ``none``; ``known``: those of all forces on
            the robot; ``observed``: as they show in how the links move, without a sensor.
        observer_rate: How fast torques are observed [rad/s].
    """

    task: str = "reference"
    reference_deg: list[float] = dc.field(default_factory=list)
    weight: str = "identity"
    joint_weights: list[float] = dc.field(default_factory=list)
    elbow_joints: list[int] = dc.field(default_factory=lambda: list(_ELBOW_JOINTS))
    inertia: float = 1.0
    damping: float = 20.0
    stiffness: float = 50.0
    filter_rate: float = 30.0
    yields: str = "none"
    observer_rate: float = 60.0

    def __post_init__(self) -> None:
        require(self.task in POSTURE_TASKS, "task", self.task, ", ".join(POSTURE_TASKS))
        require(self.weight in _WEIGHTS, "weight", self.weight, ", ".join(_WEIGHTS))
        known = self.yields in _TORQUE_SOURCES
        require(known, "yields", self.yields, ", ".join(_TORQUE_SOURCES))
        good = all(abs(angle) <= LARGEST_ANGLE for angle in self.reference_deg)
        allowed = f"numbers of at most {LARGEST_ANGLE:g} deg"
        require(good, "reference_deg", self.reference_deg, allowed)
        good = all(0.0 < weight < np.inf for weight in self.joint_weights)
        require(good, "joint_weights", self.joint_weights, "positive numbers")
        alone = not self.joint_weights or self.weight == "identity"
        require(alone, "joint_weights", self.joint_weights, "empty where weight is given")
        joints = self.elbow_joints
        good = len(joints) == 3 and 0 < joints[0] < joints[1] < joints[2]
        require(good, "elbow_joints", joints, "3 numbers of joints in ascending order")
        for key in ("inertia", "damping", "filter_rate", "observer_rate"):
            require_positive(key, getattr(self, key))
        require_not_negative("stiffness", self.stiffness)

    @property
    def is_pulled(self) -> bool:
        """Whether a potential pulls the posture, not a spring."""
        return self.task in ("limits", "conditioning")
