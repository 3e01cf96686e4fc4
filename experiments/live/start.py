"""From a scenario to a live session, and how it ended."""

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
from pfsc_drake.errors import InputError
from pfsc_drake.physics.operator_hand import LiveHandParameters
from pfsc_drake.yaml.typed import load_typed
from reporting.interruption import noticed_interruption

# what a written hand and a live one have in common
_HAND = ("stiffness", "damping", "rotational_damping", "force_limit", "torque_limit")


def run_live(
    scenario: ScenarioFile,
    port: int,
    duration: float | None,
    tell: Callable[[str], None],
    *,
    out: Path,
    figures: bool,
    recording: bool,
) -> LiveSession:
    """Let a person guide a scenario's robot until they end it.

    Args:
        scenario: The scenario as read; its written hand, if any, gives way to the person's.
        port: Port of the page; 0 for any that is free.
        duration: Simulated time after which the session ends [s]; by default
            LONGEST_SESSION or what the memory allows.
        tell: Told in words what is prepared, happens, and is written.
        out: Folder in which takes get folders of their own.
        figures: Whether takes get figures.
        recording: Whether takes get a recording.

    Raises:
        InputError: If the scenario is wrong or has nothing to guide, the folder cannot be used, or
            the port is taken.
    """
    tell = _audible(tell)
    progress = _ToldProgress(tell)
    progress(0.0, "preparing")
    guided = with_operator(scenario)
    folders = TakeFolders(
        out, scenario.name, scenario.inputs(), figures=figures, recording=recording
    )
    status, pages = LiveStatus(scenario.name), Pages()
    with closing(PageServer(port, pages, status.content)) as server:
        prepared = prepare(guided, duration, recording=True, progress=progress, live=True)
        session = LiveSession(prepared, pages, status, folders, tell)
        for warning in prepared.warnings:
            tell(f"warning: {warning}")
        tell(f"open {server.url}")
        with noticed_interruption() as interrupted:
            session.run(interrupted, progress)
    return session


def _audible(tell: Callable[[str], None]) -> Callable[[str], None]:
    """Return a teller whom it does not disturb that the terminal has gone."""

    def told(line: str) -> None:
        with suppress(OSError):
            tell(line)

    return told


class _ToldProgress:
    """Tells in words what is prepared and written."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._phase = tell, ""

    def expect(self, duration: float) -> None:
        """Leave it to the person when it ends."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        if phase != self._phase:
            self._phase = phase
            self._tell(phase)


def with_operator(scenario: ScenarioFile) -> ScenarioFile:
    """Return a scenario with a person at its controls, in place of its written hand.

    Args:
        scenario: The scenario as read.

    Raises:
        InputError: If it is wrong, or has nothing to guide.
    """
    settings = load_typed(Scenario, scenario.data, str(scenario.path))
    shape = settings.path.shape
    draws = isinstance(shape, Streamed) and shape.plane is not None
    if not settings.compliance.is_given and not settings.switched_regions and not draws:
        raise InputError(
            f"{scenario.path}: compliance = not given: nothing yields to a hand; allowed in a live "
            "session: a scenario with compliance, such as vf_soft_circle, or with a plane to draw "
            "in, such as pfc_draw_6r"
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
    return ScenarioFile(scenario.path, data | {"operator": operator, "hand": None})
