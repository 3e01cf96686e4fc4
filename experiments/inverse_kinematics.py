"""All postures of an arm with a spherical wrist that reach a pose, in closed form (Sec. 2.1.2)."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from rich.table import Table

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.robot.models.parameters import (
    ArmParameters,
    VariantParameters,
    load_parameters,
)
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.robot.serial.spherical_wrist import Branch, SphericalWrist

_TOOL_FRAME = "tool_point"  # of every model that is written from parameters


@dataclass(frozen=True, eq=False)
class ReachingPosture:
    """A posture that reaches a pose.

    Attributes:
        branch: It, and which configuration it is.
        miss: How far Drake's forward kinematics has the tool point from where it is to be [m].
        turn: How far it has the tool turned from how it is to be [rad].
    """

    branch: Branch
    miss: float
    turn: float


def find_postures(model: str, position: np.ndarray, zyx_deg: np.ndarray) -> list[ReachingPosture]:
    """Return all postures of an arm that reach a pose, also those beyond its limits.

    Args:
        model: Name of a shipped arm, or path of a ``parameters.yaml``.
        position: Tool point in the base frame [m], shape (3,).
        zyx_deg: Angles of the flange's axes about z, then the new y, then the new x [deg], (3,).

    Raises:
        InputError: If the arm has no spherical wrist, or cannot reach the pose.
    """
    parameters, wrist = _read(model)
    R_e = zyx_to_matrix(np.deg2rad(zyx_deg))
    branches = wrist.branches(position, R_e)
    poses = _forward_kinematics(parameters, [branch.q for branch in branches])
    found = []
    for branch, (y_t, R) in zip(branches, poses, strict=True):
        turn = 2.0 * np.arcsin(min(np.linalg.norm(R - R_e) / np.sqrt(8.0), 1.0))
        found.append(ReachingPosture(branch, float(np.linalg.norm(y_t - position)), float(turn)))
    return found


def posture_table(postures: list[ReachingPosture]) -> Table:
    """Return a table of postures, angles in degrees.

    Args:
        postures: As found.
    """
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    for name in ("Shoulder", "Elbow", "Wrist"):
        table.add_column(name, no_wrap=True)
    for joint in range(1, 7):
        table.add_column(f"theta_{joint}", justify="right", no_wrap=True)
    for name in ("Limits", "Drake's pose off by"):
        table.add_column(name, no_wrap=True)
    for posture in postures:
        branch = posture.branch
        table.add_row(
            branch.shoulder,
            branch.elbow,
            branch.wrist,
            # without a minus in front of a zero
            *(f"{round(angle, 3) + 0.0:.3f}" for angle in np.rad2deg(branch.q)),
            _limits_text(branch),
            f"{posture.miss:.1e} m, {np.rad2deg(posture.turn):.1e} deg",
        )
    return table


def _limits_text(branch: Branch) -> str:
    if branch.is_within_limits:
        return "within"
    worst = int(np.argmax(branch.violation))
    return f"theta_{worst + 1} {np.rad2deg(branch.violation[worst]):.3g} deg beyond"


def _read(model: str) -> tuple[ArmParameters, SphericalWrist]:
    parameters = load_parameters(model)
    try:
        wrist = SphericalWrist(
            parameters.denavit_hartenberg.table(),
            parameters.joint_limits.position_lower,
            parameters.joint_limits.position_upper,
            parameters.tool.tool_point,
        )
    except InputError as error:
        raise InputError(
            f"{model} has no closed form, which is for six axes with a spherical wrist: {error}"
        ) from None
    return parameters, wrist


def _forward_kinematics(
    parameters: ArmParameters, postures: list[np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return tool points and orientations [m], (3,) and (3, 3), as Drake has them."""
    plant = MultibodyPlant(0.0)
    text = write_sdf(parameters, VariantParameters(name=parameters.name))
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    context, found = plant.CreateDefaultContext(), []
    for q in postures:
        plant.SetPositions(context, q)
        X = plant.GetFrameByName(_TOOL_FRAME).CalcPoseInWorld(context)
        found.append((X.translation(), X.rotation().matrix()))
    return found
