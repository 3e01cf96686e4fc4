"""Finding and listing scenarios, on a folder of made-up ones."""

import os
from pathlib import Path

import pytest

from experiments.catalog.scenario_catalog import CatalogEntry, find_scenario, list_scenarios
from experiments.catalog.scenario_file import read_scenario
from pfsc_drake import InputError


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
