"""A whole session without a browser and faster than the clock: what is done is repeated exactly."""

import json

import h5py
import numpy as np
import pytest

from diagrams.environment.operator import read_controls
from experiments.cli import main
from experiments.live.live_simulation import RealTimeClock
from experiments.live.page_server import Pages
from experiments.live.session import LiveSession
from experiments.live.start import with_operator
from experiments.live.status import LiveStatus
from experiments.live.takes import TakeFolders
from experiments.preparation import prepare
from experiments.scenario_file import read_scenario
from reporting.progress import NoProgress

RESET, RECORD, END = "reset (X)", "record (C)", "end (Q)"
_OF_HAND = ("pull", "drag")
BARE = ("--no-figures", "--no-recording")


class Rehearsal:
    """A session with a person who follows a script: what is set, and when [s]."""

    def __init__(self, folder, name, *changes):
        scenario = with_operator(read_scenario(name, list(changes)))
        prepared = prepare(scenario, 60.0, recording=True, progress=NoProgress(), live=True)
        # a clock that stands still: nobody is silent
        self.status, self.said, self._pages = LiveStatus(name), [], Pages(lambda: 0.0)
        self._hand = {}
        self.session = LiveSession(
            prepared,
            self._pages,
            self.status,
            TakeFolders(folder, name, [], figures=False, recording=False),
            self.said.append,
            RealTimeClock(lambda: 0.0, lambda _: None),
        )

    def _say(self, changes):
        """A hand keeps pulling, until it pulls otherwise, lets go or a reset takes it off."""
        settings = {name: changes[name] for name in changes if not name.startswith(_OF_HAND)}
        self._hand |= {name: changes[name] for name in changes.keys() - settings.keys()}
        self._hand = {name: value for name, value in self._hand.items() if value is not None}
        if RESET in settings:
            self._hand = {}
        message = {"client": "a", "hand": self._hand, "set": settings}
        assert self._pages.hear(json.dumps(message).encode())

    def play(self, *script):
        left, seen = list(script), []

        def follow():
            """Called once per round; a reset puts the time back."""
            seen.append((self.session.end, self.status.phase, self.status.content()))
            while left and left[0][0](self):
                self._say(dict(left.pop(0)[1]))
            return False

        self.session.run(follow, NoProgress())
        assert not left
        return seen


def at(time, **sets):
    """What is set from a time on; names of sliders and buttons as they are labelled."""
    return (lambda rehearsal: rehearsal.session.end >= time - 1e-9), [
        (name, 1.0 if value is True else value) for name, value in sets.items()
    ]


def in_fault(*requests):
    return (lambda rehearsal: rehearsal.status.phase == "fault"), list(requests)


def datasets(folder):
    with h5py.File(folder / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}, dict(file.attrs)


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert values.tobytes() == other[name].tobytes(), name


