"""Pictures of moving robots, from recordings of runs.

    python -m docs.pictures [scenario ..]     # redraws docs/images/gallery/SCENARIO.webp
    python -m docs.pictures --film            # the animated picture of the README

A run is recorded until its most instructive time; a headless browser draws the recording at that
time.
"""

import base64
import io
import json
import logging
import tempfile
import time
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import Console

from experiments.finished_run import RunOutcome
from experiments.scenario_file import read_scenario, scenario_names
from experiments.simulated_run import RunOptions, run_scenario
from tests.experiments.live.browser import NAMES, Browser, find_browser

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "images" / "gallery"
FILM = ROOT / "docs" / "images" / "two_robots.webp"
RUNS = ROOT / "out" / "pictures"
SIZE = (640, 480)
# times of the pictures [s]; other scenarios are shown at the end of their run
MOMENTS = {
    "operator_hand_6r": 6.0,
    "pfc_comau_6r": 1.8,
    "pfc_comau_6r_elastic": 1.8,
    "pfc_compliant_6r": 2.8,
    "pfc_delta_notch": 1.3,
    "pfc_delta_notch_stiff": 1.3,
    "pfc_crossing_6r": 2.2,
    "pfc_crossing_7r": 4.0,
    "pfc_elbow_7r": 5.4,
    "pfc_turntable": 1.6,
    "pfc_two_arms": 1.9,
    "pfc_two_arms_grinding": 1.9,
    "pfc_new_path_6r": 3.0,
    "pfc_stream_6r": 2.4,
    "plate_mounting": 11.0,
    "plate_return": 7.0,
    "sfc_comau_paraboloid": 7.2,
    "sfc_polish": 6.0,
    "sfc_polish_stiff": 6.0,
    "teleop_path": 13.5,
    "teleop_plate": 11.0,
    "teleop_region": 15.0,
    "teleop_tilt": 17.2,
    "ttc_comau_6r": 1.8,
    "vf_backdrivable_circle": 5.2,
    "vf_backdrivable_paraboloid": 7.2,
    "vf_dynamic_circle": 9.0,
    "vf_edge": 7.5,
    "vf_forbidden_region": 15.0,
    "vf_hard_spline": 8.5,
    "vf_many_surfaces": 10.0,
    "vf_moving_region": 7.0,
    "vf_nearest_path": 10.4,
    "vf_seven_axes": 7.0,
    "vf_soft_circle": 7.2,
    "vf_soft_region": 7.0,
    "vf_wedge": 8.0,
}
# parts of the scene that may lie outside the picture, in favour of small objects
_MAGAZINE = [f"mounting/magazine_rest_{i}" for i in range(4)]
_NOTCH = ("delta_robot", "path_following")
_PLATE = ("visualizer", "path_following", "mounting/magazine", *_MAGAZINE)
LEFT_OUT = {
    "pfc_delta_notch": _NOTCH,
    "pfc_delta_notch_stiff": _NOTCH,
    "plate_mounting": _PLATE,
    "plate_return": _PLATE,
    "vf_nearest_path": ("visualizer",),
    "vf_many_surfaces": ("visualizer",),
}
_LARGEST = 60_000  # bytes of a picture
_BACKGROUND, _CONTRAST = (0.86, 0.89, 0.93), 6  # colour, and least difference from it, of 255
_MARGIN = 0.05  # around the content, relative to its size
_SEE_THROUGH = """for (const one of Object.values(
    viewer.scene_tree.find(["drake", "fixtures"]).children))
  if (one.children.skin) one.children.skin.set_property("modulated_opacity", 0.4)"""
_PATIENCE = 60.0  # s, for a recording to be loaded


@dataclass(frozen=True)
class Scene:
    """A part of the film.

    Attributes:
        scenario: Name of the scenario.
        begin: Time of the run at the beginning [s].
        end: Time of the run at the end [s].
        left_out: Scene paths of the parts that may lie outside the picture.
    """

    scenario: str
    begin: float
    end: float
    left_out: Sequence[str] = ()


