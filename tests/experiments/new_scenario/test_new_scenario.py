"""First scenarios from scripts and notebooks: the same as of the command line."""

import html

import numpy as np
import pytest

from experiments import NewScenario, init
from experiments.cli import main
from pfsc_drake import InputError
from tests.experiments.new_scenario.arms import TOOL, arc, arm


@pytest.fixture
def files(tmp_path):
    """Model without masses and points, in a folder whose name has a space."""
    folder = tmp_path / "my robot"
    folder.mkdir()
    (folder / "my arm.urdf").write_text(arm(inertial="", more=TOOL), encoding="utf-8")
    np.savetxt(folder / "points.csv", arc(), delimiter=",", header="x,y,z", comments="")
    return folder / "my arm.urdf", folder / "points.csv"


@pytest.mark.slow
def test_the_same_as_of_the_command_line(files, tmp_path, capfd):
    out = tmp_path / "mine.yaml"
    made = init(*files, out, orientation="free", quiet=True)
    assert isinstance(made, NewScenario)
    assert made.file == out
    text = out.read_text(encoding="utf-8")
    out.unlink()
    assert main(["init", *map(str, files), "--out", str(out), "--orientation", "free"]) == 0
    assert out.read_text(encoding="utf-8") == text
    printed = capfd.readouterr().out
    assert made.summary in printed
    for key, value, reason in made.choices:
        assert key in printed and value in printed and reason in printed

    assert set(made.deviations) == {"max_path_deviation"}
    assert 1e-9 < made.deviations["max_path_deviation"].value < 1e-3
    choices = {row.key: row for row in made.choices}
    assert choices["robot.tool_frame"].value == "tool0"
    assert choices["controller.law"].value == "velocity_servo"
    shown = html.unescape(made._repr_html_())
    assert f"<b>{out}</b>" in shown
    assert choices["controller.law"].reason in shown
    assert "max_path_deviation" in shown
    assert "tool0  (by its name)" in str(made.choices)

    with pytest.raises(InputError, match="exists; allowed: a new file"):
        init(*files, out, quiet=True)
    again = init(*files, out, orientation="free", replace=True, quiet=True)
    assert again.deviations == made.deviations


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"out": "mine.yml/mine.txt"}, "allowed: the name of a new YAML file"),
        ({"out": "nowhere/mine.yaml"}, "no folder nowhere; allowed: one that exists"),
        ({"base_position": (0.0, 1.0)}, "base_position = [0.0, 1.0]; allowed: three numbers"),
        ({"base_position": (0.0, 1.0, np.nan)}, "nan]; allowed: three numbers"),
        ({"unit": "km"}, "--unit km: allowed: m, cm, mm, inch"),
    ],
)
def test_refusals(files, options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        init(*files, **options, quiet=True)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not [*tmp_path.glob("*.yaml")]