@pytest.mark.slow
def test_a_take_is_repeated_to_the_last_bit(tmp_path, capsys):
    rehearsal = Rehearsal(tmp_path / "takes", "vf_soft_circle")
    seen = rehearsal.play(
        at(0.15, **{"pull z [N]": 30.0}),
        at(0.25, **{RESET: True}),
        ((lambda r: r.session.end < 0.1), []),  # after the reset
        at(0.4, **{"pull y [N]": 25.0, "pull z [N]": -15.0}),
        at(0.6, **{RECORD: True, "across k [N/m]": 1500.0}),
        at(0.8, **{"guide (K, J)": 0.0, "hold (T, G)": 1.0}),
        at(1.0, **{"guide (K, J)": 1.0, "along d [Ns/m]": 30.0, "hold dy [m]": 0.1}),
        at(1.3, **{RECORD: True}),
        at(1.45, **{END: True}),
    )
    first, second = rehearsal.session.takes
    log, attributes = datasets(first)
    assert attributes["recorded_from"] == "0.600 s"
    assert log["t"][-1] == pytest.approx(1.3)
    # led along, and off by what is asked; before the reset nothing counts
    assert log["wrench_ext"][350, 1] == 0.0
    assert log["wrench_ext"][790, 1] == pytest.approx(25.0, rel=0.01)
    assert log["eta"][-1, 0] > 0.05
    # two wishes, each for two time constants; back to the first one as far as it can be paid for
    free = (1500.0 + 3500.0 * np.exp(-2.0)) * np.exp(-2.0)
    assert log["stiffness"][1000, 1] == pytest.approx(free, rel=2e-3)
    assert 2.0 * free < log["stiffness"][-1, 1] <= 1500.0
    ticks, _ = read_controls(str(first / "operator.csv"), [], 1e-3)
    assert ticks[0] == 0
    assert ticks[1] == 400

    # a recording that stops does not disturb what goes on
    further, _ = datasets(second)
    assert further["t"][-1] == pytest.approx(1.45)
    assert_same(log, {name: values[: len(log["t"])] for name, values in further.items()})

    capsys.readouterr()
    again = tmp_path / "again"
    assert main(["run", str(second / "scenario.yaml"), "--out", str(again), *BARE]) == 0
    assert_same(further, datasets(again)[0])
    status = seen[-1][2]
    json.dumps(status, allow_nan=False)
    assert set(status["deviation"]) == {"xi_1", "xi_2"}


@pytest.mark.slow
def test_in_space_a_person_changes_the_damping_and_switches_regions(tmp_path):
    """Through the cylinder that is off, at a speed that the damping decides."""
    rehearsal = Rehearsal(tmp_path / "takes", "vf_forbidden_region")
    rehearsal.play(
        at(0.3, **{"region cylinder_1": 0.0, "pull x [N]": 20.0}),
        at(0.8, **{"along d [Ns/m]": 200.0}),
        at(1.1, **{END: True}),
    )
    folder = next(iter(rehearsal.session.takes))
    log, _ = datasets(folder)
    assert set(log["free_damping"][:790, 0]) == {90.0}
    assert set(log["free_damping"][820:, 0]) == {200.0}
    speed = log["velocity_command"][:, 0]
    assert speed[790] == pytest.approx(20.0 / 90.0, rel=0.05)
    assert speed[-1] == pytest.approx(20.0 / 200.0, rel=0.05)
    assert np.hypot(log["y_t"][-1, 0] - 0.9, log["y_t"][-1, 1]) > 0.25
    assert np.isnan(log["region_distance"][820:, 0]).all()
    metrics = json.loads((folder / "metrics.json").read_text())
    for name in ("deepest_violation", "audit_missed"):
        assert metrics[name]["value"] == 0.0
    for name in ("stationarity", "allowance", "energy", "tank"):
        assert metrics[f"audit_{name}"]["value"] < 1e-9
    sliders = {slider["name"] for slider in rehearsal.status.controls["sliders"]}
    assert "along d [Ns/m]" in sliders
    assert not any(" k [" in name for name in sliders)
    labels = {slider["label"] for slider in rehearsal.status.controls["sliders"]}
    assert "damping d, along [Ns/m]" in labels
    again = tmp_path / "again"
    assert main(["run", str(folder / "scenario.yaml"), "--out", str(again), *BARE]) == 0
    assert_same(log, datasets(again)[0])


@pytest.mark.slow
def test_a_person_afar_leads_the_tool_a_channel_later(tmp_path):
    """Pulled sideways from 0.6 s on; 100 ms later the tool follows, and the hand feels it."""
    rehearsal = Rehearsal(
        tmp_path / "takes",
        "teleop_region",
        "teleoperation.channel.jitter=0",
        "teleoperation.channel.loss=0",
    )
    rehearsal.play(at(0.6, **{"pull y [N]": 8.0}), at(1.6, **{END: True}))
    folder = next(iter(rehearsal.session.takes))
    log, _ = datasets(folder)
    y = log["y_t"][:, 1]
    assert np.ptp(y[400:700]) < 1e-4
    assert y[-1] - y[700] > 0.02
    assert log["leader_force"][-1, 1] < -4.0
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["audit_ports"]["value"] < 1e-12
    assert metrics["least_port_tank"]["value"] > 0.0
    assert rehearsal.status.force[1] < -4.0
    again = tmp_path / "again"
    assert main(["run", str(folder / "scenario.yaml"), "--out", str(again), *BARE]) == 0
    assert_same(log, datasets(again)[0])


