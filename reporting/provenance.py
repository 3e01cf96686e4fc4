"""What identifies a run: scenario, revision of the sources, versions of the libraries."""

import subprocess
from importlib import metadata
from pathlib import Path

PROJECT_ROOT = Path(__file__).resolve().parents[1]


def standard_attributes(scenario_name: str) -> dict[str, str]:
    """Attributes that every log and report carries.

    Args:
        scenario_name: Name of the scenario that is run.

    Returns:
        ``scenario``, ``git_revision`` and one ``<library>_version`` each for pfsc_drake, drake,
        casadi and numpy (``unknown`` where not installed).
    """
    versions = {
        f"{library}_version": _version(library)
        for library in ("pfsc_drake", "drake", "casadi", "numpy")
    }
    return {"scenario": scenario_name, "git_revision": git_revision(), **versions}


def git_revision(root: Path = PROJECT_ROOT) -> str:
    """Revision of the clone in ``root``.

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
    """Output of a git command in ``root``, None if it failed."""
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
    """Installed version of a distribution."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "unknown"
