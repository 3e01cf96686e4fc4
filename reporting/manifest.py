"""What of a folder belongs to earlier results, and what of it is somebody else's.

Beside results stands ``manifest.json``: their kind, and the SHA-256 of each file. What it lists,
and what still has that content, may be replaced by later results of the same kind. Everything else
that bears a result's name is in the way, and so are results of another kind, and inputs.

A file that is still added to is listed as growing; whatever it holds may be replaced.

A folder without manifest counts as that of a run of version 0.1 if it holds nothing but files that
this version wrote, and a log that says so.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import h5py

from pfsc_drake.yaml.text_file import find_status

MANIFEST = "manifest.json"
FIGURES = "figures"
RESULTS = (
    "scenario.yaml",
    "operator.csv",
    "log.h5",
    "metrics.json",
    "recording.html",
    "report.html",
    "margins.json",
    "sweep.json",
    "sweep.csv",
    "sweep.parquet",
    "taught.csv",
    "follow.yaml",
)
GROWING = "growing"  # instead of a checksum
UNFINISHED = ".unfinished"  # a file while it is being written

_FIGURE = re.compile(rf"{FIGURES}/\w+\.png")
_PROGRAM = "pfsc_drake"
# of version 0.1
_EARLIER_ATTRIBUTES = {"scenario", "git_revision", "drake_version", "casadi_version"}
_EARLIER_FIGURES = (
    "path",
    "progress",
    "transversal",
    "orientation",
    "angles",
    "forces",
    "notch",
    "velocities",
    "drive_torques",
    "friction",
    "deflection",
)


def manifest_text(kind: str, checksums: Mapping[str, str]) -> str:
    """Returns the content of a manifest.

    Args:
        kind: Kind of results, e.g. ``run``.
        checksums: SHA-256 of each file, or GROWING, by its name in the folder.
    """
    content = {"program": _PROGRAM, "results": kind, "files": dict(checksums)}
    return json.dumps(content, indent=2) + "\n"


def earlier_results(folder: Path) -> list[str]:
    """Returns the names of the files of earlier results, manifest included.

    Args:
        folder: That :func:`find_obstacle` has nothing to say against.
    """
    manifest = _read_manifest(folder)
    if manifest is None:
        return _files_of_earlier_version(folder)
    return [*manifest[1], UNFINISHED, MANIFEST]


def listed_results(folder: Path) -> dict[str, str]:
    """Returns what the manifest of a folder lists, see :func:`manifest_text`; nothing without one.

    Args:
        folder: That :func:`find_obstacle` has nothing to say against.
    """
    manifest = _read_manifest(folder)
    return {} if manifest is None else {name: entry for name, entry in manifest[1].items() if entry}


def find_obstacle(folder: Path, kind: str, inputs: Sequence[Path]) -> str | None:
    """Returns why results must not be written into a folder; None if they may.

    Args:
        folder: An existing folder.
        kind: Kind of results.
        inputs: Files that the results are made from.

    Raises:
        OSError: If the folder cannot be read.
    """
    names = _names(folder)
    for name in (*RESULTS, MANIFEST):
        if any(_is_same(folder / name, source) for source in inputs):
            return f"its {name} is an input of this {kind}"
    manifest = _read_manifest(folder)
    if manifest is None:
        own = dict.fromkeys(_files_of_earlier_version(folder))
        kind_there = "run" if own else kind
    else:
        kind_there, own = manifest
        own = {**own, MANIFEST: None, UNFINISHED: None}
    if kind_there != kind:
        return f"it holds the results of a {kind_there}"
    for name in _named_like_results(folder, names):
        if name not in own:
            return f"it holds {name}, which no {kind} has written"
        checksum = own[name]
        if checksum == GROWING:
            checksum = _checksum(folder / name) or GROWING  # no regular file: it matches nothing
        if checksum is not None and _checksum(folder / name) != checksum:
            return f"its {name} was changed after the {kind} that wrote it"
    return None


def _named_like_results(folder: Path, names: Sequence[str]) -> list[str]:
    """Everything of a folder that stands where results do."""
    found = [name for name in (*RESULTS, MANIFEST, UNFINISHED) if name in names]
    if FIGURES in names:
        figures = folder / FIGURES
        if figures.is_symlink() or not figures.is_dir():
            return [*found, FIGURES]
        found += sorted(f"{FIGURES}/{name}" for name in _names(figures))
    return found


def _read_manifest(folder: Path) -> tuple[str, dict[str, str | None]] | None:
    """Kind of results and checksums by file; None without manifest of this program."""
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if content["program"] != _PROGRAM:
            return None
        kind, checksums = str(content["results"]), dict(content["files"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    # a manifest is a file like any other: it cannot name what no result is called
    known = (name for name in checksums if name in RESULTS or _FIGURE.fullmatch(name))
    return kind, {name: str(checksums[name]) for name in known}


def _files_of_earlier_version(folder: Path) -> list[str]:
    """Names of the files if all of the folder was written by a run of version 0.1, else none."""
    names = _names(folder)
    known = {*RESULTS, *(f"{FIGURES}/{name}.png" for name in _EARLIER_FIGURES)}
    found = _named_like_results(folder, names)
    if "log.h5" not in found or not set(found) <= known or not {*names} <= {*RESULTS, FIGURES}:
        return []
    try:
        with h5py.File(folder / "log.h5", "r") as log:
            return found if set(log.attrs) >= _EARLIER_ATTRIBUTES else []
    except OSError:
        return []


def _names(folder: Path) -> list[str]:
    """Names of everything in a folder."""
    return [entry.name for entry in folder.iterdir()]


def _checksum(file: Path) -> str:
    """SHA-256 of a regular file, nothing of anything else."""
    if file.is_symlink() or not file.is_file():
        return ""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _is_same(file: Path, other: Path) -> bool:
    """Whether both names stand for one file; names that no file can have stand for none."""
    one, two = find_status(file), find_status(other)
    return one is not None and two is not None and os.path.samestat(one, two)