@pytest.mark.slow
def test_a_leader_is_dragged_to_where_the_hand_is(tmp_path):
    """By 4 cm, let go of, and dragged on from there: the tool comes along."""
    rehearsal = Rehearsal(
        tmp_path / "takes",
        "teleop_region",
        "teleoperation.channel={delay: 0.02}",
    )
    rehearsal.play(
        at(0.5, **{"drag y [m]": 0.04}),
        at(1.1, **{"drag y [m]": None}),
        at(1.2, **{"drag y [m]": 0.03}),
        at(1.9, **{END: True}),
    )
    assert rehearsal.session._panel.content()["drag"] == 0.15
    log, _ = datasets(next(iter(rehearsal.session.takes)))
    y = log["y_t"][:, 1]
    assert y[-1] - y[0] == pytest.approx(0.07, abs=0.01)
    assert np.ptp(log["y_t"][:, 2]) < 2e-3


@pytest.mark.slow
def test_a_fault_stops_time_and_a_reset_goes_on(tmp_path):
    """A force sensor that fails at 0.3 s."""
    failing = "simulation.force_sensor_failure={time: 0.3, component: 0}"
    rehearsal = Rehearsal(tmp_path / "takes", "vf_soft_circle", failing)
    seen = rehearsal.play(
        at(0.1, **{RECORD: True}),
        in_fault(),
        in_fault((RESET, 1.0)),
        ((lambda r: r.status.phase == "running" and r.session.end < 0.1), []),
        in_fault((END, 1.0)),
    )
    stopped = [entry for entry in seen if entry[1] == "fault"]
    assert len({entry[0] for entry in stopped}) == 1
    assert stopped[0][0] == pytest.approx(0.31, abs=0.011)
    assert "Press X to reset" in stopped[0][2]["message"]
    assert rehearsal.session.fault is not None
    assert any(line.startswith("fault: ") for line in rehearsal.said)
    assert list(rehearsal.session.takes.values())[-1].fault == rehearsal.session.fault
    # a recording that a reset ends is kept, what was done after it when the session ends
    recorded, last = rehearsal.session.takes
    assert datasets(recorded)[1]["recorded_from"] == "0.100 s"
    log, attributes = datasets(last)
    assert "recorded_from" not in attributes
    assert attributes["fault"] in stopped[0][2]["message"]
    scenario = list(rehearsal.session.takes)[-1] / "scenario.yaml"
    again = tmp_path / "again"
    assert main(["run", str(scenario), "--out", str(again), *BARE]) == 3
    assert_same(log, datasets(again)[0])
    assert np.isfinite(log["q_J"]).all()


@pytest.mark.slow
def test_who_does_nothing_leaves_nothing(tmp_path):
    rehearsal = Rehearsal(tmp_path / "takes", "vf_soft_circle")
    rehearsal.play(((lambda _: True), [(END, 1.0)]))
    assert not rehearsal.session.takes
    assert not (tmp_path / "takes").exists()


@pytest.mark.slow
def test_what_was_done_is_kept_even_if_the_session_breaks(tmp_path):
    rehearsal = Rehearsal(tmp_path / "takes", "vf_soft_circle")

    def draw(*_, **__):
        if rehearsal.session.end > 0.1:
            raise ValueError("something else")

    rehearsal.session._scene.draw = draw
    with pytest.raises(ValueError, match="something else"):
        rehearsal.play(at(0.05, **{"pull z [N]": 30.0}))
    (takes,) = rehearsal.session.takes
    assert (takes / "log.h5").exists()
