"""Status of a live session for its page, updated ten times a second."""

import re
from dataclasses import asdict, dataclass, field

import numpy as np

from diagrams.live_view import felt_force
from diagrams.station import Station
from experiments.live.controls import KIND_WORDS
from pfsc_drake.control.compliance.impedance import DAMPING, STIFFNESS
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord
from pfsc_drake.control.fixtures.robot_limits import limit_kinds
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import Manifold, indices
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.singular_posture import singular_posture, singularity_name

# real-time factor below which the simulation counts as slow
_SLOW = 0.95
# fields before those of each region
_RECORD = GuidanceRecord(0).fields
_NEAR_SINGULAR = {
    "elbow": "elbow nearly stretched or folded",
    "wrist": "wrist nearly straight",
    "shoulder": "tool nearly above axis 1",
}
_NO_NAME = "posture nearly singular"
POSTURES = (*_NEAR_SINGULAR.values(), _NO_NAME)


@dataclass
class LiveStatus:
    """Status of a session.

    Attributes:
        scenario: Name of the scenario.
        scene: Address of the scene.
        phase: ``running``, ``fault``, ``saving``, ``ended``; of a monitored robot ``driving``,
            ``paused``, ``stopping``, ``ended``, ``no controller``.
        time: Simulated time [s].
        factor: Simulated over real time.
        mode: Mode of the law, if it has several.
        limit: Active limit of the robot itself, or null.
        deviation: Transversal coordinates, by name [m]; in space the distance from the active
            guide, by its name, or from the nearest region, if one is near.
        progress: Tangential coordinates, by name [m].
        labels: Descriptions of coordinates by name.
        tool_point: Position of the tool point in the world [m]; empty if unknown.
        angles: Rotational coordinates, by name [rad].
        force: Force on the tool, or on the operator of a leader device, world axes [N].
        measured: Measured forces along the coordinates, by name [N, Nm].
        stiffness: Stiffness by coordinate [N/m, Nm/rad]; null where rigid.
        damping: Damping by coordinate [N s/m, Nm s/rad].
        tank: Energy available for stiffening springs [J].
        ready: Whether the reference complies; a sensor is tared first.
        recording: Begin of the current recording [s], or null.
        takes: Saved takes, by names of their folders.
        message: Further message, e.g. the reason of a stop.
        override: Speed scaling of a monitored robot; else null.
        controls: Controls with their values, see :class:`Panel`.
        plane: Plane to draw in, see :meth:`Pen.content`; or null.
    """

    scenario: str
    scene: str = ""
    phase: str = "preparing"
    time: float = 0.0
    factor: float = 1.0
    mode: str | None = None
    limit: str | None = None
    deviation: dict[str, float] = field(default_factory=dict)
    progress: dict[str, float] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    tool_point: list[float] = field(default_factory=list)
    angles: dict[str, float] = field(default_factory=dict)
    force: list[float] = field(default_factory=list)
    measured: dict[str, float] = field(default_factory=dict)
    stiffness: dict[str, float | None] = field(default_factory=dict)
    damping: dict[str, float] = field(default_factory=dict)
    tank: float | None = None
    ready: bool = True
    recording: float | None = None
    takes: list[str] = field(default_factory=list)
    message: str = ""
    override: float | None = None
    controls: dict[str, object] = field(default_factory=dict)
    plane: dict[str, object] | None = None

    @property
    def is_slow(self) -> bool:
        """Whether simulated time is slower than the clock."""
        return self.factor < _SLOW

    def content(self) -> dict[str, object]:
        """Return the status as JSON content, with null for infinity and NaN."""
        return {**{key: _plain(value) for key, value in asdict(self).items()}, "slow": self.is_slow}

    def observe(self, station: Station, signals: dict[str, np.ndarray]) -> None:
        """Update from a station's signals.

        Args:
            station: The station.
            signals: Current values by signal, see :meth:`SignalLog.now`.
        """
        coordinates = station.law.linearization.manifold.coordinates
        names = [coordinate.name for coordinate in coordinates]
        self.labels = coordinate_labels(station.law.linearization.manifold)
        y = signals["law"][station.law.layout.manifold_state][: len(names)].tolist()

        def of(kind: Kind, values: list[float]) -> dict[str, float]:
            part = indices(coordinates, kind)
            return dict(zip(names[part], values[part], strict=True))

        self.deviation, self.progress = of(Kind.TRANSVERSAL, y), of(Kind.TANGENTIAL, y)
        self.angles = of(Kind.ROTATIONAL, y)
        self.force = felt_force(signals).tolist()
        if "manifold_force" in signals:
            forces = signals["manifold_force"].tolist()
            self.measured = dict(zip(names, forces, strict=True))
        if "impedance" in signals:
            impedance = signals["impedance"].reshape(3, -1)
            self.stiffness = dict(zip(names, impedance[STIFFNESS].tolist(), strict=True))
            self.damping = dict(zip(names, impedance[DAMPING].tolist(), strict=True))
            self.tank = float(signals["tank"][0])
        if "guidance" in signals:
            self._observe_guidance(signals["guidance"])
        if "guides" in signals:
            self._observe_guides(station, signals["guides"])
        self._observe_limit(station, signals)
        self.ready = "tared" not in signals or bool(signals["tared"][0] > 0.5)
        if "mode" in signals:
            self.mode = station.mode_name(int(signals["mode"][0]))

    def _observe_guidance(self, row: np.ndarray) -> None:
        """Update from guidance through space, see :class:`GuidanceRecord`."""
        axes = list(self.progress)
        # new dictionaries: pages read the old ones in their threads
        forces = zip(axes, row[_RECORD["force"]].tolist(), strict=True)
        self.measured = self.measured | dict(forces)
        self.damping = self.damping | dict.fromkeys(axes, float(row[_RECORD["damping"]][0]))
        near = row[_RECORD["near"]].reshape(-1, len(SLOT))
        index = near[:, SLOT.index("index")]
        # after the regions follow limits of the robot
        is_region = (index >= 0.0) & (index < GuidanceRecord.regions_in(row.size))
        distances = near[is_region, SLOT.index("h")]
        if distances.size:
            self.deviation = {"nearest region": float(distances.min())}

    def _observe_guides(self, station: Station, row: np.ndarray) -> None:
        """Update from the active one of several guides, see :class:`GuideRecord`."""
        assert isinstance(station.task, SpaceTask)
        names = list(station.task.guides)
        fields, active = GuideRecord(len(names)).fields, row[0]
        if active >= 0.0:
            distances = row[fields["distance"]]
            self.deviation = {names[int(active)]: float(distances[int(active)])}

    def _observe_limit(self, station: Station, signals: dict[str, np.ndarray]) -> None:
        """Update the active limit of the robot itself."""
        if not {"guidance", "limit_force"} & signals.keys():
            return
        n = station.robot.dimension
        if "guidance" in signals:
            kind = holding_limit(signals["guidance"], n)
        else:
            kind = hardest_limit(signals["limit_force"], n)
        if kind is None:
            self.limit = None
        elif kind != "singular":
            self.limit = joint_text(kind)
        elif self.limit not in POSTURES:  # its name is expensive to compute
            self.limit = posture_text(station, signals["joint_state"][:n])


