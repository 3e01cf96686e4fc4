"""Suction gripper: elastic cups that hold a plate by vacuum."""

from dataclasses import dataclass, field
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.yaml.rules import Count, NotNegative, Numbers, Parameters, Positive

FREE = -1.0  # index of the plate of a free cup
_DEEPEST = 0.02  # m, depth below which a rim is not in contact with a plate


@dataclass
class SuctionParameters(Parameters):
    """Parameters of a gripper's cups; in the range of bellows of 30 mm at 0.6 bar.

    Attributes:
        cups: Centres of their rims in the tool's frame [m], one ``[x, y]`` each, at z = 0.
        stiffness: Stiffness of one cup in every direction [N/m].
        damping: Damping of one cup [N s/m].
        press: Depth from which on a cup that is pressed on a plate is tight [m].
        pull_off: Tension at which a cup detaches [N].
        shear: Force along the plate at which a cup slips [N].
    """

    cups: Annotated[
        list[Annotated[list[float], Numbers(2)]], Count(3, words="three or more [x, y] in m")
    ] = field(
        default_factory=lambda: [[0.07, 0.045], [0.07, -0.045], [-0.07, 0.045], [-0.07, -0.045]]
    )
    stiffness: Positive = 1e4
    damping: NotNegative = 40.0
    press: Positive = 2e-4
    pull_off: Positive = 40.0
    shear: Positive = 25.0


def free_cups(count: int) -> np.ndarray:
    """Return the state of free cups, shape (4 count,)."""
    return np.tile([FREE, 0.0, 0.0, 0.0], count)


def holding_cups(
    parameters: SuctionParameters,
    plate: int,
    R_PT: np.ndarray,
    p_PT: np.ndarray,
    load: np.ndarray,
) -> np.ndarray:
    """Return the state of cups of which all hold a plate, shape (4n,).

    Args:
        parameters: The cups.
        plate: Index of the plate.
        R_PT: Orientation of the tool in the plate's frame, shape (3, 3).
        p_PT: Tool point in the plate's frame [m], shape (3,).
        load: Total load, equally distributed, axes of the plate [N], shape (3,).
    """
    rims = np.column_stack([parameters.cups, np.zeros(len(parameters.cups))])
    anchors = p_PT + rims @ R_PT.T + load / (len(rims) * parameters.stiffness)
    return np.column_stack([np.full(len(rims), float(plate)), anchors]).ravel()


class SuctionGripper(Block):
    """Cups that push, grasp, hold and release plates, see :func:`cups_function`.

    Grasping and release occur at ticks.

    Ports:
        tool_motion (input): ``[y_t, R_e by rows, v, w]``, shape (18,), see :class:`ToolMotion`.
        plate_state (input): ``[q, v]`` of K free bodies of a MultibodyPlant, shape (13 K,).
        vacuum (input): Vacuum on above 0.5, shape (1,).
        wrench (output): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].
        pushes (output): ``[force, torque]`` on each plate at its origin, world axes, shape (6 K,)
            [N, Nm].
        held (output): Share of the cups that hold, 0 to 1, shape (1,).

    State:
        State of the ``cups``, shape (4n,).

    Args:
        parameters: The n cups.
        half_size: Half length and half width of the plates [m], shape (2,).
        num_plates: K.
        start: Initial state of the cups; None if they are free.
    """

    def __init__(
        self,
        parameters: SuctionParameters,
        half_size: np.ndarray,
        num_plates: int,
        start: np.ndarray | None = None,
    ) -> None:
        self._count = len(parameters.cups)
        self._start = free_cups(self._count) if start is None else start
        self._function = cups_function(parameters, half_size, num_plates)
        self.inputs = {
            "tool_motion": Port(18, "m, 1, m/s, rad/s"),
            "plate_state": Port(13 * num_plates, "1, m, rad/s, m/s"),
            "vacuum": Port(1),
        }
        self.outputs = {
            "wrench": Port(6, "N, Nm"),
            "pushes": Port(6 * num_plates, "N, Nm"),
            "held": Port(1),
        }
        self.inner = self.states = {"cups": 4 * self._count}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"cups": ca.DM(self._start)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        wrench, pushes, later = self._function(x.cups, u.tool_motion, u.plate_state, u.vacuum)
        share = ca.sum1(x.cups[::4] >= 0.0) / self._count
        return {"wrench": wrench, "pushes": pushes, "held": share, "cups": later}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"cups": y.cups}


