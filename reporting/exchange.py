"""Exchange of a folder's results for those of a new run, all at once also through a crash.

New results are written into a folder of their own within that of the results, which is in the
same file system and under the same lock. When they are complete its name changes, once, and from
then on whoever opens the folder next ends the exchange; before, the results are the earlier ones.
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
    if staged.exists():  # of a process that was killed
        shutil.rmtree(staged)
    staged.mkdir()
    (staged / MANIFEST).write_text(manifest_text(kind, []), encoding="utf-8")
    return staged


def complete_exchange(folder: Path) -> None:
    """Replace earlier results by those that are staged.

    Args:
        folder: Folder of the results, locked.

    Raises:
        OSError: If the file system does not allow it.
    """
    (folder / STAGED).rename(folder / READY)
    end_exchange(folder)


def end_exchange(folder: Path) -> None:
    """End an exchange that was complete when its process ended; nothing to do without one.

    Args:
        folder: Folder of the results, locked.
    """
    ready = folder / READY
    if not ready.exists():
        return
    kind = kind_of_results(ready)
    if kind is not None:
        old, new = listed_results(folder), listed_results(ready)
        # all are known as results whenever the process ends
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
    with suppress(OSError):  # is not empty, or not there
        (folder / FIGURES).rmdir()


def _replace(folder: Path, manifest: str) -> None:
    unfinished = folder / UNFINISHED
    unfinished.write_text(manifest, encoding="utf-8")
    unfinished.replace(folder / MANIFEST)
