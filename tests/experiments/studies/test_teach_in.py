"""A path taught by hand and followed, shortened."""

import json

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.catalog.scenario_file import read_scenario
from experiments.cli import main
from experiments.studies.teach_in import write_teach_in
from experiments.teaching.options import TeachingOptions
from pfsc_drake.yaml.reading import dump_yaml

pytestmark = pytest.mark.slow

BARE = ("--no-figures", "--no-recording")
WAY = (
    "hand.waypoints=[{time: 0.3, position: [0.8, -0.36, 1.02], zyx_deg: [159.9, -14.3, -11.6]}, "
    "{time: 1.2, position: [0.86, -0.3, 1.03], zyx_deg: [163, -20, -5]}]"
)


def test_a_short_path(tmp_path):
    short = read_scenario("teach_by_hand_6r", [WAY, "hand.release=1.3", "duration=1.4"])
    file = tmp_path / "short.yaml"
    file.write_text(dump_yaml(short.data), encoding="utf-8")
    lines, out = [], tmp_path / "out"
    report = write_teach_in(
        out, lines.append, str(file), TeachingOptions(tolerance=5e-4, velocity=0.3), drawn=False
    )
    assert report.problem is None
    assert any("waypoints, a path of 0.08" in line for line in lines)
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    value = {name: metric["value"] for name, metric in metrics.items()}
    assert value["fit_distance_max"] <= 5e-4
    # the model is wrong by millimetres, and twice in the same way
    assert value["model_error_of_place"] > 2e-3
    assert value["model_error_left"] < 5e-5
    assert value["follow_from_taught_max"] < 1e-3
    assert value["largest_jerk_fitted"] <= value["largest_jerk_through_all"]
    with h5py.File(out / "guide" / "log.h5") as guide, h5py.File(out / "follow" / "log.h5") as run:
        # the tool itself goes where it went, from end to end
        for sample in (0, -1):
            assert run["y_t"][sample] == pytest.approx(guide["y_t"][sample], abs=3e-3)
        ends = Rotation.from_matrix([x["R_e"][-1].reshape(3, 3) for x in (guide, run)])
        assert (ends[0] * ends[1].inv()).magnitude() < np.deg2rad(2.0)
        whole = Rotation.from_matrix(guide["R_e"][0].reshape(3, 3)).inv() * ends[0]
        assert whole.magnitude() > np.deg2rad(6.0)


def test_a_torque_turns_a_tool_that_is_led(tmp_path):
    """Without stiffness at the rate torque / damping, 0.5 rad/s, about the torque's axis."""
    torque = "forces=[{begin: 0.2, end: 1.2, ramp: 0.05, torque: [0, 0, 1], force: [0, 0, 0]}]"
    changes = [text for change in ("hand=null", torque) for text in ("--set", change)]
    arguments = ["run", "teach_by_hand_6r", "--out", str(tmp_path / "run"), "--duration", "0.6"]
    assert main([*arguments, *BARE, *changes]) == 0
    with h5py.File(tmp_path / "run" / "log.h5") as log:
        t, R = log["t"][:], Rotation.from_matrix(log["R_e"][:].reshape(-1, 3, 3))
    # it is where it is asked to be, though not as it was at the start
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["max_orientation_error"]["value"] < 0.05
    assert (R[-1] * R[0].inv()).magnitude() > 0.15
    begin, end = np.searchsorted(t, [0.5, 0.6])
    turned = (R[end - 1] * R[begin].inv()).as_rotvec()
    assert turned == pytest.approx([0.0, 0.0, 0.5 * (t[end - 1] - t[begin])], abs=5e-3)
