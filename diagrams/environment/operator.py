"""A person who guides the tool while the robot moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from diagrams.scenario.recorded_times import TIME, sampling_instants, time_column, time_text
from diagrams.scenario.simulation import OperatorParameters
from pfsc_drake.control.compliance.tuned_impedance import AS_GIVEN, KINDS, REQUESTS
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import check_columns, read_numbers
from pfsc_drake.physics.operator_hand import REQUEST_SIZE, LiveHand, LiveHandParameters
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.operator_panel import OperatorPanel, RecordedControls

_REGION = "region_"
_HAND = ("push_x", "push_y", "push_z", "hold", "target_x", "target_y", "target_z")


def columns(regions: Sequence[str]) -> list[str]:
    """Return the names of a person's controls, in their order.

    Args:
        regions: Names of the regions and guides that can be switched.
    """
    kinds = [kind.name.lower() for kind in KINDS]
    tuned = [f"{kind}_{name}" for kind in kinds for name in ("stiffness", "damping")]
    return [*_HAND, *tuned, *(f"{_REGION}{name}" for name in regions)]


def read_controls(
    name: str, regions: Sequence[str], period: float
) -> tuple[np.ndarray, np.ndarray]:
    """Read recorded controls.

    Args:
        name: The file.
        regions: Names of the regions and guides that can be switched.
        period: Sampling time [s].

    Returns:
        The sampling instants, shape (rows,), and the controls from then on, shape (rows, size).

    Raises:
        InputError: If the file cannot be read, a column is missing, or the times do not
            increase from 0.
    """

    def check_header(location: str, header: list[str]) -> None:
        known = [time_column(header), *columns(regions)]
        check_columns(location, header, known=known, required=known)

    table = read_numbers(name, "lines of controls", check_header)
    when = time_column(table.header)
    rows = table.rows[:, [table.header.index(label) for label in (when, *columns(regions))]]
    times = rows[:, 0]
    if times[0] != 0.0 or np.any(np.diff(times) <= 0.0):
        raise InputError(f"{name}: column '{when}' must increase from 0")
    return sampling_instants(name, when, times, period), rows[:, 1:]


def controls_text(
    ticks: Sequence[int], rows: Sequence[np.ndarray], regions: Sequence[str], period: float
) -> str:
    """Return the text of a file that :func:`read_controls` reads back exactly.

    Args:
        ticks: Sampling instants, shape (rows,).
        rows: Controls, each (size,).
        regions: Names of the regions and guides that can be switched.
        period: Sampling time [s].
    """
    lines = [",".join([TIME, *columns(regions)])]
    for tick, row in zip(ticks, rows, strict=True):
        lines.append(",".join([time_text(tick, period), *map(_number, row.tolist())]))
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")


PULL, REQUEST, REGIONS = (
    slice(0, REQUEST_SIZE),
    slice(REQUEST_SIZE, REQUEST_SIZE + REQUESTS),
    slice(REQUEST_SIZE + REQUESTS, None),
)


@dataclass(frozen=True)
class Operator:
    """A person in a station, with a panel for the controls.

    Attributes:
        panel: System that reads the controls.
        regions: Names of the regions and guides that can be switched.
        hand: Hand of the person.
    """

    panel: OperatorPanel
    regions: Sequence[str]
    hand: LiveHandParameters

    @property
    def columns(self) -> list[str]:
        """Names of the controls."""
        return columns(self.regions)

    @property
    def idle(self) -> np.ndarray:
        """Controls of a person who does nothing, shape (size,)."""
        return idle_controls(self.regions)

    def fix(self, root: Context, controls: np.ndarray) -> None:
        """Set the controls from the next tick on, in a station without recorded ones.

        Args:
            root: Context of the diagram.
            controls: The controls, shape (size,).
        """
        context = self.panel.GetMyMutableContextFromRoot(root)
        self.panel.GetInputPort("controls").FixValue(context, controls)

    @property
    def pull(self) -> OutputPort:
        """Request to the hand, shape (7,), see :class:`LiveHand`."""
        return self.panel.GetOutputPort("pull")

    @property
    def requests(self) -> dict[str, OutputPort]:
        """Requests to the law: ``impedance_request``, and ``regions_on`` if there are regions."""
        ports = {"impedance_request": self.panel.GetOutputPort("request")}
        if self.regions:
            ports["regions_on"] = self.panel.GetOutputPort("regions")
        return ports


def idle_controls(regions: Sequence[str]) -> np.ndarray:
    """Return the controls of a person who does nothing.

    Args:
        regions: Names of the regions and guides that can be switched; they are on.
    """
    return np.concatenate(
        [np.zeros(REQUEST_SIZE), np.full(REQUESTS, AS_GIVEN), np.ones(len(regions))]
    )


def add_operator(
    builder: DiagramBuilder,
    parameters: OperatorParameters,
    regions: list[str],
    period: float,
    folder: FilePath,
) -> Operator:
    """Add the panel of a person, and recorded controls, if there are any.

    A law of guidance with regions has an input ``regions_on`` with their switches, shape
    (len(regions),): 1 is on. The page gets a switch for each, and a file of recorded controls has a
    column ``region_NAME`` for each.

    Args:
        builder: Builder of the diagram.
        parameters: The person.
        regions: Names of the regions and guides that can be switched one by one.
        period: Sampling time [s].
        folder: Base folder of relative file names.

    Raises:
        InputError: If the recorded controls cannot be read.
    """
    idle = idle_controls(regions)
    parts = {"pull": idle[PULL], "request": idle[REQUEST]}
    if regions:
        parts["regions"] = idle[REGIONS]
    panel = builder.AddNamedSystem("operator_panel", OperatorPanel(parts, period))
    if parameters.inputs:
        try:
            recorded = read_controls(str(folder / parameters.inputs), regions, period)
        except InputError as error:
            raise InputError(f"operator.inputs: {error}") from None
        player = builder.AddNamedSystem("recorded_controls", RecordedControls(*recorded, period))
        builder.Connect(player.get_output_port(), panel.GetInputPort("controls"))
    return Operator(panel, regions, parameters.hand)


def add_live_hand(
    builder: DiagramBuilder,
    robot: RobotModel,
    operator: Operator,
    joint_state: OutputPort,
) -> OutputPort:
    """Add the hand of the person at the panel, which reacts to the actual pose of the tool.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        operator: The person.
        joint_state: Actual ``[q_J, v_J, q_M, v_M]``.

    Returns:
        The wrench on the tool point, world axes, shape (6,) [N, Nm].
    """
    period = operator.panel.period
    hand = builder.AddNamedSystem("live_hand", BlockSystem(LiveHand(operator.hand, period), period))
    view = builder.AddNamedSystem("live_hand_view", BlockSystem(ToolKinematics(robot), period))
    builder.Connect(joint_state, view.GetInputPort("joint_state"))
    builder.Connect(view.GetOutputPort("tool_pose"), hand.GetInputPort("tool_pose"))
    builder.Connect(operator.pull, hand.GetInputPort("request"))
    return hand.GetOutputPort("wrench")
