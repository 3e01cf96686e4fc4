"""Monitoring of a robot driven by another process, with requests to its controller."""

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
from experiments.live.status import LiveStatus, coordinate_labels
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile
from pfsc_drake import jets
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import ProjectedManifold, indices
from pfsc_drake.drivers.link import ObserverEndpoint
from pfsc_drake.drivers.messages import RobotStatus
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Pause, Request
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, pose_function
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import watch_interruption

_FRAME = 0.04  # s
_FIRST = 5.0  # s
# silence after which a controller counts as absent [s]
_SILENT = 0.5
_PAUSE, _STOP, _LEAVE = "pause, resume (space)", "stop the robot (X)", "leave (Q)"
_KEYS = {_PAUSE: "Space", _STOP: "KeyX", _LEAVE: "KeyQ"}
_OVERRIDE = Slider("of planned speed", "pace", 0.0, LARGEST_OVERRIDE, 0.05, 1.0)
_ARROW = 100.0  # N, of the longest


class WatchPanel:
    """Requests of the controlling page to a controller.

    Args:
        pages: Input of the page.

    Attributes:
        has_left: Whether the person has ended the session.
    """

    def __init__(self, pages: Pages) -> None:
        self._pages, self._pause, self.has_left = pages, Pause(), False
        pages.expect([], [_OVERRIDE.name, *_KEYS])

    def requests(self, override: float) -> list[Request]:
        """Return the requests since the last call.

        Args:
            override: Current speed scaling of the controller.
        """
        requests = []
        for name, value in self._pages.collect().settings:
            if name == _OVERRIDE.name:
                override = _OVERRIDE.nearest(value)
                requests.append(Request(override))
            elif name == _PAUSE:
                override = self._pause.toggle(override)
                requests.append(Request(override))
            elif name == _STOP:
                requests.append(Request(stop=True))
            elif name == _LEAVE:
                self.has_left = True
        return requests

    def content(self, override: float) -> dict[str, object]:
        """Return the controls as JSON content, see :meth:`Panel.content`.

        Args:
            override: Current speed scaling of the controller.
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
    """Monitoring of a driven robot and its controller on a page, with requests from it.

    Args:
        station: Station of the controller, without its robot.
        scene: Returns the scene for a first frame.
        end: The link.
        panel: Requests of the page.
        status: Status for the page.
    """

    def __init__(
        self,
        station: Station,
        scene: Callable[[LiveFrame], Scene],
        end: ObserverEndpoint,
        panel: WatchPanel,
        status: LiveStatus,
    ) -> None:
        self._station, self._end, self._panel, self.status = station, end, panel, status
        self._pose = pose_function(station.part.nominal_model.robot)
        self._memory = station.initial_projection
        self._scene: Scene | None = None
        self._make = scene
        self._names = station.law.linearization.manifold.coordinates
        self._coordinates = coordinate_function(
            station.task.projected_manifold, station.part.nominal_model.robot
        )
        self._own: dict[str, float] = {}
        status.override = 1.0
        status.labels = coordinate_labels(station.law.linearization.manifold)

    def look(self, timeout: float) -> bool:
        """Wait for messages, and show them; return whether a status was received.

        Args:
            timeout: Longest time to wait [s].
        """
        robot = self._end.receive(timeout)
        if robot is not None:
            self._draw(robot)
        self._observe()
        for request in self._panel.requests(self.status.override or 0.0):
            self._end.send_request(request)
        return robot is not None

    def _draw(self, robot: RobotStatus) -> None:
        """Draw the robot in its reported posture."""
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
        manifold = self._station.task.projected_manifold
        self._memory = point[manifold.layout.memory]
        values = np.array(self._coordinates(q, point)).ravel()
        names = [coordinate.name for coordinate in manifold.coordinates]
        self._own = {name: float(v) for name, v in zip(names, values, strict=True)}
        frame = LiveFrame(positions, pose, point, np.zeros(3))
        if self._scene is None:
            self._scene = self._make(frame)
        self._scene.draw(frame, 1.0)
        self.status.scene = self._scene.url

    def _observe(self) -> None:
        """Update the status from the controller's progress."""
        progress, status = self._end.progress, self.status
        if time.monotonic() - self._end.progress_time > _SILENT or not progress:
            ended = bool(progress.get("ended"))
            status.phase = "ended" if ended else "no controller"
            status.message = "" if ended else "No controller drives the robot."
            return
        status.time, status.override = progress["time"], progress["override"]
        status.phase = "stopping" if progress["stopping"] else "driving"
        if status.override == 0.0 and status.phase == "driving":
            status.phase = "paused"
        if progress["ended"]:
            status.phase = "ended"
        missed = int(progress["missed"])
        status.message = f"{missed} status messages missing in the last second." if missed else ""
        for kind, attribute in (
            (Kind.TRANSVERSAL, "deviation"),
            (Kind.TANGENTIAL, "progress"),
            (Kind.ROTATIONAL, "angles"),
        ):
            names = [coordinate.name for coordinate in self._names[indices(self._names, kind)]]
            # a loop in C sends none: then they are computed from the robot's joints
            known = self._own | progress
            setattr(status, attribute, {name: known[name] for name in names if name in known})
        status.controls = self._panel.content(status.override)


@once_per_content()
def coordinate_function(manifold: ProjectedManifold, robot: RobotModel) -> ca.Function:
    """Return the coordinates of a tool on a manifold, ``(q, point) -> values``, shape (m,).

    Args:
        manifold: The manifold.
        robot: The robot of the tool.
    """
    q, point = ca.SX.sym("q", robot.dimension), ca.SX.sym("point", manifold.layout.size)
    resting = [jets.constant(q[i], 1) for i in range(robot.dimension)]
    outputs = manifold.virtual_output(*robot.tool_pose(resting), point, [])
    values = ca.vertcat(*[output.coefficients[0] for output in outputs])
    return ca.Function("coordinates", [q, point], [ca.densify(values)])


def run_watch(
    scenario: ScenarioFile, end: ObserverEndpoint, port: int, notify: Callable[[str], None]
) -> None:
    """Monitor a robot driven by another process, until the person leaves.

    Args:
        scenario: The scenario of the driving process.
        end: The link.
        port: Port of the page; 0 for any free port.
        notify: Receives lines about progress and events.

    Raises:
        InputError: If the scenario is wrong, the port is in use, or no status is received.
    """
    settings = load_typed(Scenario, scenario.data, scenario.source)
    folder = scenario.path.parent
    notify("preparing")
    with naming(scenario.source):
        settings, _ = driven(settings)
        station = build_station(settings, folder, remote=True)
        drawing = draw_station(settings, folder, station)
    status, pages = LiveStatus(scenario.name), Pages()

    def scene(first: LiveFrame) -> Scene:
        return Scene(
            lambda frame, meshcat: LiveView(station, drawing, frame, meshcat, _ARROW), first, notify
        )

    with (
        closing(PageServer(port, pages, status.content)) as server,
        watch_interruption() as interrupted,
    ):
        panel = WatchPanel(pages)
        watch = Watch(station, scene, end, panel, status)
        if not watch.look(_FIRST):
            raise InputError(
                f"no status of a robot on {end.dialect.status_channel} within {_FIRST:g} s; is its "
                "driver running, on the same --lcm and --driver?"
            )
        notify(f"open {server.url}")
        while not (interrupted() or panel.has_left):
            watch.look(_FRAME)
