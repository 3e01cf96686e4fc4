"""Package content: an installed wheel and a clone find the same models."""

import dataclasses
import re
import shutil
import subprocess
import sys
import tomllib
import typing
from pathlib import Path

import pytest

import experiments
import identification
import pfsc_drake
from pfsc_drake import __version__
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.robot.models.files import models_directory

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WHEEL = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]

FIND_MODELS = """
import pfsc_drake
from pfsc_drake.robot.models.files import models_directory, resolve_model
print(pfsc_drake.__file__)
print(models_directory())
print(resolve_model("comau_racer_1_4_elastic_3r"))
"""


def imported_names(code):
    """Return what a program prints, run without the clone's folder on the path."""
    return subprocess.run(
        [sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True
    ).stdout.splitlines()


def test_models_of_a_clone():
    assert models_directory() == ROOT / "models"
    assert (ROOT / "models" / "package.xml").is_file()
    for name in ("", "_3r", "_elastic", "_elastic_3r"):
        file = ROOT / "models" / "comau_racer_1_4" / f"comau_racer_1_4{name}.sdf"
        assert file.is_file()


def test_wheel_carries_package_and_models():
    assert WHEEL["packages"] == ["pfsc_drake"]
    assert WHEEL["force-include"] == {"models": "pfsc_drake/models"}
    assert (ROOT / "pfsc_drake" / "py.typed").is_file()


@pytest.mark.parametrize("package", [pfsc_drake, experiments, identification])
def test_public_names_are_found_and_shown(package):
    assert len(package.__all__) > 4 and set(package.__all__) < set(dir(package))
    for name in package.__all__:
        assert getattr(package, name).__name__ == name
        assert name in vars(package)
    wrong = package.__all__[0] + "s"
    with pytest.raises(AttributeError, match=f"'{wrong}'; did you mean '{package.__all__[0]}'"):
        getattr(package, wrong)
    assert not hasattr(package, "__no_such_name__")


def classes_of(hint):
    """Return the project's dataclasses and abstract classes that a type hint mentions."""
    if isinstance(hint, type) and hint.__module__.startswith("pfsc_drake."):
        return {hint}
    return set().union(*map(classes_of, typing.get_args(hint)))


def test_all_argument_types_have_public_names():
    functions = [getattr(pfsc_drake, name) for name in pfsc_drake.__all__ if name[:4] == "add_"]
    assert len(functions) >= 5
    waiting, visited = [typing.get_type_hints(function) for function in functions], set()
    while waiting:
        for hint in waiting.pop().values():
            for found in classes_of(hint) - visited:
                visited.add(found)
                if dataclasses.is_dataclass(found):
                    waiting.append(typing.get_type_hints(found))
    assert {found.__name__ for found in visited} - {*pfsc_drake.__all__} == set()


def concrete_regions(base):
    for kind in base.__subclasses__():
        if not kind.__abstractmethods__:
            yield kind
        yield from concrete_regions(kind)


def test_all_regions_have_public_names():
    for name in pfsc_drake.__all__:
        getattr(pfsc_drake, name)
    kinds = {kind.__name__ for base in (Region, MovingRegion) for kind in concrete_regions(base)}
    assert len(kinds) >= 12
    assert {name for name in kinds if name[0] != "_"} <= {*pfsc_drake.__all__}


def test_models_of_a_wheel(tmp_path):
    """The folders as the wheel's configuration lays them out, away from the clone."""
    site = tmp_path / "site"
    hidden = shutil.ignore_patterns("__pycache__")
    for package in WHEEL["packages"]:
        shutil.copytree(ROOT / package, site / package, ignore=hidden)
    for source, target in WHEEL["force-include"].items():
        shutil.copytree(ROOT / source, site / target, ignore=hidden)
    code = f"import sys; sys.path.insert(0, {str(site)!r})\n{FIND_MODELS}"
    package, models, model = imported_names(code)
    assert Path(package) == site / "pfsc_drake" / "__init__.py"
    assert Path(models) == site / "pfsc_drake" / "models"
    assert Path(model).is_relative_to(site / "pfsc_drake" / "models")


def test_without_models_the_error_says_so(tmp_path):
    shutil.copytree(ROOT / "pfsc_drake", tmp_path / "pfsc_drake")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from pfsc_drake import InputError\n"
        "from pfsc_drake.robot.models.files import models_directory\n"
        "try:\n    models_directory()\nexcept InputError as error:\n    print(error)\n"
    )
    (message,) = imported_names(code)
    assert "robot models of pfsc_drake" in message


def test_the_library_stands_alone():
    """Nothing that only a clone has is imported by the library."""
    outside = ("diagrams", "experiments", "identification", "matplotlib", "h5py", "typer", "rich")
    pattern = re.compile(rf"^\s*(?:from|import)\s+({'|'.join(outside)})\b", re.MULTILINE)
    for file in sorted((ROOT / "pfsc_drake").rglob("*.py")):
        assert not pattern.search(file.read_text(encoding="utf-8")), file


def test_dependencies_are_declared():
    """Every package that the library imports is one that its installation brings."""
    declared = {re.split(r"[<>=~! ]", item)[0] for item in PROJECT["project"]["dependencies"]}
    names = {"pydrake": "drake", "yaml": "pyyaml"}
    pattern = re.compile(r"^(?:from|import)\s+(\w+)", re.MULTILINE)
    found = set()
    for file in (ROOT / "pfsc_drake").rglob("*.py"):
        found |= set(pattern.findall(file.read_text(encoding="utf-8")))
    third_party = found - sys.stdlib_module_names - {"pfsc_drake"}
    assert {names.get(name, name) for name in third_party} <= declared


def test_version_is_the_project_s():
    assert PROJECT["project"]["version"] == __version__
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(rf"^version: ['\"]?{re.escape(__version__)}['\"]?$", citation, re.MULTILINE)
    assert PROJECT["project"]["requires-python"] == ">=3.11"


def test_constraints_pin_every_dependency_without_an_address():
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    assert "://" not in text
    pinned = {
        line.split("==")[0].lower().replace("_", "-") for line in text.split() if "==" in line
    }
    requirements = list(PROJECT["project"]["dependencies"])
    for group in PROJECT["project"]["optional-dependencies"].values():
        requirements += group
    missing = {re.split(r"[<>=~! \[]", item)[0] for item in requirements} - pinned
    assert not missing


@pytest.mark.parametrize("name", ["README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff"])
def test_what_a_project_is_expected_to_have(name):
    assert (ROOT / name).stat().st_size > 100
