"""Looking on while another process drives a robot, and asking its controller for another pace."""

import time
from collections.abc import Callable
from contextlib import closing

import casadi as ca
import numpy as np

from diagrams.builder import build_station, draw_station
from diagrams.live_view import LiveFrame, LiveView
from diagrams.scenario import Scenario
from diagrams.scenario.schema import driven
from diagrams.station import Station
from experiments.live.controls import Slider
from experiments.live.page_server import Pages, PageServer
from experiments.live.panel import Scene
from experiments.live.status import LiveStatus
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from pfsc_drake import jets
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import PlaceManifold, indices
from pfsc_drake.drivers.link import WatchingEnd
from pfsc_drake.drivers.messages import RobotStatus
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Pause, Request
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import noticed_interruption

_FRAME = 0.04  # s
_FIRST = 5.0  # s
# after which a controller that tells nothing is not there [s]
_SILENT = 0.5
_PAUSE, _STOP, _LEAVE = "pause, go on (space)", "stop the robot (X)", "leave (Q)"
_KEYS = {_PAUSE: "Space", _STOP: "KeyX", _LEAVE: "KeyQ"}
_OVERRIDE = Slider("of planned speed", "pace", 0.0, LARGEST_OVERRIDE, 0.05, 1.0)
_ARROW = 100.0  # N, of the longest


class WatchPanel:
    """What the page that leads asks a controller for.

    Args:
        pages: Who leads.

    Attributes:
        has_left: Whether the person has ended the session.
    """

    def __init__(self, pages: Pages) -> None:
        self._pages, self._pause, self.has_left = pages, Pause(), False
        pages.expect([], [_OVERRIDE.name, *_KEYS])

    def requests(self, override: float) -> list[Request]:
        """Return what was asked for since the last time.

        Args:
            override: Share of the planned pace that the controller has now.
        """
        asked = []
        for name, value in self._pages.heard().settings:
            if name == _OVERRIDE.name:
                override = _OVERRIDE.nearest(value)
                asked.append(Request(override))
            elif name == _PAUSE:
                override = self._pause.toggled(override)
                asked.append(Request(override))
            elif name == _STOP:
                asked.append(Request(stop=True))
            elif name == _LEAVE:
                self.has_left = True
        return asked

    def content(self, override: float) -> dict[str, object]:
        """Return what there is to set, for JSON, as :meth:`Panel.content` does.

        Args:
            override: Share of the planned pace that the controller has now.
        """
        slider = _OVERRIDE.content(override)
        return {
            "sliders": [slider],
            "buttons": _KEYS,
            "pushes": {},
            "hand": {},
            "force_limit": 0.0,
        }


