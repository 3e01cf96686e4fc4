"""How an operator mounts a plate, in numbers."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import require

TASKS = ("mount", "return")


@dataclass
class MountingHandParameters:
    """How an operator mounts a plate.

    Forces by which things are brought into place come from what is seen and felt: the operator
    pushes in proportion to the distance that is seen, and more as long as it lasts, until
    something touches; from then on the hands follow.

    Attributes:
        task: ``mount``: take the plate, lead it to the frame, insert it, let go of it and leave;
            ``return``: let go of a plate in the frame, lead the gripper back, take the next.
        press: Force along the tool's axis while gripping [N].
        reach: How far the hand that leads is ahead of the tool at most [m]; farther on it waits.
        insert: The same while inserting [N].
        leave: The same, backwards, when leaving [N].
        leave_distance: How far [m].
        hover: Gap between pins and frame at which a person stops to look [m].
        eye_error: Standard deviation of where a person sees the bores, along each of two axes
            across them [m]; what is drawn is cut off at twice that.
        eye_angle: The same of their orientation, about each of three axes [rad].
        eye_gap: Gap between plate and frame that is taken for none [m].
        stiffness: Push beside the tool's axis per distance that is seen [N/m].
        persistence: Growth of that push [N/(m s)].
        side_limit: Largest push beside the axis that persistence leads to [N].
        turning_stiffness: Moment per angle that is seen [Nm/rad].
        turning_persistence: Growth of that moment [Nm/(rad s)].
        turning_limit: Largest moment that persistence leads to [Nm].
        search_radius: Of the spiral in which the bores are felt for [m].
        search_time: Until the spiral is that wide [s].
        search_period: Of one turn [s].
        captured: Depth in the bores from which on the hands follow [m].
        relaxation: Time constant with which they then give up what persistence led to [s].
        wobble: Moment by which a plate that sticks is worked in [Nm].
        patience: How long nothing moves until a person tries something else [s].
        look_time: How long a person aligns at most before trying [s].
        seed: Of what the eye errs by.
    """

    task: str = "mount"
    press: float = 35.0
    reach: float = 0.13
    insert: float = 9.0
    leave: float = 25.0
    leave_distance: float = 0.015
    hover: float = 2e-3
    eye_error: float = 5e-4
    eye_angle: float = 2e-3
    eye_gap: float = 5e-4
    stiffness: float = 2000.0
    persistence: float = 4000.0
    side_limit: float = 15.0
    turning_stiffness: float = 100.0
    turning_persistence: float = 40.0
    turning_limit: float = 1.5
    search_radius: float = 1.5e-3
    search_time: float = 4.0
    search_period: float = 1.5
    captured: float = 4e-3
    relaxation: float = 1.0
    wobble: float = 1.0
    patience: float = 0.5
    look_time: float = 5.0
    seed: int = 0

    def __post_init__(self) -> None:
        require(self.task in TASKS, "task", self.task, " or ".join(TASKS))
        for key in (
            "press", "reach", "insert", "leave", "leave_distance", "hover", "eye_gap", "side_limit",
            "turning_limit", "search_time", "search_period", "captured", "relaxation",
            "patience", "look_time",
        ):  # fmt: skip
            value = getattr(self, key)
            require(0.0 < value < np.inf, key, value, "a positive number")
        for key in (
            "eye_error", "eye_angle", "stiffness", "persistence", "turning_stiffness",
            "turning_persistence", "search_radius", "wobble",
        ):  # fmt: skip
            value = getattr(self, key)
            require(0.0 <= value < np.inf, key, value, "zero or a positive number")
        require(self.seed >= 0, "seed", self.seed, "zero or a positive integer")
