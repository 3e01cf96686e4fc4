"""Generated pages: nothing is missing, units are in their column."""

import dataclasses as dc
import re
import typing

import pytest
import typer

import experiments
import experiments.cli
import identification.cli
import pfsc_drake
from diagrams.scenario import Scenario
from docs.making.commands import command_line
from docs.making.gallery import first_sentence, gallery
from docs.making.interface import interface
from docs.making.scenario_keys import scenario_keys, unit_and_meaning
from docs.making.text import as_markdown, attribute, cell
from experiments.scenario_file import scenario_names
from reporting.registry import SIGNALS
from tests.docs.documents import ROOT


def _classes(kind: object) -> set[type]:
    if dc.is_dataclass(kind) and isinstance(kind, type):
        inside = typing.get_type_hints(kind).values()
        return {kind}.union(*map(_classes, inside))
    return set().union(*map(_classes, typing.get_args(kind)))


def test_every_key_of_a_scenario_is_documented() -> None:
    page = scenario_keys()
    owners = _classes(Scenario)
    assert len(owners) > 80
    for owner in owners - {Scenario}:
        section = page.split(f"(keys-{owner.__name__.lower()})=")
        assert len(section) == 2, owner
        rows = re.findall(r"^\| `(\w+)` \|", section[1].split("\n(keys-")[0], re.MULTILINE)
        assert rows[: len(dc.fields(owner))] == [field.name for field in dc.fields(owner)]
    assert set(re.findall(r"\(#(keys-\w+)\)", page)) <= set(re.findall(r"\((keys-\w+)\)=", page))


@pytest.mark.parametrize(
    "row",
    [
        "| `velocity` | number or `null` | m/s | `null` | Largest velocity, 1e-6 to 1e3;",
        "| `radius` | number | m | `0.15` | Radius, 1e-4 to 1e4. |",
        "| `mass` | [block](#keys-profile) | kg or kg m^2 | *required* | `m`, positive. |",
        "| `stiffness` | number, or list of numbers |",
        "| `file` | file |  | empty |",
        "| `source` | `none` or `model` or `observer` |",
        "| `poles` | `auto`, or list of numbers |",
        "| `hand` | [block](#keys-handparameters) or `null` |  | `null` |",
        "[`!Profile`](#keys-profile), [`!SlowEnds`](#keys-slowends)",
    ],
)
def test_rows_of_keys(row: str) -> None:
    assert row in scenario_keys()


@pytest.mark.parametrize(
    ("text", "name", "expected"),
    [
        ("Radius [m], positive.", "radius", ("m", "Radius, positive.")),
        ("[m], of a turn [deg].", "amplitude", ("m or deg", "Amplitude [m], of a turn [deg].")),
        ("Angles [deg]: ``[0, 0, 180]``.", "a", ("deg", "Angles: ``[0, 0, 180]``.")),
        ("Variance [(Nm s)^2].", "noise", ("(Nm s)^2", "Variance.")),
        ("Rests, ``[x, y]`` each.", "rests", ("", "Rests, ``[x, y]`` each.")),
        ("Posture.", "posture_deg", ("deg", "Posture.")),
        ("[kg].", "rotor_mass", ("kg", "Rotor mass.")),
        ("Share.", "share", ("", "Share.")),
    ],
)
def test_units(text: str, name: str, expected: tuple[str, str]) -> None:
    assert unit_and_meaning(text, name) == expected


def test_text_of_docstrings() -> None:
    assert (
        as_markdown("See :class:`~a.b.C`, ``|x|`` and a*b < $c.")
        == r"See `C`, `|x|` and a\*b \< \$c."
    )
    assert cell("``|x|`` or\n    more") == r"`\|x\|` or more"


def test_an_attribute_without_a_docstring_is_an_error() -> None:
    @dc.dataclass
    class Silent:
        """Class without attribute docstrings."""

        key: float = 0.0

    with pytest.raises(ValueError, match=r"Silent\.key: has no docstring"):
        attribute(Silent, "key")


def test_every_command_and_option_is_documented() -> None:
    page = command_line()
    for program, app in (
        ("experiments", experiments.cli.app),
        ("identification", identification.cli.app),
    ):
        group: typing.Any = typer.main.get_command(app)
        for name, command in group.commands.items():
            if hasattr(command, "commands"):  # documented as a program of its own
                continue
            section = page.split(f"({program}-{name})=")[1].split("\n(")[0]
            for parameter in command.params:
                for option in parameter.opts if parameter.param_type_name == "option" else []:
                    assert f"`{option}" in section, (name, option)


def test_the_gallery_has_every_scenario() -> None:
    cards = re.findall(r"grid-item-card\} `(\w+)`", gallery())
    assert sorted(cards) == sorted(scenario_names())
    assert (
        first_sentence("Six axes\n at 1.5 m/s; a hand. And more.") == "Six axes at 1.5 m/s; a hand."
    )
    assert first_sentence("Six axes") == "Six axes"


def test_every_public_name_is_documented() -> None:
    page = interface()
    for module in (pfsc_drake, experiments):
        for name in getattr(module, "__all__", []):
            if name[0] != "_":
                assert f":: {module.__name__}.{name}" in page


def test_symbols_of_the_glossary_are_signals() -> None:
    page = (ROOT / "docs/reference/glossary.md").read_text(encoding="utf-8")
    named = {
        name
        for row in page.split("## Symbols")[1].splitlines()
        if len(row.split("|")) > 2
        for name in re.findall(r"`(\w+)`", row.split("|")[2])
    }
    assert {"eta", "tau_J"} <= named <= set(SIGNALS)
