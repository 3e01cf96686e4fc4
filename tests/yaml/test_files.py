"""Names of files become absolute where the schema says that they are names of files."""

from dataclasses import dataclass, field
from pathlib import Path

from pfsc_drake.yaml.fields import FILE, NAME_OR_FILE
from pfsc_drake.yaml.reading import resolve_files


@dataclass
class Part:
    """Names of files, and text that looks like one."""

    file: str = field(default="", metadata=FILE)
    model: str = field(default="", metadata=NAME_OR_FILE)
    note: str = ""


@dataclass
class Whole:
    """Parts at all places."""

    part: Part = field(default_factory=Part)
    parts: list[Part] = field(default_factory=list)
    named: dict[str, Part] = field(default_factory=dict)
    packages: dict[str, str] = field(default_factory=dict, metadata=FILE)


def test_every_name_of_a_file_is_resolved(tmp_path: Path) -> None:
    whole = Whole(
        Part("points", "arm.sdf", "note.txt"),
        [Part("a/../b.csv", "comau"), Part("/c.csv", "package://arm/arm.urdf")],
        {"one": Part(model="d.yaml")},
        {"arm": "meshes"},
    )
    resolve_files(whole, tmp_path)
    assert whole.part == Part(f"{tmp_path}/points", f"{tmp_path}/arm.sdf", "note.txt")
    assert whole.parts[0] == Part(f"{tmp_path}/b.csv", "comau")
    assert whole.parts[1] == Part("/c.csv", "package://arm/arm.urdf")
    assert whole.named["one"] == Part(model=f"{tmp_path}/d.yaml")
    assert whole.packages == {"arm": f"{tmp_path}/meshes"}
