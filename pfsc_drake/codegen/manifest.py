"""Manifest of a folder: the files that this program has written."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pfsc_drake.errors import InputError

MANIFEST = "manifest.json"
_PROGRAM = "pfsc_drake"
_EXPORT = "controller"


def manifest_text(
    kind: str,
    files: Iterable[str] | Mapping[str, list[str]],
    outcome: Mapping[str, Any] | None = None,
) -> str:
    """Return the content of a manifest.

    Args:
        kind: Kind of results, e.g. ``run``.
        files: Their names in the folder, optionally with the SHA-256 that each may have.
        outcome: Outcome, if any.
    """
    listed = dict(files) if isinstance(files, Mapping) else list(files)
    content: dict[str, Any] = {"program": _PROGRAM, "results": kind, "files": listed}
    if outcome is not None:
        content["outcome"] = dict(outcome)
    return json.dumps(content, indent=2) + "\n"


def read_manifest(folder: Path) -> tuple[str, dict[str, list[str]]] | None:
    """Return the kind of results, and the names of their files with SHA-256, from a manifest.

    None without a manifest of this program.
    """
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if content["program"] != _PROGRAM:
            return None
        kind, files = str(content["results"]), content["files"]
        if isinstance(files, dict):
            return kind, {str(name): [str(d) for d in digests] for name, digests in files.items()}
        return kind, {str(name): [] for name in files}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def refuse_foreign(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder where files of an export would replace others; change nothing.

    Args:
        folder: The folder, which may be missing.
        names: Names of the files of the export.

    Raises:
        InputError: If it contains a file that no export has written, or that was changed since.
    """
    if (folder.is_symlink() or folder.exists()) and not folder.is_dir():
        raise InputError(f"{folder}: is no folder; allowed: a folder")
    kind, own = read_manifest(folder) or (_EXPORT, {})
    if kind != _EXPORT:
        raise InputError(f"{folder}: holds the results of a {kind}; allowed: another folder")
    for name in names:
        file = folder / name
        if not file.is_symlink() and not file.exists():
            continue
        if name == MANIFEST and own:
            continue
        if name not in own or file.is_symlink() or not file.is_file():
            raise InputError(
                f"{folder}: holds {name}, which no export has written; allowed: another folder"
            )
        if _digest(file.read_bytes()) not in own[name]:
            raise InputError(
                f"{folder}: its {name} has been changed since the export that wrote it; allowed: "
                "another folder, or the file away"
            )


def write_own(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write the files of an export, and the manifest that lists them; return all.

    Args:
        folder: Folder accepted by :func:`refuse_foreign`; created if it is missing.
        files: Contents by name.

    Raises:
        InputError: If the folder cannot be written.
    """
    digests = {name: [_digest(content)] for name, content in files.items()}
    _, before = read_manifest(folder) or (_EXPORT, {})
    either = {name: before.get(name, []) + digests.get(name, []) for name in (*before, *digests)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # listed first, so that a file is known as an export's whenever the process ends
        _write(folder / MANIFEST, manifest_text(_EXPORT, either).encode("utf-8"))
        for name, content in files.items():
            _write(folder / name, content)
        _write(folder / MANIFEST, manifest_text(_EXPORT, digests).encode("utf-8"))
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(f"{folder}: cannot be written: {reason}; allowed: a folder") from None
    return [folder / name for name in (*files, MANIFEST)]


def _write(file: Path, content: bytes) -> None:
    """Write a file under another name, and rename it when it is complete."""
    unfinished = file.with_name(f".unfinished_{file.name}")
    unfinished.write_bytes(content)
    unfinished.replace(file)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
