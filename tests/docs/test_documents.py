"""Whatever README and docs/*.md tell a reader to write is read, prepared, or run here."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

import experiments.cli
import identification.cli
from diagrams.builder import build_station
from diagrams.scenario import Scenario
from diagrams.tasks.task_geometry import make_surface
from experiments.scenario_file import read_scenario, scenario_names
from experiments.sweep.sweep import define_sweep
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.yaml.reading import TAG_KEY, parse_yaml
from pfsc_drake.yaml.typed import load_typed
from tests.docs.conftest import NO_FINGER
from tests.docs.documents import DOCUMENTS, ONE_OF, ROOT, Block, Command, blocks, commands

APPS = {"experiments": experiments.cli.app, "identification": identification.cli.app}


def _on_top(given: Any, part: Any) -> Any:
    """A scenario with a part of it said otherwise."""
    plain = isinstance(given, dict) and isinstance(part, dict)
    if not plain or TAG_KEY in part or given.get(TAG_KEY):
        return part
    return {**given, **{key: _on_top(given.get(key), value) for key, value in part.items()}}


def _alternatives(block: Block) -> list[str]:
    if not block.text.startswith(ONE_OF):
        return [block.text]
    return block.text.removeprefix(ONE_OF).splitlines()


def _settings(block: Block, text: str) -> Scenario:
    data = parse_yaml(text, block.place)
    if block.scenario:
        data = _on_top(read_scenario(block.scenario, []).data, data)
    return load_typed(Scenario, data, block.place)


def _named(item: Block | Command) -> str:
    return item.place if isinstance(item, Block) else str(item)


@pytest.mark.parametrize("block", blocks("yaml"), ids=_named)
def test_yaml(block: Block) -> None:
    """It is a scenario, or a part of one."""
    for text in _alternatives(block):
        _settings(block, text)


@pytest.mark.slow
@pytest.mark.parametrize("block", blocks("yaml"), ids=_named)
def test_yaml_is_built(block: Block, desk: Path) -> None:
    """A station is built; of alternatives, which stand elsewhere than the robot, the surface."""
    folder = desk / NO_FINGER if block.place.startswith("README") else desk
    for text in _alternatives(block):
        settings = _settings(block, text)
        if text is block.text:
            build_station(settings, folder)
        else:
            assert settings.surface is not None
            make_surface(settings.surface.shape, settings.controller.law, desk)


def test_every_kind_of_block_is_looked_at() -> None:
    # directives and executed cells of notebooks are looked at where the site is built
    known = {"yaml", "python", "sh", "bash", "text", ""}
    every = re.findall(r"^```([^\s`{]+)", "".join(f.read_text() for f in DOCUMENTS), re.MULTILINE)
    assert set(every) <= known
    assert len(blocks("yaml")) >= 8 and len(commands()) >= 30


def _options(command: Command) -> dict[str, Any]:
    """What the command line makes of a command, as its function gets it."""
    group: Any = typer.main.get_command(APPS[command.program])
    name, *words = command.words
    found = group.commands[name]
    if not words:  # the command is named, not given
        return {"command": name}
    with found.make_context(name, words) as context:
        return {"command": name, **context.params}


def _changed(command: Command) -> Scenario | None:
    """The shipped scenario of a command with what is given with it, unless nothing is."""
    options = _options(command)
    name, changes = options.get("scenario"), options.get("overrides") or []
    if name not in scenario_names():
        return None
    if options["command"] == "sweep":
        vary, draws = options["vary"], options["samples"]
        sweep = define_sweep(name, vary, overrides=changes, samples=draws, seed=0, duration=None)
        changes = [*changes, *sweep.samples[0].overrides]
    if not changes or any("=out/" in change for change in changes):
        return None
    return load_typed(Scenario, read_scenario(name, changes).data, str(command))


@pytest.mark.parametrize("command", commands(), ids=_named)
def test_commands(command: Command) -> None:
    """The command line takes it, and the scenario what is given with it."""
    _changed(command)


@pytest.mark.slow
@pytest.mark.parametrize("command", commands(), ids=_named)
def test_what_commands_change_is_built(command: Command, desk: Path) -> None:
    settings = _changed(command)
    if settings is not None:
        build_station(settings, desk)


def _guidance_rows() -> Iterator[tuple[str, tuple[str, ...]]]:
    """The rows of docs/howto/fixtures.md: a scenario, and letters that stand for changes."""
    text = (ROOT / "docs/howto/fixtures.md").read_text(encoding="utf-8")
    letters = dict(re.findall(r"^    ([A-Z])   (--set .*)$", text, re.MULTILINE))
    for name, said in re.findall(r"\| `(\w+)`((?: [A-Z])*) \|", text):
        changes = shlex.split(" ".join(letters[letter] for letter in said.split()))
        yield name, tuple(changes[1::2])


def test_rows_of_the_tables_of_fixtures() -> None:
    rows = list(_guidance_rows())
    assert len(rows) == 24
    for name, changes in rows:
        load_typed(Scenario, read_scenario(name, list(changes)).data, name)


def test_targets_of_make() -> None:
    wanted = re.findall(r"`?make (\w+)", "".join(file.read_text() for file in DOCUMENTS))
    known = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {"demo", "test"} <= set(wanted) & set(known)


def test_files_and_pages_that_are_referred_to() -> None:
    for file in DOCUMENTS:
        links = re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", file.read_text(encoding="utf-8"))
        for link in links:
            assert "://" in link or (file.parent / link).exists(), f"{file.name}: {link}"


def test_a_controller_in_a_diagram_of_ones_own(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk)
    (block,) = (block for block in blocks("python") if block.place.startswith("README"))
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    read_model(plant, Path("my_arm.urdf"), ModelOptions(fixed_joints={"finger": 0.02}))
    names: dict[str, Any] = {"builder": builder, "plant": plant}
    exec(compile(block.text, block.place, "exec"), names)
    kinds = [c.kind.value for c in names["follower"].followed.manifold.coordinates]
    assert kinds == ["eta", *["xi"] * 2, *["phi"] * 3]
    assert builder.Build().num_output_ports() == 0


def test_actuators_of_a_plant_of_ones_own(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk)
    block = next(block for block in blocks("python") if block.place.startswith("own_diagram"))
    names: dict[str, Any] = {}
    exec(compile(block.text, block.place, "exec"), names)
    plant = names["plant"]
    limits = {
        actuator.joint().name(): actuator.effort_limit()
        for actuator in map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
    }
    assert limits["pan"] == 330.0 and limits["wrist_3"] == 56.0 and len(limits) == 7


def _follower(number: int, desk: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the controller that a script of docs/howto/own_diagram.md adds."""
    monkeypatch.chdir(desk)
    block = [block for block in blocks("python") if block.place.startswith("own_diagram")][number]
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    read_model(plant, Path("my_arm.urdf"), ModelOptions(fixed_joints={"finger": 0.02}))
    names: dict[str, Any] = {"builder": builder, "plant": plant}
    exec(compile(block.text, block.place, "exec"), names)
    return names["follower"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "port"), [(1, "manifold_force"), (2, "mode")], ids=["compliance", "guidance"]
)
def test_controllers_in_diagrams(
    number: int, port: str, desk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    follower = _follower(number, desk, monkeypatch)
    assert follower.HasInputPort("wrench") and follower.HasOutputPort(port)
    result = follower.stepper().step(plant_state=follower.start_state, wrench=np.zeros(6))
    assert result["fault"][0] == 0.0


@pytest.mark.slow
def test_a_block_of_ones_own(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces across the path count without their first 2 N along each world axis."""
    follower = _follower(3, desk, monkeypatch)
    stepper, state = follower.stepper(), follower.start_state
    for force in (np.array([1.9, -1.9, 1.5]), np.array([7.0, -5.0, 1.0])):
        wrench = np.concatenate([force, np.zeros(3)])
        result = stepper.step(plant_state=state, wrench=wrench)
        axes = follower.task.manifold.axes(result["manifold_point"]).full()[:, 1:3]
        counted = np.sign(force) * np.maximum(np.abs(force) - 2.0, 0.0)
        np.testing.assert_allclose(result["manifold_force"][1:3], axes.T @ counted, atol=1e-9)


def test_edges_and_corners() -> None:
    (block,) = (block for block in blocks("python") if block.place.startswith("fixtures"))
    names: dict[str, Any] = {}
    exec(compile(block.text, block.place, "exec"), names)
    (edge,) = names["edges"]
    nodes = edge.curve.derivatives(np.linspace(*edge.curve.domain, 50), 0)[:, 0]
    np.testing.assert_allclose(np.hypot(nodes[:, 0], nodes[:, 1]), 0.2, atol=1e-9)
    np.testing.assert_allclose(nodes[:, 2], 0.0, atol=1e-9)
    # the tube's circle and the ball's have their radical axis at half the way of their middles
    y = np.sqrt(0.2**2 - 0.05**2)
    places = np.array(sorted(map(tuple, names["corners"])))
    np.testing.assert_allclose(places, [[0.05, -y, 0.0], [0.05, y, 0.0]], atol=1e-9)
