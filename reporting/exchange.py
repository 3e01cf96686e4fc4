"""Exchange of a folder's results for those of a new run, as a whole even after a crash.

New results are written into a folder of their own within the results folder, i.e. in the same file
system and under the same lock. When they are complete, one renaming commits the exchange, and the
next process that opens the folder finishes it if necessary; before, the earlier results remain.
"""

import shutil
from contextlib import suppress
from pathlib import Path

from reporting.provenance import (
    FIGURES,
    MANIFEST,
    READY,
    STAGED,
    UNFINISHED,
    kind_of_results,
    listed_results,
    manifest_text,
)


def begin_exchange(folder: Path, kind: str) -> Path:
    """Return an empty folder for new results; earlier ones stay.

    Args:
        folder: Folder of the results, locked.
        kind: Kind of results.
    """
    end_exchange(folder)
    staged = folder / STAGED
    if staged.exists():  # left by a killed process
        shutil.rmtree(staged)
    staged.mkdir()
    (staged / MANIFEST).write_text(manifest_text(kind, []), encoding="utf-8")
    return staged


def complete_exchange(folder: Path) -> None:
    """Replace earlier results by the staged ones.

    Args:
        folder: Folder of the results, locked.

    Raises:
        OSError: If the file system does not allow it.
    """
    (folder / STAGED).rename(folder / READY)
    end_exchange(folder)


def end_exchange(folder: Path) -> None:
    """Finish an exchange that was committed when its process ended; do nothing without one.

    Args:
        folder: Folder of the results, locked.
    """
    ready = folder / READY
    if not ready.exists():
        return
    kind = kind_of_results(ready)
    if kind is not None:
        old, new = listed_results(folder), listed_results(ready)
        # all files are listed as results whenever the process ends
        _replace(folder, manifest_text(kind, [*dict.fromkeys([*old, *new])]))
        for name in old:
            if name not in new:
                (folder / name).unlink(missing_ok=True)
        for name in new:
            if (ready / name).exists():
                (folder / name).parent.mkdir(exist_ok=True)
                (ready / name).replace(folder / name)
        (ready / MANIFEST).replace(folder / MANIFEST)
    shutil.rmtree(ready)
    with suppress(OSError):  # not empty, or missing
        (folder / FIGURES).rmdir()


def _replace(folder: Path, manifest: str) -> None:
    unfinished = folder / UNFINISHED
    unfinished.write_text(manifest, encoding="utf-8")
    unfinished.replace(folder / MANIFEST)
