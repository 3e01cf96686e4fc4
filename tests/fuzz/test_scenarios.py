"""Scenarios and tables with something changed in them: each is a run in the end, or one line.

As many as fit into some seconds; ``make fuzz`` tries others for as long as one likes.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.cli import main
from experiments.preparation import prepare
from experiments.scenario_file import SCENARIO_DIRECTORY, ScenarioFile
from pfsc_drake.errors import MAX_MESSAGE, InputError
from pfsc_drake.yaml.reading import dump_yaml
from tests.fuzz.mutations import edited, edits, full_scenario, tables

pytestmark = pytest.mark.fuzz

# robots that are quickly made, with all blocks of a scenario between them
BASES = {
    "elastic": ("pfc_elastic_3r", "hand={}"),
    "boundary_layer": ("pfc_elastic_3r", "controller.law=singular_perturbation", "forces=[{}]"),
    "parallel": ("pfc_delta", "forces=[{force: [1, 0, 0]}]"),
    "contact": ("pfc_delta_notch",),
    "redundant": (
        "pfc_panda_7r",
        "controller.posture={task: limits, yields: observed}",
        "path.orientation.task=tool_axis",
        "pushes=[{link: link_3, way: [0, 0.1, 0]}]",
        "targets={}",
    ),
    "surface": ("sfc_viscoelastic_3r", "hand={frame: manifold}"),
    "scan": (
        "sfc_viscoelastic_3r",
        "surface.shape=!Fitted {file: surfaces/scanned_panel.csv, unit: mm, origin: [0.7, 0, 1.1]}",
        "reference={places: [[0, 0], [0.1, 0.05]]}",
    ),
}
ROWS = ["0.0,0.8,0.2,1.0,0,0.1,0", "0.3,0.75,0.1,1.05,0,0.2,0", "0.6,0.8,0,1.1,0,0.1,0.1"]


def prepared_or_line(data, folder=SCENARIO_DIRECTORY):
    """Return whether a scenario can run; if it cannot, check that one line says so."""
    file = ScenarioFile(folder / "mutated.yaml", data)
    try:
        prepare(file, None, recording=True, progress=lambda *_: None)
    except InputError as error:
        assert "\n" not in str(error)
        assert len(str(error)) <= MAX_MESSAGE
        assert "mutated.yaml" in str(error)
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
def test_scenarios_are_prepared_or_refused_in_one_line(guarded, examples, base):
    data = full_scenario(*BASES[base])
    assert prepared_or_line(data)

    @examples(6)
    @given(edits(data))
    def check(changes):
        with guarded():
            prepared_or_line(edited(data, changes))

    check()


@pytest.mark.slow(but="keys1")
@pytest.mark.parametrize("keys", [{}, {"tolerance": 1e-3}, {"corner_distance": 0.01}])
def test_tables_are_paths_or_refused_in_one_line(guarded, examples, tmp_path, keys):
    data = full_scenario("pfc_delta")
    shape = data["path"]["shape"]
    text = (SCENARIO_DIRECTORY / shape["file"]).read_text(encoding="utf-8")
    shape |= {"file": "points.csv", **keys}

    @examples(8)
    @given(tables(text))
    def check(table):
        (tmp_path / "points.csv").write_bytes(table)
        with guarded():
            prepared_or_line(data, tmp_path)

    check()


@pytest.mark.slow
def test_runs_end_with_a_status_and_one_line(guarded, examples, tmp_path, capfd):
    data = full_scenario("pfc_elastic_3r", "hand={}")
    file = tmp_path / "mutated.yaml"

    @examples(6)
    @given(edits(data), st.integers(0, 10**9))
    def check(changes, name):
        file.write_text(dump_yaml(edited(data, changes)), encoding="utf-8")
        capfd.readouterr()
        out = tmp_path / f"out_{name}"
        bare = ["--no-figures", "--no-recording", "--duration", "0.02"]
        with guarded():
            status = main(["run", str(file), "--out", str(out), *bare])
        stderr = capfd.readouterr().err
        assert status in (0, 2, 3), stderr
        assert stderr.count("\n") == (status != 0), stderr

    check()
