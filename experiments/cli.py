"""The command line: ``list``, ``run``, ``live``, ``compare``, ``sweep``, ``teach`` and others.

Exit status: 0 the run completed, or every run of a sweep has a row that says how it ended; 2 the
input is wrong, nothing was run (one line on stderr); 3 a fault stopped the run, or a live session
ended while one did, everything logged so far is kept; 4 results could not be written, one line
says which and where they are instead; 130 interrupted, everything logged so far is kept.
"""

from collections.abc import Sequence

import typer

from experiments.hardware_commands import drive_command, robot_command
from experiments.run_commands import (
    compare_command,
    list_command,
    live_command,
    run_command,
    sweep_command,
)
from experiments.study_commands import (
    export_command,
    margins_command,
    replay_command,
    study_command,
    teach_command,
)
from reporting.terminal import run_app

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Path and surface following experiments, from scenario files to reports.",
)
app.command("list")(list_command)
app.command("run")(run_command)
app.command("live")(live_command)
app.command("compare")(compare_command)
app.command("sweep")(sweep_command)
app.command("study")(study_command)
app.command("teach")(teach_command)
app.command("margins")(margins_command)
app.command("export")(export_command)
app.command("replay")(replay_command)
app.command("robot")(robot_command)
app.command("drive")(drive_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Args:
        arguments: Without the program's name; by default those of the process.

    Returns:
        Exit status, see the module.
    """
    return run_app(app, "python -m experiments", arguments)
