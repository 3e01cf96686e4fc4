"""What a person draws becomes waypoints, and a session of it is repeated exactly."""

import json

import h5py
import numpy as np
import pytest

from diagrams.scenario import Scenario
from diagrams.tasks.arrivals import END, NEW_PATH, WAYPOINT, read_drawn, waypoint_messages
from experiments.cli import main
from experiments.live.page_server import Pages
from experiments.live.takes import DRAWING
from experiments.scenario_file import read_scenario
from pfsc_drake.control.streams.messages import StreamStatus, WaypointLayout
from pfsc_drake.errors import InputError
from reporting.progress import NoProgress
from tests.experiments.live.test_session import BARE, RECORD, Rehearsal
from tests.experiments.live.test_session import END as LEAVE

NAME = "pfc_draw_6r"


def arc(begin, end, count, radius=0.08):
    angles = np.linspace(begin, end, count)
    return np.stack([radius * np.sin(angles), radius * (1.0 - np.cos(angles))], axis=1)


class Drawing(Rehearsal):
    """A session with a person who draws, nine places every 50 ms."""

    def draw(self, strokes, leave):
        """Draw each stroke from its time on, with its first kind, and leave at a time."""
        script = []
        for begin, kind, stroke in strokes:
            for k, part in enumerate(np.array_split(stroke, max(1, len(stroke) // 9))):
                kinds = [kind if k == i == 0 else WAYPOINT for i in range(len(part))]
                places = [[*map(float, uv), what] for uv, what in zip(part, kinds, strict=True)]
                script.append((begin + 0.05 * k, {"draw": places}))
            last = [[*map(float, stroke[-1]), END]]
            script.append((begin + 0.05 * (len(stroke) // 9), {"draw": last}))
        script += [(leave - 0.01, {"set": {RECORD: 1.0}}), (leave, {"set": {LEAVE: 1.0}})]
        seen, script = [], sorted(script, key=lambda entry: entry[0])

        def follow():
            seen.append(self.status.content())
            while script and script[0][0] <= self.session.end + 1e-9:
                assert self._pages.hear(json.dumps({"client": "a"} | script.pop(0)[1]).encode())
            return False

        self.session.run(follow, NoProgress())
        return seen


def signals(folder):
    with h5py.File(folder / "log.h5") as file:
        return {name: dataset[:] for name, dataset in file.items()}


@pytest.mark.slow
def test_the_tool_follows_while_one_draws_and_a_take_is_repeated_to_the_last_bit(tmp_path, capsys):
    rehearsal = Drawing(tmp_path / "takes", NAME)
    first, second = arc(0.0, 2.5, 90, 0.1), arc(0.0, -2.0, 90) + np.array([0.05, 0.03])
    seen = rehearsal.draw([(0.1, WAYPOINT, first), (0.65, NEW_PATH, second)], 4.0)
    folder = next(iter(rehearsal.session.takes))
    log = signals(folder)
    told = [row["plane"] for row in seen if row["plane"] is not None]
    assert told[-1]["sent"] > 100
    assert any(row["status"] == StreamStatus.RUNNING.words for row in told)
    # it went over to the second stroke, and rests at its end
    end = np.array([0.95, -second[-1, 0], 1.0 + second[-1, 1]])
    assert np.linalg.norm(log["y_t"][-1] - end) < 3.1e-3
    off = [np.linalg.norm(log["y_t"][:, 1:] - [-u, 1.0 + v], axis=1).min() for u, v in first]
    assert max(off[:20]) < 2e-3
    assert off[-1] > 0.01
    assert np.linalg.norm(log["xi"], axis=1).max() < 1e-3

    again = tmp_path / "again"
    assert main(["run", str(folder / "scenario.yaml"), "--out", str(again), *BARE]) == 0
    capsys.readouterr()
    repeated = signals(again)
    assert log.keys() == repeated.keys()
    for name, values in log.items():
        assert values.tobytes() == repeated[name].tobytes(), name


def test_messages_of_a_drawing_are_those_that_were_told(tmp_path):
    name = tmp_path / DRAWING
    name.write_text("tick,kind,x,y,z\n10,0,1,2,3\n10,0,1.5,2,3\n30,1,4,5,6\n40,2,4,5,6\n")
    events = read_drawn(str(name), 3, 1e-3)
    assert [event.kind for event in events] == [WAYPOINT, WAYPOINT, NEW_PATH, END]
    ticks, rows = waypoint_messages(events, WaypointLayout(3, 4))
    assert ticks.tolist() == [0, 10, 10, 30, 40]
    assert rows[:, 0].tolist() == [0, 1, 2, 3, 3]
    assert rows[:, 1].tolist() == [0, 0, 0, 0, 1]
    assert rows[3, -4:].tolist() == [4, 5, 6, 1]


@pytest.mark.parametrize("bad", ["1", "[[1, 2]]", "[[1, 2, null]]", '[["a", 1, 0]]'])
def test_places_that_are_none_are_refused(bad):
    with pytest.raises(InputError, match="draw"):
        Pages().hear(f'{{"client": "a", "draw": {bad}}}'.encode())


def test_places_are_heard_once_and_only_of_who_leads():
    pages = Pages(lambda: 0.0)
    assert pages.hear(b'{"client": "a", "draw": [[0.1, 0.2, 0]]}')
    assert not pages.hear(b'{"client": "b", "draw": [[0.3, 0.2, 0]]}')
    assert pages.collect().strokes == [[0.1, 0.2, 0.0]]
    assert pages.collect().strokes == []


def test_the_shipped_drawing_is_left_out_of_a_live_session():
    from experiments.live.start import with_operator
    from pfsc_drake.yaml.typed import load_typed

    guided = with_operator(read_scenario(NAME, []))
    assert load_typed(Scenario, guided.data, "a").path.shape.inputs == ""
