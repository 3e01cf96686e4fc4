"""The scenario that a run leaves repeats it to the last bit, wherever it stands."""

import shutil

import pytest

from experiments.scenario_file import find_scenario

pytestmark = pytest.mark.slow

CASES = {
    "vf_forbidden_region": (),  # planes, a paraboloid and a cylinder
    "vf_soft_region": (),
    "vf_moving_region": (),  # ways that swing and that visit, a box
    "teach_by_hand_6r": (),
    "vf_edge": (),  # two surfaces that meet
    "pfc_elastic_3r": ("controller.gains.elastic.xi={poles: auto, bandwidth: 20}",),
    "sfc_scan": (),  # points of a file
    "sfc_elastic_6r": (
        "surface.shape=!Plane {origin: [0.85, 0, 0.8]}",
        "start.theta=[0, 0]",
        "reference.places=[[0, 0], [0.1, 0]]",
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_a_repeated_run_has_the_same_log(run_scenario, tmp_path, monkeypatch, name):
    changes = [argument for change in CASES[name] for argument in ("--set", change)]
    first = run_scenario(tmp_path / "first", name, "--duration", "0.1", *changes)
    assert first.status == 0
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    copy = shutil.copy(first.folder / "scenario.yaml", elsewhere / "mine.yaml")
    second = run_scenario(tmp_path / "second", copy)
    assert second.status == 0
    assert first.log.keys() == second.log.keys()
    for signal, values in first.log.items():
        assert values.tobytes() == second[signal].tobytes(), signal
    assert (second.folder / "scenario.yaml").read_text() == copy.read_text()


def test_files_beside_a_scenario_are_found_from_its_copy(run_scenario, tmp_path, monkeypatch):
    """The points of a surface, the robot believed, and its friction."""
    mine = tmp_path / "mine"
    shutil.copytree(find_scenario("sfc_scan").parent / "surfaces", mine / "surfaces")
    scenario = shutil.copy(find_scenario("sfc_scan"), mine / "scan.yaml")
    parameters = find_scenario("sfc_scan").parents[2] / "models/comau_racer_1_4/parameters.yaml"
    shutil.copy(parameters, mine / "believed.yaml")
    changes = (
        "controller.friction.source=model",
        "controller.friction.nominal.file=believed.yaml",
        "friction.file=believed.yaml",
    )
    flags = [argument for change in changes for argument in ("--set", change)]
    first = run_scenario(tmp_path / "first", scenario, "--duration", "0.02", *flags)
    assert first.status == 0
    monkeypatch.chdir(tmp_path)
    again = run_scenario(tmp_path / "second", "first/scenario.yaml")
    assert again["q_J"].tobytes() == first["q_J"].tobytes()