# side by side, with playback speeds for equal durations
SCENES = (
    Scene("pfc_elastic_6r", 0.0, 3.6),
    Scene("vf_forbidden_region", 1.0, 16.0, ("visualizer",)),
)
_FRAMES, _FRAME_TIME, _SIDE = 72, 100, (400, 380)  # pictures, ms for each, pixels


class _Silent:
    """Progress display without output."""

    def expect(self, duration: float) -> None:
        """Ignore the duration."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Ignore the progress."""


class View:
    """View of a recording in a browser, at any time.

    Args:
        browser: Browser that opens it.
        recording: Page written by a run.
    """

    def __init__(self, browser: Browser, recording: Path) -> None:
        self._browser = browser
        self._window = browser.open(recording.resolve().as_uri())
        self._until("window.viewer && viewer.animator.actions.length > 0")
        self._evaluate("viewer.animator.pause()")
        for path in ("Axes", "Grid"):
            self._evaluate(f"viewer.set_property(['{path}'], 'visible', false)")
        for colour in ("top_color", "bottom_color"):
            what = f"['Background', '<object>'], '{colour}', {json.dumps(_BACKGROUND)}"
            self._evaluate(f"viewer.set_property({what})")
        self._evaluate(_SEE_THROUGH)
        self._settle()

    @property
    def duration(self) -> float:
        """Duration of the recording [s]."""
        return float(str(self._evaluate("viewer.animator.duration")))

    def picture(self, moment: float, size: tuple[int, int]) -> Image.Image:
        """Return the picture at a time.

        Args:
            moment: Time of the run [s].
            size: Width and height in pixels.
        """
        self._evaluate(f"viewer.animator.seek({moment:.4f})")
        width, height = size
        drawn = str(self._evaluate(f"viewer.capture_image({width}, {height})"))
        return Image.open(io.BytesIO(base64.b64decode(drawn.partition(",")[2]))).convert("RGB")

    def come_close(
        self, moments: Sequence[float], size: tuple[int, int], left_out: Sequence[str] = ()
    ) -> None:
        """Narrow the view to the visible content.

        Args:
            moments: Times at which the content is drawn [s].
            size: Width and height of the pictures in pixels.
            left_out: Scene paths of the parts that may lie outside the picture.
        """
        self._show(left_out, False)
        drawn = [np.asarray(self.picture(moment, size)).astype(int) for moment in moments]
        self._show(left_out, True)
        visible = np.any([abs(one - one[0, 0]).max(axis=2) > _CONTRAST for one in drawn], axis=0)
        rows, columns = np.flatnonzero(visible.any(axis=1)), np.flatnonzero(visible.any(axis=0))
        if not rows.size:
            return
        low, high = np.array([columns[0], rows[0]]), np.array([columns[-1], rows[-1]]) + 1
        share = min(1.0, (1.0 + 2.0 * _MARGIN) * float(((high - low) / size).max()))
        width, height = share * np.array(size)
        x, y = (low + high - (width, height)) / 2.0
        window = ", ".join(f"{value:.2f}" for value in (*size, x, y, width, height))
        self._evaluate(f"viewer.camera.setViewOffset({window})")

    def _show(self, paths: Sequence[str], visible: bool) -> None:
        for path in paths:
            scene_path = json.dumps(["drake", *path.split("/")])
            self._evaluate(f"viewer.set_property({scene_path}, 'visible', {json.dumps(visible)})")

    def _evaluate(self, expression: str) -> object:
        """Return the value of an expression on this page; other pages may be open."""
        self._browser.speak_to(self._window)
        return self._browser.evaluate(expression)

    def _until(self, condition: str) -> None:
        end = time.monotonic() + _PATIENCE
        while not self._evaluate(f"Boolean({condition})"):
            if time.monotonic() > end:
                raise TimeoutError(f"the recording did not load: {self._browser.errors[:1]}")
            time.sleep(0.1)

    def _settle(self) -> None:
        """Wait until meshes have been loaded, that is, until the picture is constant."""
        end, before = time.monotonic() + _PATIENCE, b""
        while time.monotonic() < end:
            now = self.picture(0.0, (160, 120)).tobytes()
            if now == before:
                return
            before = now
            time.sleep(0.4)


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """Open a browser, and close it at the end.

    Raises:
        FileNotFoundError: No browser is installed.
    """
    program = find_browser()
    if program is None:
        raise FileNotFoundError(f"no browser; one of {', '.join(NAMES)} is needed")
    with tempfile.TemporaryDirectory() as profile, closing(Browser(program, Path(profile))) as one:
        yield one


