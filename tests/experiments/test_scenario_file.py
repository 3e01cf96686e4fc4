"""Reading scenario files and overriding keys of them."""

import os
from pathlib import Path

import numpy as np
import pytest

from experiments.scenario_file import (
    CatalogEntry,
    ScenarioFile,
    apply_change,
    find_scenario,
    list_scenarios,
    load_scenario_data,
    read_scenario,
)
from pfsc_drake import InputError

TEXT = """\
_template: &gains {a: 1, b: [1.0, 2.0]}
name: made_up
duration: 2.0
path: !Lemniscate {size: 0.25}
controller:
  law: elastic
  first: *gains
  second: *gains
points: [[1, 2], [3, 4]]
"""


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "made_up.yaml"
    path.write_text(TEXT)
    return path


def test_tags_survive_and_private_keys_do_not(scenario):
    data = load_scenario_data(scenario, [])
    assert data["path"] == {"_tag": "!Lemniscate", "size": 0.25}
    assert "_template" not in data
    assert data["controller"]["second"] == {"a": 1, "b": [1.0, 2.0]}


@pytest.mark.parametrize(
    ("override", "keys", "value"),
    [
        ("duration=0.5", ["duration"], 0.5),
        ("controller.law=rigid", ["controller", "law"], "rigid"),
        ("points.1.0=-7", ["points", 1, 0], -7),
        ("points=[[0, 0]]", ["points"], [[0, 0]]),
        ("path=!Circle {radius: 1}", ["path"], {"_tag": "!Circle", "radius": 1}),
        ("path.size=2", ["path"], {"_tag": "!Lemniscate", "size": 2}),
        ("plant.tool.mass=1.5", ["plant", "tool", "mass"], 1.5),
        ("note=a=b", ["note"], "a=b"),
        ("note=", ["note"], None),
    ],
)
def test_overrides(scenario, override, keys, value):
    data = load_scenario_data(scenario, [override])
    for key in keys:
        data = data[key]
    assert data == value


def test_later_override_wins_and_the_rest_stays(scenario):
    data = load_scenario_data(scenario, ["duration=1", "duration=3"])
    assert data["duration"] == 3
    assert data["name"] == "made_up"


def test_override_changes_one_place_of_an_alias(scenario):
    data = load_scenario_data(scenario, ["controller.first.b.0=9"])
    assert data["controller"]["first"]["b"] == [9, 2.0]
    assert data["controller"]["second"]["b"] == [1.0, 2.0]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("duration", "--set duration: malformed; allowed: key.path=value"),
        ("=3", "--set =3: malformed"),
        ("a..b=3", "--set a..b=3: malformed"),
        ("points.2.0=1", "points is a list, '2' is no index of it; allowed: 0 to 1"),
        ("points.x=1", "points is a list, 'x' is no index of it; allowed: 0 to 1"),
        ("controller.law.x=1", "controller.law is 'elastic' and has no key 'x'"),
        ("a." * 2999 + "a=1", "3000 levels; allowed: up to 100"),
        ("a=" + "[" * 3000, "nested too deeply; allowed: up to 100 levels"),
        ("controller.law.x=" + "y" * 3000, "controller.law is 'elastic' and has no key 'x'"),
        ('name="a\\0b"', "holds a NUL"),
        ("duration=[1", "--set duration=[1: invalid YAML in line 1"),
    ],
)
def test_malformed_overrides(scenario, override, message):
    with pytest.raises(InputError) as caught:
        load_scenario_data(scenario, [override])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_whose_name_is_no_text_has_one(tmp_path):
    path = tmp_path / os.fsdecode(b"mine\xff.yaml")
    path.write_text("duration: 1\n")
    assert read_scenario(str(path), []).name == "mine\ufffd"


def test_inputs_are_the_file_and_whatever_it_may_name(scenario):
    inputs = ScenarioFile(scenario, {"a": "x.csv", "b": [{"c": "/y.urdf"}], "d": 1}).inputs()
    assert inputs == [scenario, scenario.parent / "x.csv", Path("/y.urdf")]


def test_read_scenario_knows_its_name(scenario):
    assert read_scenario(str(scenario), []).name == "made_up"
    scenario.write_text("duration: 1\n")
    loaded = read_scenario(str(scenario), ["duration=4"])
    assert (loaded.name, loaded.path, loaded.data) == ("made_up", scenario, {"duration": 4})


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pfc_delta.yaml").write_text(
        "name: pfc_delta\nsection: 3.8.1\ndescription: >\n  Two\n  lines\npath: !Circle {r: 1}\n"
    )
    (tmp_path / "pfc_elastic_3r.yaml").write_text("section: 3.8.3\ndescription: Three\n")
    (tmp_path / "a_demo.yaml").write_text("section: '4.8'\nlist: [!Tag {}]\n")
    (tmp_path / "notes.txt").write_text("no scenario")
    return tmp_path


def test_listing_is_ordered_by_section_and_reads_typed_files(folder):
    assert list_scenarios(folder) == [
        CatalogEntry("pfc_delta", "3.8.1", "Two lines"),
        CatalogEntry("pfc_elastic_3r", "3.8.3", "Three"),
        CatalogEntry("a_demo", "4.8", ""),
    ]


def test_broken_file_is_named(folder):
    (folder / "broken.yaml").write_text("a: [")
    with pytest.raises(InputError, match=r"broken\.yaml: invalid YAML in line 1"):
        list_scenarios(folder)


