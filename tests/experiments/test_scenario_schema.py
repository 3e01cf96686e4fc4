"""The JSON schema of scenarios: current, true of all shipped ones, false of what is refused."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft7Validator

from diagrams.scenario import Scenario
from experiments.cli import main
from experiments.scenario_file import SCENARIO_DIRECTORY, apply_change, scenario_names
from pfsc_drake.checks import NUMBER
from pfsc_drake.yaml.dumping import changed_data, dump_typed
from pfsc_drake.yaml.json_schema import json_schema, tags_of
from pfsc_drake.yaml.reading import dump_yaml
from pfsc_drake.yaml.typed import load_file, load_typed

SCHEMA = SCENARIO_DIRECTORY / "scenario.schema.json"
VALIDATOR = Draft7Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))


class EditorLoader(yaml.SafeLoader):
    """Reads as editors do: without tags, and by YAML 1.2, where 1e-3 is a number."""


EditorLoader.add_implicit_resolver("tag:yaml.org,2002:float", NUMBER, list("-+.0123456789"))
EditorLoader.add_multi_constructor(
    "!", lambda loader, _, node: loader.construct_mapping(node, True)
)


def scenario(name: str, *changes: str) -> Any:
    text = (SCENARIO_DIRECTORY / f"{name}.yaml").read_text(encoding="utf-8")
    data = yaml.load(text, EditorLoader)
    for change in changes:
        key, _, value = change.partition("=")
        apply_change(data, key, yaml.load(value, EditorLoader))
    return data


@pytest.mark.parametrize("name", scenario_names())
def test_the_changed_keys_of_a_shipped_scenario_load_as_the_whole(name: str) -> None:
    settings = load_file(Scenario, SCENARIO_DIRECTORY / f"{name}.yaml")
    changed = changed_data(settings)
    assert dump_typed(load_typed(Scenario, changed, name)) == dump_typed(settings)
    assert len(dump_yaml(changed)) < 0.7 * len(dump_typed(settings))


def test_the_file_is_current(capsys: pytest.CaptureFixture[str]) -> None:
    """If not: ``python -m experiments schema > experiments/scenarios/scenario.schema.json``."""
    assert main(["schema"]) == 0
    assert capsys.readouterr().out == SCHEMA.read_text(encoding="utf-8")
    Draft7Validator.check_schema(json_schema(Scenario, "a"))


@pytest.mark.parametrize("name", scenario_names())
def test_each_shipped_scenario_is_valid(name: str) -> None:
    assert [error.message for error in VALIDATOR.iter_errors(scenario(name))] == []


@pytest.mark.parametrize(
    "change",
    [
        "controler.law=rigid",
        "start.ofset=[0, 0]",
        "path.shape=!Circle {radus: 1}",
        "path.orientation.keyframes=[{angels_deg: [1, 2, 3]}]",
        "duration=long",
        "duration=-1",
        "duration=1e300",
        "reference.points=0.5",
        "reference.points=[0, x]",
        "reference.points=[0.96]",
        "reference.velocity=0",
        "reference.velocity=null_",
        "controller=elastic",
        "controller.law=magic",
        "controller.sampling_time=0",
        "controller.delay=-0.1",
        "controller.gains.elastic.eta.tolerated_error=0.9",
        "robot=null",
        "robot.fixed_joints={one: much}",
        "name=3",
        "start.offset=[0.01]",
        "start.rotation_deg=[1, 2]",
        "simulation.integrator=magic",
        "simulation.frame_period=0",
        "hand={stiffness: 0}",
        "faults.effort_share=1.5",
        "model_error.mass=[]",
        "compliance.tangential={mass: {value: 1}}",
    ],
)
def test_what_the_reader_refuses_of_a_key_is_invalid(change: str) -> None:
    assert not VALIDATOR.is_valid(scenario("pfc_elastic_3r", change))


@pytest.mark.parametrize(
    "change",
    [
        "start.offset=0.01",
        "reference.points=[0, end, 1e-1]",
        "faults.overspeed=.inf",
        "controller.gains.elastic.eta={poles: auto}",
        "controller.delay=null",
        "hand={waypoints: [{time: 0}]}",
        "path.shape=!Line {start: [1, 0, 0]}",
    ],
)
def test_what_the_reader_takes_is_valid(change: str) -> None:
    assert VALIDATOR.is_valid(scenario("pfc_elastic_3r", change))


def test_editors_are_told_the_tags(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "--tags"]) == 0
    told = json.loads(capsys.readouterr().out)["yaml.customTags"]
    assert "!Circle mapping" in told
    assert {f"{tag} mapping" for tag in tags_of(Scenario)} == set(told)


def test_a_shipped_scenario_names_the_schema() -> None:
    first = (SCENARIO_DIRECTORY / "pfc_elastic_3r.yaml").read_text(encoding="utf-8").splitlines()[0]
    comment, _, path = first.partition("=")
    assert comment == "# yaml-language-server: $schema"
    assert (SCENARIO_DIRECTORY / Path(path)).resolve() == SCHEMA
