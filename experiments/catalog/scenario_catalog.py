"""Shipped scenarios: finding and listing them, quickly, without importing Drake."""

import difflib
import stat
from dataclasses import dataclass
from pathlib import Path

from pfsc_drake.errors import InputError, shortened
from pfsc_drake.yaml.reading import read_yaml
from pfsc_drake.yaml.text_file import find_status

SCENARIO_DIRECTORY = Path(__file__).resolve().parents[1] / "scenarios"


@dataclass
class CatalogEntry:
    """A shipped scenario as listed.

    Attributes:
        name: Name to run it by: the file's name without suffix.
        section: Section of the dissertation, e.g. ``"3.8.3"``.
        description: One line.
    """

    name: str
    section: str
    description: str


def scenario_names(directory: Path = SCENARIO_DIRECTORY) -> list[str]:
    """Names of the scenarios in a folder, sorted."""
    return sorted(path.stem for path in directory.glob("*.yaml"))


def find_scenario(name_or_path: str, directory: Path = SCENARIO_DIRECTORY) -> Path:
    """File of a scenario.

    Args:
        name_or_path: A shipped name, or the path of a YAML file (with a folder or a suffix).
        directory: Folder of the shipped scenarios.

    Returns:
        Path of an existing file.

    Raises:
        InputError: If there is none; names the nearest shipped name and all others.
    """
    names = scenario_names(directory)
    if name_or_path in names:
        return directory / f"{name_or_path}.yaml"
    path = expand_home(Path(name_or_path))
    status = find_status(path)
    is_folder = status is not None and stat.S_ISDIR(status.st_mode)
    if status is not None and not is_folder:
        return path  # reading says what is wrong with a pipe or a device
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        reason = "is a folder" if is_folder else "no such file"
        raise InputError(f"scenario file {shortened(name_or_path, 200)}: {reason}")
    nearest = difflib.get_close_matches(name_or_path, names, n=1, cutoff=0.5)
    hint = f"did you mean {nearest[0]!r}? " if nearest else ""
    wanted = shortened(repr(name_or_path))
    raise InputError(
        f"unknown scenario {wanted}: {hint}available: {', '.join(names) or 'none'},"
        " or the path of a YAML file"
    )


def expand_home(path: Path) -> Path:
    """Path with its leading ``~`` or ``~user`` replaced by the home folder.

    Raises:
        InputError: If there is no such home.
    """
    try:
        return path.expanduser()
    except RuntimeError:
        raise InputError(f"{path}: no home folder is known for {path.parts[0]}") from None


def list_scenarios(directory: Path = SCENARIO_DIRECTORY) -> list[CatalogEntry]:
    """Shipped scenarios with section and description, ordered by section, then name.

    Args:
        directory: Folder of the scenarios.

    Returns:
        One entry per YAML file, from its top-level keys ``section`` and ``description``.

    Raises:
        InputError: If a file cannot be read (see :func:`pfsc_drake.yaml.reading.read_yaml`).
    """
    entries = [_entry(directory / f"{name}.yaml") for name in scenario_names(directory)]
    return sorted(entries, key=lambda entry: (entry.section, entry.name))


def _entry(path: Path) -> CatalogEntry:
    """Catalog entry of one file."""
    data = read_yaml(path)
    description = " ".join(str(data.get("description", "")).split())
    return CatalogEntry(path.stem, str(data.get("section", "")), description)