_ABOUT = re.compile("phi_([xyz])")


def coordinate_labels(manifold: Manifold) -> dict[str, str]:
    """Return the descriptions of a manifold's coordinates by their names.

    Args:
        manifold: The manifold; coordinates of space are x, y and z.
    """
    in_space = manifold.name == SpaceManifold.name
    axes, labels = iter("xyz"), {}
    for coordinate in manifold.coordinates:
        name, kind = coordinate.name, coordinate.kind
        about = _ABOUT.fullmatch(name)
        if in_space and kind is Kind.TANGENTIAL:
            labels[name] = next(axes)
        elif about is not None:
            labels[name] = f"rotation about {about[1]} ({name})"
        else:
            labels[name] = f"{KIND_WORDS[kind]} ({name})"
    return labels


def _plain(value: object) -> object:
    """Return a value without infinities and NaN, which become null."""
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value


def holding_limit(row: np.ndarray, joints: int) -> str | None:
    """Return the kind of limit with the largest force, see :func:`limit_kinds`, or None.

    Args:
        row: A record of guidance, see :class:`GuidanceRecord`.
        joints: N.
    """
    regions = GuidanceRecord.regions_in(row.size)
    slots = row[_RECORD["near"]].reshape(-1, len(SLOT))
    limits = slots[slots[:, SLOT.index("index")] >= regions]
    if not limits.size:
        return None
    hardest = limits[np.argmax(limits[:, SLOT.index("phi")])]
    if not hardest[SLOT.index("phi")] > 0.0:
        return None
    return limit_kinds(joints)[int(hardest[SLOT.index("index")]) - regions]


def hardest_limit(forces: np.ndarray, joints: int) -> str | None:
    """Return the kind of limit with the largest force on a path or surface, or None.

    Args:
        forces: Forces by kind [N].
        joints: N.
    """
    hardest = int(np.argmax(forces))
    return list(dict.fromkeys(limit_kinds(joints)))[hardest] if forces[hardest] > 0.0 else None


def joint_text(kind: str) -> str:
    """Return the text of a joint's limit.

    Args:
        kind: ``speed_3`` or ``end_3``.
    """
    name, _, axis = kind.partition("_")
    return f"axis {axis} at its speed" if name == "speed" else f"axis {axis} near its end"


def posture_text(station: Station, q: np.ndarray) -> str:
    """Return the text of a nearly singular posture, one of ``POSTURES``.

    Args:
        station: The station.
        q: Joint coordinates, shape (N,).
    """
    robot, manifold = station.part.nominal_model.robot, station.task.projected_manifold
    tool = manifold.tool
    if not isinstance(robot, SerialChain):
        return _NO_NAME
    posture = singular_posture(
        robot, q, oriented=manifold.is_oriented, tool_axis=tool.tool_axis, yaw_axis=tool.yaw_axis
    )
    return _NEAR_SINGULAR.get(singularity_name(robot, q, posture) or "", _NO_NAME)
