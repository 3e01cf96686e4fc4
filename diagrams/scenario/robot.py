"""Which robot a scenario is about."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import (
    require,
)


@dc.dataclass
class RobotParameters:
    """Which robot.

    Attributes:
        model: Name of a shipped model, a ``package://`` URI, or an SDF/URDF file.
        tool_frame: Frame of the model whose origin follows the path.
        joint_damping: ``K_d`` of its elastic joints, base first [Nm s/rad or N s/m]; empty for
            the model's.
        rotor_coupling: Name of a shipped robot, or YAML file with robot parameters, that says
            where the rotors of its drives sit. The robot then obeys the full elastic model
            (2.64), with the inertia coupling of spinning rotors and moving links that the
            laws neglect; empty for the simplified model (2.65).
    """

    model: str = "comau_racer_1_4"
    tool_frame: str = "tool_point"
    joint_damping: list[float] = dc.field(default_factory=list)
    rotor_coupling: str = ""

    def __post_init__(self) -> None:
        damping = self.joint_damping
        valid = all(np.isfinite(K_d) and K_d >= 0.0 for K_d in damping)
        require(valid, "joint_damping", damping, "finite numbers, none negative")