def record_run(scenario: str, folder: Path, duration: float | None = None) -> Path:
    """Run a scenario until a time, and return its recording.

    Args:
        scenario: Name of the scenario.
        folder: Folder of the results.
        duration: Simulated time [s]; None for the scenario's own.
    """
    outcome: RunOutcome = run_scenario(
        read_scenario(scenario, []),
        out=folder,
        options=RunOptions(duration, figures=False),
        progress=_Silent(),
    )
    if outcome.fault is not None:
        raise RuntimeError(f"{scenario}: {outcome.fault}")
    return folder / "recording.html"


def write_picture(view: View, moment: float, file: Path, left_out: Sequence[str] = ()) -> int:
    """Draw a recording at a time into a file, and return its size in bytes.

    Args:
        view: The recording.
        moment: Time of the run [s].
        file: WebP file to write.
        left_out: Scene paths of the parts that may lie outside the picture.
    """
    view.come_close([moment], SIZE, left_out)
    picture = view.picture(moment, SIZE)
    for quality in (90, 80, 65, 50):
        content = io.BytesIO()
        picture.save(content, "WEBP", quality=quality, method=6)
        if content.tell() < _LARGEST:
            break
    file.parent.mkdir(parents=True, exist_ok=True)
    return file.write_bytes(content.getvalue())


def write_film(views: Sequence[View], file: Path) -> int:
    """Draw the scenes side by side into an animated file, and return its size in bytes.

    Args:
        views: A recording for every scene.
        file: WebP file to write.
    """
    width, height = _SIDE
    for scene, view in zip(SCENES, views, strict=True):
        view.come_close(np.linspace(scene.begin, scene.end, 8), _SIDE, scene.left_out)
    frames = []
    for part in np.linspace(0.0, 1.0, _FRAMES):
        frame = Image.new("RGB", (width * len(views), height))
        for k, (scene, view) in enumerate(zip(SCENES, views, strict=True)):
            moment = scene.begin + part * (scene.end - scene.begin)
            frame.paste(view.picture(moment, _SIDE), (k * width, 0))
        frames.append(frame)
    first, *others = frames
    options = {"duration": _FRAME_TIME, "loop": 0, "quality": 70, "method": 4}
    first.save(file, "WEBP", save_all=True, append_images=others, **options)
    return file.stat().st_size


def main() -> None:
    """Draw the requested pictures."""
    parser = ArgumentParser(prog="python -m docs.pictures")
    parser.add_argument("scenarios", nargs="*", help="shipped ones; all by default")
    parser.add_argument("--film", action="store_true", help="the animated picture instead")
    arguments = parser.parse_args()
    logging.getLogger("drake").setLevel(logging.CRITICAL)
    console = Console(highlight=False)
    if arguments.film:
        recordings = [record_run(s.scenario, RUNS / "film" / s.scenario, s.end) for s in SCENES]
        with opened_browser() as browser:
            size = write_film([View(browser, recording) for recording in recordings], FILM)
        console.print(f"{FILM.name}: {size / 1e6:.2f} MB")
        return
    for name in arguments.scenarios or scenario_names():
        recording = record_run(name, RUNS / name, MOMENTS.get(name))
        with opened_browser() as browser:
            view = View(browser, recording)
            size = write_picture(
                view, view.duration, GALLERY / f"{name}.webp", LEFT_OUT.get(name, ())
            )
        console.print(f"{name}: {size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