class Watch:
    """Shows on a page what a driven robot and its controller tell, and asks what the page asks.

    Args:
        station: The station of the controller, without its robot; only what it knows is used.
        scene: Makes the scene from a first frame on.
        end: The link.
        panel: What the page asks for.
        status: What the page shows.
    """

    def __init__(
        self,
        station: Station,
        scene: Callable[[LiveFrame], Scene],
        end: WatchingEnd,
        panel: WatchPanel,
        status: LiveStatus,
    ) -> None:
        self._station, self._end, self._panel, self.status = station, end, panel, status
        self._pose = pose_function(station.part.belief.robot)
        self._memory = station.initial_place
        self._scene: Scene | None = None
        self._make = scene
        self._names = station.law.linearization.manifold.coordinates
        self._coordinates = coordinate_function(station.task.place, station.part.belief.robot)
        self._seen: dict[str, float] = {}
        status.override = 1.0

    def look(self, timeout: float) -> bool:
        """Wait for messages, and show what has come; return whether a status has.

        Args:
            timeout: How long to wait [s].
        """
        robot = self._end.look(timeout)
        if robot is not None:
            self._draw(robot)
        self._observe()
        for request in self._panel.requests(self.status.override or 0.0):
            self._end.ask(request)
        return robot is not None

    def _draw(self, robot: RobotStatus) -> None:
        """Draw the robot where it says that it is."""
        coordinates, q = self._station.part.coordinates, robot.q
        if len(q) != self._station.robot.dimension:
            self.status.message = f"The robot on this bus has {len(q)} joints."
            return
        if not np.isfinite(q).all():
            return
        state = np.concatenate([q, robot.v, q, robot.v])
        positions = coordinates.plant_state(state)[: coordinates.num_states // 2]
        pose = np.array(self._pose(q)).ravel()
        point = self._station.task.evaluate(pose[:3], self._memory)
        place = self._station.task.place
        self._memory = point[place.layout.memory]
        values = np.array(self._coordinates(q, point)).ravel()
        names = [coordinate.name for coordinate in place.coordinates]
        self._seen = {name: float(v) for name, v in zip(names, values, strict=True)}
        frame = LiveFrame(positions, pose, point, np.zeros(3))
        if self._scene is None:
            self._scene = self._make(frame)
        self._scene.draw(frame, 1.0)
        self.status.scene = self._scene.url

    def _observe(self) -> None:
        """Bring the status up to date with what the controller tells."""
        told, status = self._end.progress, self.status
        if time.monotonic() - self._end.told > _SILENT or not told:
            ended = bool(told.get("ended"))
            status.phase = "ended" if ended else "no controller"
            status.message = "" if ended else "No controller drives the robot."
            return
        status.time, status.override = told["time"], told["override"]
        status.phase = "stopping" if told["stopping"] else "driving"
        if status.override == 0.0 and status.phase == "driving":
            status.phase = "paused"
        if told["ended"]:
            status.phase = "ended"
        missed = int(told["missed"])
        status.message = f"{missed} statuses did not come within the last second." if missed else ""
        for kind, kept in (
            (Kind.TRANSVERSAL, "deviation"),
            (Kind.TANGENTIAL, "progress"),
            (Kind.ROTATIONAL, "angles"),
        ):
            names = [coordinate.name for coordinate in self._names[indices(self._names, kind)]]
            # a loop in C tells none: then they are those of the joints that the robot tells
            known = self._seen | told
            setattr(status, kept, {name: known[name] for name in names if name in known})
        status.controls = self._panel.content(status.override)


@once_per_content()
def coordinate_function(manifold: PlaceManifold, robot: RobotModel) -> ca.Function:
    """Return the coordinates of a tool on a manifold, ``(q, point) -> values``, shape (m,).

    Args:
        manifold: The manifold, whose point is given.
        robot: The robot that carries the tool.
    """
    q, point = ca.SX.sym("q", robot.dimension), ca.SX.sym("point", manifold.layout.size)
    resting = [jets.constant(q[i], 1) for i in range(robot.dimension)]
    outputs = manifold.virtual_output(*robot.tool_pose(resting), point, [])
    values = ca.vertcat(*[output.coefficients[0] for output in outputs])
    return ca.Function("coordinates", [q, point], [ca.densify(values)])


def run_watch(
    scenario: ScenarioFile, end: WatchingEnd, port: int, tell: Callable[[str], None]
) -> None:
    """Watch a robot that another process drives by a scenario, until the person leaves.

    Args:
        scenario: The scenario as read, the one that drives.
        end: The link.
        port: Port of the page; 0 for any that is free.
        tell: Told in words what is prepared and happens.

    Raises:
        InputError: If the scenario is wrong, the port is taken, or no robot tells its status.
    """
    settings = load_typed(Scenario, scenario.data, str(scenario.path))
    folder = scenario.path.parent
    tell("preparing")
    with naming(scenario.path):
        settings, _ = driven(settings)
        station = build_station(settings, folder, remote=True)
        drawing = draw_station(settings, folder, station)
    status, pages = LiveStatus(scenario.name), Pages()

    def scene(first: LiveFrame) -> Scene:
        return Scene(
            lambda frame, meshcat: LiveView(station, drawing, frame, meshcat, _ARROW), first, tell
        )

    with (
        closing(PageServer(port, pages, status.content)) as server,
        noticed_interruption() as interrupted,
    ):
        panel = WatchPanel(pages)
        watch = Watch(station, scene, end, panel, status)
        if not watch.look(_FIRST):
            raise InputError(
                f"no status of a robot on {end.dialect.status_channel} within {_FIRST:g} s; is its "
                "driver running, on the same --lcm and --driver?"
            )
        tell(f"open {server.url}")
        while not (interrupted() or panel.has_left):
            watch.look(_FRAME)