def test_shipped_name_and_path(folder, tmp_path):
    assert find_scenario("pfc_delta", folder) == folder / "pfc_delta.yaml"
    mine = tmp_path / "mine.yml"
    mine.write_text("{}")
    assert find_scenario(str(mine), folder) == mine


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("pfc_elastic3r", ["did you mean 'pfc_elastic_3r'?", "available: a_demo, pfc_delta"]),
        ("zzz", ["unknown scenario 'zzz': available: a_demo"]),
        ("missing.yaml", ["scenario file missing.yaml: no such file"]),
        ("some/where", ["scenario file some/where: no such file"]),
    ],
)
def test_unknown_names(folder, name, parts):
    with pytest.raises(InputError) as caught:
        find_scenario(name, folder)
    for part in parts:
        assert part in str(caught.value)


def test_nearest_is_only_suggested_when_near(folder):
    with pytest.raises(InputError) as caught:
        find_scenario("zzz", folder)
    assert "did you mean" not in str(caught.value)


def test_folder_is_no_scenario(folder):
    with pytest.raises(InputError, match="is a folder"):
        find_scenario(str(folder), folder)


@pytest.mark.parametrize("name", ["n" * 300, "n" * 300 + ".yaml", "a\0b", "a/b\0.yaml"])
def test_names_that_no_file_can_have(folder, name):
    with pytest.raises(InputError, match=r"unknown scenario|no such file") as caught:
        find_scenario(name, folder)
    assert len(str(caught.value)) < 500


def test_pipes_and_devices_are_found_and_not_read(folder, tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", Path("/dev/zero")):
        with pytest.raises(InputError, match="is a pipe, socket or device"):
            read_scenario(str(path), [])


def test_home(folder, monkeypatch):
    monkeypatch.setenv("HOME", str(folder))
    assert find_scenario("~/a_demo.yaml", folder / "none") == folder / "a_demo.yaml"
    with pytest.raises(InputError, match="no home folder is known for ~nobody_is_called_so"):
        find_scenario("~nobody_is_called_so/x.yaml", folder)


@pytest.mark.parametrize(
    ("value", "read"),
    [
        ("!Circle {radius: 1}", {"_tag": "!Circle", "radius": 1}),
        ("elastic", "elastic"),
        (np.array([[1.0, 2.0]]), [[1.0, 2.0]]),
        (np.float64(0.5), 0.5),
        ((1, True, None), [1, True, None]),
        ({"a": Path("b.csv")}, {"a": "b.csv"}),
    ],
)
def test_changes_are_values_of_python(scenario, value, read):
    data = load_scenario_data(scenario, [])
    apply_change(data, "controller.second.b", value)
    assert data["controller"] == {
        "law": "elastic",
        "first": {"a": 1, "b": [1.0, 2.0]},
        "second": {"a": 1, "b": read},
    }


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("a..b", 1, "change a..b = 1: malformed; allowed: key.path=value"),
        ("controller.law.x", 1, "controller.law is 'elastic' and has no key 'x'"),
        ("controller.law", {1}, "of type set; allowed: text, numbers, true or false, None"),
        ("points", [object()], "of type object; allowed"),
        ("duration", "[1", "invalid YAML in line 1"),
    ],
)
def test_wrong_changes(scenario, key, value, message):
    with pytest.raises(InputError) as caught:
        apply_change(load_scenario_data(scenario, []), key, value)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def locations_of(scenario, *overrides):
    return read_scenario(str(scenario), list(overrides)).locations


def test_keys_have_the_lines_of_their_file(scenario):
    locations = locations_of(scenario)
    lines = {"name": 2, "path": 4, "path.size": 4, "controller.law": 6, "points[1][0]": 9}
    assert {key: locations[key] for key in lines} == lines
    # an alias is written at its anchor
    assert (locations["controller.second"], locations["controller.second.b[1]"]) == (8, 1)


def test_overrides_replace_lines(scenario):
    locations = locations_of(scenario, "points.1.0=-7", "controller.second=3", "plant.tool.mass=1")
    assert locations["points[1][0]"] == "--set points.1.0=-7"
    assert locations["points[1][1]"] == locations["points[1]"] == 9
    assert locations["controller.second"] == "--set controller.second=3"
    assert "controller.second.b" not in locations
    assert locations["controller.first.b"] == 1
    assert locations["plant"] == locations["plant.tool.mass"] == "--set plant.tool.mass=1"


def test_a_long_override_is_shortened(scenario):
    found = locations_of(scenario, f"points=[{', '.join(['[0, 1]'] * 100)}]")["points"]
    assert len(found) <= 70
    assert found.startswith("--set points=[[0, 1], ")


def test_changes_of_python_are_named(scenario):
    loaded = read_scenario(str(scenario), [])
    loaded.change("points.0.1", 5)
    assert loaded.data["points"][0] == [1, 5]
    assert loaded.locations["points[0][1]"] == "change points.0.1 = 5"


def test_messages_name_the_file_and_the_line(scenario):
    source = read_scenario(str(scenario), ["path.file=points.csv"]).source
    assert str(source.refusal(["controller.law = magic"])) == (
        f"{scenario}:6: controller.law = magic"
    )
    missing = scenario.parent / "points.csv"
    assert str(source.refusal([f"{missing}: no such file"])) == (
        f"{scenario}: --set path.file=points.csv: path.file: {missing}: no such file"
    )
