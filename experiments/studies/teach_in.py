"""A path taught by hand, and followed at once (Sec. 5.3)."""

from collections.abc import Callable
from pathlib import Path

from experiments.teaching.options import TeachingOptions
from experiments.teaching.teach import check_folders, run_and_tell, teach
from reporting.page import Report

SCENARIO, GUIDE = "teach_by_hand_6r", "guide"


def write_teach_in(
    out: Path,
    progress: Callable[[str], None],
    scenario: str = SCENARIO,
    options: TeachingOptions | None = None,
    *,
    drawn: bool = True,
) -> Report:
    """Let a hand lead a tool, follow the path that this taught, and write a page.

    Args:
        out: Folder for waypoints, scenario and page; the run with the hand is in ``guide``, the
            one along the path in ``follow``.
        progress: Told one line per step.
        scenario: Name or file of the scenario with the hand.
        options: How the path is taught.
        drawn: Whether the two runs have figures and recordings.

    Returns:
        The page.

    Raises:
        InputError: See :func:`teach`; nothing has been run where a folder cannot take results.
        KeyboardInterrupt: If the user stopped a run.
    """
    check_folders(out, out / GUIDE)
    run_and_tell(scenario, out / GUIDE, progress, drawn=drawn)
    return teach(out / GUIDE, out, options, drawn=drawn, progress=progress).report