def cups_function(
    parameters: SuctionParameters, half_size: np.ndarray, num_plates: int
) -> ca.Function:
    """Return the wrenches of a gripper's n cups on the tool and K plates, and their next state.

    A cup is a spring and a damper at its rim. A cup that holds a plate is fixed to an *anchor*, the
    point of the plate where it was grasped, and transmits forces in every direction::

        f = -k (p - a) - d p'          in the axes of the plate,

    with the rim p and the anchor a. A free cup is pushed back by a plate that it is pressed into,
    along the plate's normal only, and never pulled. With a vacuum a cup grasps a plate when it is
    pressed deep enough; it releases it when the vacuum ends or the tension exceeds its limit, and
    its anchor slips where the force along the plate would exceed the friction limit.

    The *state* has four numbers for each cup: index of its plate or -1, and the anchor in the axes
    of the plate [m]. A plate's frame has its origin in the middle of the grasped face, and z
    points into the plate.

    Args:
        parameters: The cups.
        half_size: Half length and half width of the plates [m], shape (2,).
        num_plates: K.

    Returns:
        ``(state, tool_motion, plate_state, vacuum) -> (wrench, pushes, next)``: ``tool_motion``
        as of :class:`ToolMotion`, shape (18,); ``plate_state`` of K free bodies of a
        MultibodyPlant, quaternion and position of each, then angular velocity and velocity of
        each, shape (13 K,); ``vacuum`` above 0.5 if it is on. ``wrench`` ``[force, torque]``
        on the tool at the tool point, shape (6,); ``pushes`` ``[force, torque]`` on each plate at
        its origin, shape (6 K,), world axes [N, Nm]; ``next`` state.
    """
    count = len(parameters.cups)
    state, vacuum = ca.SX.sym("state", 4 * count), ca.SX.sym("vacuum")
    tool, plates = ca.SX.sym("tool_motion", 18), ca.SX.sym("plate_state", 13 * num_plates)
    wrench, pushes, after = ca.SX(6, 1), [ca.SX(6, 1) for _ in range(num_plates)], []
    for i, (x, y) in enumerate(parameters.cups):
        cup = state[4 * i : 4 * i + 4]
        arm = ca.reshape(tool[3:12], 3, 3).T @ ca.DM([x, y, 0.0])
        rim, velocity = tool[:3] + arm, tool[12:15] + ca.cross(tool[15:], arm)
        later = ca.vertcat(FREE, 0.0, 0.0, 0.0)
        for k in range(num_plates):
            R, arm_k, rate = _relative(plates, num_plates, k, rim, velocity)
            p, u = R.T @ arm_k, R.T @ rate
            holds, touches = cup[0] == k, ca.logic_and(cup[0] < 0.0, _is_in(p, half_size))
            stretched = p - cup[1:]
            spring = -parameters.stiffness * stretched - parameters.damping * u
            push = ca.fmax(parameters.stiffness * p[2] + parameters.damping * u[2], 0.0)
            pressed = ca.vertcat(0.0, 0.0, -push)
            force = R @ (ca.if_else(holds, spring, 0.0) + ca.if_else(touches, pressed, 0.0))
            wrench += ca.vertcat(force, ca.cross(arm, force))
            pushes[k] -= ca.vertcat(force, ca.cross(arm_k, force))
            anchored = ca.vertcat(cup[0], _slipping_anchor(parameters, cup[1:], stretched))
            torn = -parameters.stiffness * stretched[2] > parameters.pull_off
            seizes = ca.logic_and(touches, p[2] >= parameters.press)
            later = ca.if_else(ca.logic_and(holds, ca.logic_not(torn)), anchored, later)
            later = ca.if_else(seizes, ca.vertcat(k, p[0], p[1], 0.0), later)
        nothing = ca.vertcat(FREE, 0.0, 0.0, 0.0)
        after.append(ca.if_else(vacuum > 0.5, later, nothing))
    results = [wrench, ca.vertcat(*pushes), ca.vertcat(*after)]
    return ca.Function(
        "suction_cups",
        [state, tool, plates, vacuum],
        ca.cse([ca.densify(result) for result in results]),
        ["state", "tool_motion", "plate_state", "vacuum"],
        ["wrench", "pushes", "next"],
    )


def _relative(
    plates: ca.SX, num_plates: int, k: int, rim: ca.SX, velocity: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return a plate's orientation, and a rim's relative position and velocity, world axes."""
    q, v = plates[7 * k : 7 * k + 7], plates[7 * num_plates + 6 * k :][:6]
    arm = rim - q[4:]
    return _orientation(q[:4]), arm, velocity - v[3:] - ca.cross(v[:3], arm)


def _orientation(q: ca.SX) -> ca.SX:
    """Return the rotation matrix of a quaternion of any length."""
    w, S = q[0], ca.skew(q[1:])
    return ca.SX.eye(3) + 2.0 * (w * S + S @ S) / ca.dot(q, q)


def _is_in(p: ca.SX, half_size: np.ndarray) -> ca.SX:
    """Return whether a rim is pressed into the face of a plate."""
    over = ca.logic_and(ca.fabs(p[0]) <= half_size[0], ca.fabs(p[1]) <= half_size[1])
    return ca.logic_and(over, ca.logic_and(p[2] > 0.0, p[2] < _DEEPEST))


def _slipping_anchor(parameters: SuctionParameters, anchor: ca.SX, stretched: ca.SX) -> ca.SX:
    """Return the anchor after slip along the plate at the friction limit."""
    size, most = ca.norm_2(stretched[:2]), parameters.shear / parameters.stiffness
    excess = ca.fmax(1.0 - most / ca.fmax(size, most), 0.0)
    return anchor + ca.vertcat(excess * stretched[:2], 0.0)
