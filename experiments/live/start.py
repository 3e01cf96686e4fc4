"""Start of a live session from a scenario."""

from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

from diagrams.scenario import Scenario, Streamed
from experiments.live.page_server import Pages, PageServer
from experiments.live.session import LiveSession
from experiments.live.status import LiveStatus
from experiments.live.takes import TakeFolders
from experiments.preparation import prepare
from experiments.scenario_file import ScenarioFile
from pfsc_drake.physics.operator_hand import LiveHandParameters
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import watch_interruption

# parameters shared by a simulated and a live operator
_HAND = ("stiffness", "damping", "rotational_damping", "force_limit", "torque_limit")


def run_live(
    scenario: ScenarioFile,
    port: int,
    duration: float | None,
    notify: Callable[[str], None],
    *,
    out: Path,
    figures: bool,
    recording: bool,
) -> LiveSession:
    """Run a live session in which a person guides a scenario's robot.

    Args:
        scenario: The scenario as read; its operator model, if any, is replaced by the person.
        port: Port of the page; 0 for any free port.
        duration: Simulated time after which the session ends [s]; by default
            LONGEST_SESSION or what the memory allows.
        notify: Receives lines about progress and events.
        out: Folder of the takes' folders.
        figures: Whether takes get figures.
        recording: Whether takes get a recording.

    Raises:
        InputError: If the scenario is wrong or has no compliance, the folder cannot be used, or the
            port is taken.
    """
    notify = _audible(notify)
    progress = _ProgressLines(notify)
    progress(0.0, "preparing")
    guided = with_operator(scenario)
    folders = TakeFolders(
        out, scenario.name, scenario.inputs(), figures=figures, recording=recording
    )
    status, pages = LiveStatus(scenario.name), Pages()
    with closing(PageServer(port, pages, status.content)) as server:
        prepared = prepare(guided, duration, recording=True, progress=progress, live=True)
        session = LiveSession(prepared, pages, status, folders, notify)
        for warning in prepared.warnings:
            notify(f"warning: {warning}")
        notify(f"open {server.url}")
        with watch_interruption() as interrupted:
            session.run(interrupted, progress)
    return session


def _audible(notify: Callable[[str], None]) -> Callable[[str], None]:
    """Return a function that prints lines and ignores a closed terminal."""

    def print_safely(line: str) -> None:
        with suppress(OSError):
            notify(line)

    return print_safely


class _ProgressLines:
    """Progress listener that reports each phase as a line."""

    def __init__(self, notify: Callable[[str], None]) -> None:
        self._notify, self._phase = notify, ""

    def expect(self, duration: float) -> None:
        """Ignore the duration, which the person decides."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        if phase != self._phase:
            self._phase = phase
            self._notify(phase)


def with_operator(scenario: ScenarioFile) -> ScenarioFile:
    """Return a scenario with a live operator in place of its operator model.

    Args:
        scenario: The scenario as read.

    Raises:
        InputError: If it is wrong, or has no compliance.
    """
    settings = load_typed(Scenario, scenario.data, scenario.source)
    shape = settings.path.shape
    draws = isinstance(shape, Streamed) and shape.plane is not None
    if not settings.compliance.is_given and not settings.switched_regions and not draws:
        raise scenario.source.refusal(
            [
                "compliance = not given: the robot cannot be guided; allowed in a live session: "
                "a scenario with compliance, such as vf_soft_circle, or with a plane to draw in, "
                "such as pfc_draw_6r"
            ]
        )
    data = dict(scenario.data)
    operator = dict(data.get("operator") or {})
    if settings.hand is not None and settings.operator is None:
        hand = {key: getattr(settings.hand, key) for key in _HAND}
        LiveHandParameters(**hand)
        operator["hand"] = hand
    operator["inputs"] = ""
    if draws:
        path = dict(data["path"])
        path["shape"] = dict(path["shape"]) | {"inputs": ""}
        data["path"] = path
    data |= {"operator": operator, "hand": None}
    return ScenarioFile(scenario.path, data, scenario.locations)
