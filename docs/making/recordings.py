"""Recordings of the tutorials, copied beside the pages that show them in frames."""

import shutil
from pathlib import Path
from typing import Any

_FOLDER = Path("tutorials") / "out"  # where the notebooks write


def copy_recordings(app: Any, exception: Exception | None) -> None:
    """Copy the recordings into the built site.

    Args:
        app: The application of Sphinx.
        exception: Error of the build, or None.
    """
    if exception is not None or app.builder.format != "html":
        return
    for page in (Path(app.srcdir) / _FOLDER).rglob("recording.html"):
        target = Path(app.outdir) / page.relative_to(app.srcdir)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(page, target)
