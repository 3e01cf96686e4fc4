"""The state in which a run starts."""

from dataclasses import dataclass

import numpy as np

from diagrams.scenario import PathFollowingScenario
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path, PathPointLayout, quaternion_to_matrix, zyx_to_matrix
from pfsc_drake.robot.inverse_kinematics import UNLIMITED, solve_pose
from pfsc_drake.robot.robot_model import gravity_function, pose_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates

# from where on a posture that was found is another one than the posture given
_FAR_DEG = 60.0
_FAR_SLIDE = 0.3  # m


@dataclass(frozen=True)
class StartPoint:
    """Where the tool starts, beside the path.

    Attributes:
        y_t: Tool point [m], shape (3,).
        theta: Path parameter of the nearest point of the path.
        R_e: Orientation of the tool, shape (3, 3), or None on paths without.
    """

    y_t: np.ndarray
    theta: float
    R_e: np.ndarray | None


def start_point(
    scenario: PathFollowingScenario, path: Path, shift: np.ndarray | None = None
) -> StartPoint:
    """Return where the tool starts.

    Args:
        scenario: The scenario.
        path: Its path.
        shift: Beyond the scenario's offset [m], shape (3,).

    Raises:
        InputError: If the start is outside the feasible neighbourhood.
    """
    start, eta = scenario.start, scenario.reference.points[0]
    theta = path.arc_length.parameter(eta)
    layout = PathPointLayout(2, path.orientation is not None)
    on_path = path.evaluator(2).evaluate_at(theta)
    sigma, slope = on_path[layout.position].reshape(-1, 3)[:2]
    e_perp = on_path[layout.normal]
    e_cross = np.cross(slope / np.linalg.norm(slope), e_perp)
    y_t = sigma + start.offset[0] * e_perp + start.offset[1] * e_cross
    if shift is not None:
        y_t = y_t + shift
    projection = path.projector.project(y_t.tolist(), theta)
    if not (projection.converged and projection.alpha < scenario.controller.max_alpha):
        raise InputError(
            f"start.offset: {start.offset} m at eta = {eta:g} m, {np.round(y_t, 6).tolist()} m, is "
            "outside the feasible neighbourhood of the path"
            f", alpha = {projection.alpha:.3g}; alpha must be below "
            f"{scenario.controller.max_alpha:g}"
        )
    R_e = None
    if path.orientation is not None:
        deviation = zyx_to_matrix(np.deg2rad(start.rotation_deg))
        R_e = quaternion_to_matrix(on_path[layout.quaternion][:4]) @ deviation
    return StartPoint(y_t, projection.theta, R_e)


def start_state(
    scenario: PathFollowingScenario, path: Path, chain: SerialChain, coordinates: PlantCoordinates
) -> tuple[np.ndarray, float]:
    """Return the plant's state at rest beside the path, and the path parameter there.

    Elastic joints carry the links' weight.

    Args:
        scenario: The scenario.
        path: Its path.
        chain: Its robot.
        coordinates: Where the robot's coordinates stand in the plant's state.

    Raises:
        InputError: If the start is off the path's ends, outside the feasible
            neighbourhood, or out of the robot's reach.
    """
    check_points(scenario.reference.points, path)
    start = start_point(scenario, path)
    q_J = solve_pose(
        chain, start.y_t, start.R_e, _posture(scenario.start.posture_deg, chain), "start"
    )
    weight = np.array(gravity_function(chain)(q_J)).ravel()
    rest = np.zeros(chain.dimension)
    joint_state = np.concatenate([q_J, rest, q_J + weight / chain.K_s, rest])
    return coordinates.plant_state(joint_state), start.theta


def check_points(points: list[float], path: Path) -> None:
    """Refuse arc lengths off the ends of an open path.

    Args:
        points: Arc lengths [m].
        path: The path.

    Raises:
        InputError: If one is not on it.
    """
    rounding = 1e-9 * path.length
    for eta in points:
        if not path.closed and not -rounding <= eta <= path.length + rounding:
            raise InputError(
                f"reference.points: {eta:g} m; the path is open and {path.length:.6g} m long"
            )


def describe_posture(chain: SerialChain, q: np.ndarray) -> str:
    """Return a posture in one line, e.g. ``shoulder -12.5 deg, lift 0.2 m``.

    Args:
        chain: The robot.
        q: Joint coordinates, shape (N,) [rad or m].
    """
    return ", ".join(
        f"{link.name} {np.rad2deg(value):.4g} deg"
        if link.is_revolute
        else f"{link.name} {value:.4g} m"
        for link, value in zip(chain.links, q, strict=True)
    )


def posture_warnings(
    posture_deg: list[float], chain: SerialChain, q_J: np.ndarray, oriented: bool
) -> list[str]:
    """Return what is odd about a given start posture, one sentence each.

    Args:
        posture_deg: As the scenario gives it; empty for none.
        chain: The robot.
        q_J: The start posture found from there, shape (N,) [rad or m].
        oriented: Whether the pose that was looked for has an orientation.
    """
    if not posture_deg:
        return []
    is_angle = np.array([link.is_revolute for link in chain.links])
    unit = np.where(is_angle, np.deg2rad(_FAR_DEG), _FAR_SLIDE)
    distance = np.abs(q_J - _posture(posture_deg, chain)) / unit
    if distance.max() <= 1.0:
        return []
    found = describe_posture(chain, q_J)
    if _fits_in_radians(posture_deg, chain, q_J, oriented):
        in_degrees = np.where(is_angle, np.rad2deg(posture_deg), posture_deg)
        written = ", ".join(f"{value:.4g}" for value in in_degrees)
        return [
            f"start.posture_deg: {posture_deg} looks like radians; the robot starts at {found}: "
            f"write [{written}]"
        ]
    worst = chain.names[int(distance.argmax())]
    return [
        f"start.posture_deg: {posture_deg} is far from any solution, {worst} most; the robot "
        f"starts at {found}, perhaps in another configuration than meant"
    ]


def _fits_in_radians(
    posture_deg: list[float], chain: SerialChain, q_J: np.ndarray, oriented: bool
) -> bool:
    """Return whether the same digits, as radians, are next to a solution of their own."""
    angles = np.array([link.is_revolute for link in chain.links])
    as_radians = np.array(posture_deg)
    turns = np.abs(as_radians[angles]).max(initial=0.0)
    if not 0.0 < turns <= 2.0 * np.pi:
        return False
    pose = np.array(pose_function(chain)(q_J)).ravel()
    R_e = pose[3:].reshape(3, 3) if oriented else None
    try:
        solution = solve_pose(chain, pose[:3], R_e, as_radians, "start")
    except InputError:
        return False
    return bool(np.all(np.abs(solution - as_radians)[angles] < np.deg2rad(_FAR_DEG)))


def _posture(posture_deg: list[float], chain: SerialChain) -> np.ndarray:
    if not posture_deg:
        lower, upper = np.clip(chain.gather("position_limits"), -UNLIMITED, UNLIMITED).T
        limited = np.maximum(-lower, upper) < UNLIMITED
        return np.where(limited, (lower + upper) / 2.0, np.clip(0.0, lower, upper))
    if len(posture_deg) != chain.dimension:
        raise InputError(
            f"start.posture_deg: {len(posture_deg)} values; the robot has {chain.dimension} joints"
        )
    is_angle = np.array([link.is_revolute for link in chain.links])
    return np.where(is_angle, np.deg2rad(posture_deg), posture_deg)
