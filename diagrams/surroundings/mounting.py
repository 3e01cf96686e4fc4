"""Mounting plates: where magazine and frame are, and where plates and tool start."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from diagrams.scenario.checks import require, require_whole_fraction
from diagrams.scenario.plate import CarrierParameters, PlateParameters
from diagrams.tasks.path_following import PathTask
from diagrams.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix

_ORIENTED = 6  # coordinates of a path with all of its orientation


@dataclass(frozen=True)
class Mounting:
    """Where plates come from and where they go.

    Attributes:
        parameters: The plates and what belongs to them.
        X_WM: Where a plate's frame is when it lies in the magazine.
        X_WF: Where it is when it is mounted.
    """

    parameters: PlateParameters
    X_WM: RigidTransform
    X_WF: RigidTransform

    def start(self, start: StartPoint, task: Task) -> StartPoint:
        """Return where the tool starts, which is at the frame where it still holds a plate there.

        Args:
            start: What the scenario says.
            task: The task.

        Raises:
            InputError: If cups or pins are in something at the start.
        """
        if self.parameters.start == "frame":
            shift = self.X_WF.translation() - start.target.y_t
            start = task.start(shift)
            R_e = self.X_WF.rotation().matrix()
            return replace(start, target=replace(start.target, R_e=R_e))
        check = self._check_pins if self.parameters.start == "held" else self._check_cups
        check(tool_transform(start))
        return start

    def plates(self, start: StartPoint) -> list[RigidTransform]:
        """Return where the plates are at the start, the one that is held first.

        Args:
            start: Where the tool starts.
        """
        return {
            "magazine": [self.X_WM],
            "held": [tool_transform(start)],
            "frame": [self.X_WF, self.X_WM],
        }[self.parameters.start]

    def _check_cups(self, X_WT: RigidTransform) -> None:
        """Refuse a start with a cup in the plate in the magazine."""
        x_y = np.array(self.parameters.suction.cups)
        rims = np.column_stack([x_y, np.zeros(len(x_y))])
        depth = float((self.X_WM.inverse() @ X_WT).multiply(rims.T)[2].max())
        if depth > 0.0:
            raise InputError(
                f"plate.magazine: a cup starts {1e3 * depth:.3g} mm inside of the plate in the "
                "magazine; the tool must start farther away (reference.points), or the magazine "
                "be moved less"
            )

    def _check_pins(self, X_WT: RigidTransform) -> None:
        """Refuse a start with a pin in the frame."""
        pins, frame = self.parameters.pins, self.parameters.frame
        below = self.parameters.size[2] + pins.length
        places = np.array(pins.positions)
        tips = np.column_stack([places, np.full(len(places), below)])
        tips_F = (self.X_WF.inverse() @ X_WT).multiply(tips.T).T
        depth = tips_F[:, 2] - self.parameters.size[2]
        beside = np.linalg.norm(tips_F[:, :2] - places, axis=1)
        overlaps = (depth > 0.0) & (beside > frame.clearance / 2.0)
        if overlaps.any():
            i = int(np.argmax(overlaps))
            raise InputError(
                f"plate.frame: pin {i} of the plate that is held starts {1e3 * depth[i]:.3g} mm "
                f"deep in the frame, {1e3 * beside[i]:.3g} mm from its bore's axis; the tool must "
                "start farther away (reference.points), or the frame be moved less"
            )


def make_mounting(plate: PlateParameters, task: Task, *, has_hand: bool, period: float) -> Mounting:
    """Return where plates come from and go.

    Args:
        plate: The plates.
        task: What the tool is to do.
        has_hand: Whether there is an operator's hand.
        period: Sampling time [s].

    Raises:
        InputError: If the plates do not suit the task.
    """
    require_whole_fraction("plate.contact.time_step", plate.contact.time_step, period)
    if not isinstance(task, PathTask) or len(task.place.coordinates) != _ORIENTED:
        raise InputError("plate = given: allowed: null unless a path with orientation is followed")
    operated = plate.operator is not None
    require(not operated or has_hand, "hand", "null", "given for plate.operator")
    returns = plate.operator is not None and plate.operator.task == "return"
    allowed = "frame where plate.operator.task is return, and only there"
    require(
        not operated or returns == (plate.start == "frame"), "plate.start", plate.start, allowed
    )
    return Mounting(
        plate,
        _displaced(_taught(task, plate.magazine, "plate.magazine.at"), plate.magazine),
        _displaced(_taught(task, plate.frame, "plate.frame.at"), plate.frame),
    )


def _taught(task: PathTask, carrier: CarrierParameters, key: str) -> RigidTransform:
    """Return the tool's pose at an arc length of the path."""
    length = task.path.length
    require(carrier.at <= length, key, carrier.at, f"0 to {length:.6g} m, on the path")
    evaluator = task.path.evaluator(1)
    point = evaluator.evaluate_at(task.path.arc_length.parameter(carrier.at))
    layout = evaluator.layout
    R = quaternion_to_matrix(point[layout.quaternion][:4])
    return RigidTransform(RotationMatrix(R), point[layout.position][:3])


def _displaced(X_WC: RigidTransform, carrier: CarrierParameters) -> RigidTransform:
    shift, turn = carrier.misplacement()
    return X_WC @ RigidTransform(RotationMatrix(Rotation.from_rotvec(turn).as_matrix()), shift)


def tool_transform(start: StartPoint) -> RigidTransform:
    """Return the tool's pose at the start of an oriented task."""
    assert start.target.R_e is not None
    return RigidTransform(RotationMatrix(start.target.R_e), start.target.y_t)
