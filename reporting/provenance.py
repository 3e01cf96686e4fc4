"""Provenance of a run: scenario, sources, libraries; and the list of its files."""

import json
import os
import re
import subprocess
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from pfsc_drake.codegen.manifest import MANIFEST as MANIFEST
from pfsc_drake.codegen.manifest import manifest_text as manifest_text
from pfsc_drake.codegen.manifest import read_manifest
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import find_status

PROJECT_ROOT = Path(__file__).resolve().parents[1]


def standard_attributes(scenario_name: str) -> dict[str, str]:
    """Return the attributes of every log and report.

    Args:
        scenario_name: Name of the scenario.

    Returns:
        ``scenario``, ``git_revision`` and one ``<library>_version`` each for pfsc_drake, drake,
        casadi and numpy (``unknown`` if not installed).
    """
    versions = {
        f"{library}_version": _version(library)
        for library in ("pfsc_drake", "drake", "casadi", "numpy")
    }
    return {"scenario": scenario_name, "git_revision": git_revision(), **versions}


def version_line() -> str:
    """Return versions and revision in one line, for ``--version``."""
    known = standard_attributes("")
    libraries = f"Drake {known['drake_version']}, CasADi {known['casadi_version']}"
    return f"{_PROGRAM} {known['pfsc_drake_version']}, {libraries}, git {known['git_revision']}"


def git_revision(root: Path = PROJECT_ROOT) -> str:
    """Return the revision of the clone in ``root``.

    Args:
        root: Top folder of the clone.

    Returns:
        The commit's hash, with ``+dirty`` if tracked files differ from it; ``unknown`` if ``root``
        is not the top folder of a clone with a commit, or git is missing.
    """
    top = _git(root, "rev-parse", "--show-toplevel")
    revision = _git(root, "rev-parse", "--verify", "HEAD")
    if not top or not revision or Path(top).resolve() != root.resolve():
        return "unknown"
    changes = _git(root, "status", "--porcelain", "--untracked-files=no")
    return f"{revision}+dirty" if changes else revision


def _git(root: Path, *arguments: str) -> str | None:
    """Return the output of a git command in ``root``, None if it failed."""
    try:
        result = subprocess.run(
            ["git", "-C", str(root), *arguments],
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip()


def _version(distribution: str) -> str:
    """Return the installed version of a distribution."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "unknown"


FIGURES = "figures"
RESULTS = (
    "scenario.yaml",
    "operator.csv",
    "drawing.csv",
    "log.h5",
    "metrics.json",
    "recording.html",
    "excitation.html",
    "report.html",
    "margins.json",
    "sweep.json",
    "sweep.csv",
    "sweep.parquet",
    "taught.csv",
    "follow.yaml",
)
UNFINISHED = ".unfinished"  # a file while it is being written
STAGED = ".next"  # folder of new results until they are complete
READY = ".ready"  # and then, until they have replaced the earlier ones

_FIGURE = re.compile(rf"{FIGURES}/\w+\.png")
_PROGRAM = "pfsc_drake"


def listed_results(folder: Path) -> list[str]:
    """Return the names of the files that the manifest of a folder lists; none without one.

    Args:
        folder: Folder accepted by :func:`find_obstacle`.
    """
    manifest = _read_manifest(folder)
    return [] if manifest is None else manifest[1]


def kind_of_results(folder: Path) -> str | None:
    """Return the kind of results that the manifest of a folder names; None without one."""
    manifest = _read_manifest(folder)
    return None if manifest is None else manifest[0]


def is_result(name: str) -> bool:
    """Return whether a name is allowed for a file of results."""
    return name in RESULTS or _FIGURE.fullmatch(name) is not None


def read_outcome(folder: Path, kind: str) -> dict[str, Any]:
    """Return the outcome stored in a folder of results; empty if there is none.

    Args:
        folder: The folder.
        kind: Kind of results, e.g. ``run``.

    Raises:
        InputError: If the folder contains no results of this kind.
    """
    manifest = _read_manifest(folder)
    if manifest is None or manifest[0] != kind:
        there = "no results" if manifest is None else f"the results of a {manifest[0]}"
        raise InputError(f"{folder}: holds {there}; allowed: the folder of a {kind}")
    outcome = json.loads((folder / MANIFEST).read_text(encoding="utf-8")).get("outcome")
    return outcome if isinstance(outcome, dict) else {}


def find_obstacle(folder: Path, kind: str, inputs: Sequence[Path]) -> str | None:
    """Return why results must not be written into a folder; None if they may.

    Args:
        folder: An existing folder.
        kind: Kind of results.
        inputs: Input files of the results.

    Raises:
        OSError: If the folder cannot be read.
    """
    names = _names(folder)
    for name in (*RESULTS, MANIFEST):
        if any(_is_same(folder / name, source) for source in inputs):
            return f"its {name} is an input of this {kind}"
    manifest = _read_manifest(folder)
    kind_there, own = (kind, []) if manifest is None else manifest
    if kind_there != kind:
        return f"it holds the results of a {kind_there}"
    if manifest is not None:
        own = [*own, MANIFEST, UNFINISHED]
    for name in _named_like_results(folder, names):
        if name not in own or not _is_regular(folder / name):
            return f"it holds {name}, which no {kind} has written"
    for name in (STAGED, READY):
        if name in names and not _is_staging(folder / name, kind):
            return f"it holds {name}, which no {kind} has written"
    return None


def _is_staging(folder: Path, kind: str) -> bool:
    """Return whether a folder contains nothing but new results of a kind."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    known = {MANIFEST, UNFINISHED, FIGURES, *listed_results(folder)}
    names = set(_names(folder))
    if FIGURES in names and not (folder / FIGURES).is_dir():
        return False
    names |= set(_named_like_results(folder, [*names]))
    return kind_of_results(folder) in (kind, None) and names <= known


def _named_like_results(folder: Path, names: Sequence[str]) -> list[str]:
    """Return all entries of a folder with names of results."""
    found = [name for name in (*RESULTS, MANIFEST, UNFINISHED) if name in names]
    if FIGURES in names:
        figures = folder / FIGURES
        if figures.is_symlink() or not figures.is_dir():
            return [*found, FIGURES]
        found += sorted(f"{FIGURES}/{name}" for name in _names(figures))
    return found


def _read_manifest(folder: Path) -> tuple[str, list[str]] | None:
    """Return the kind of results and the names of their files; None without a valid manifest."""
    manifest = read_manifest(folder)
    if manifest is None:
        return None
    # a manifest is a file like any other: names that no result has are ignored
    kind, names = manifest
    return kind, [name for name in names if is_result(name)]


def _names(folder: Path) -> list[str]:
    """Return the names of all entries of a folder."""
    return [entry.name for entry in folder.iterdir()]


def _is_regular(file: Path) -> bool:
    return file.is_file() and not file.is_symlink()


def _is_same(file: Path, other: Path) -> bool:
    """Return whether both names are the same file; names that no file can have are none."""
    one, two = find_status(file), find_status(other)
    return one is not None and two is not None and os.path.samestat(one, two)
