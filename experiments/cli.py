"""The command line: ``list``, ``run``, ``live``, ``compare``, ``sweep``, ``teach`` and others.

It is called as ``python -m experiments`` from a clone's folder, or as ``pfsc`` in its environment,
from any folder; ``pfsc --install-completion`` lets the shell complete commands, options and names.
Wrong input is told in one line that names file and key, all that is wrong in a file together, the
nearest word that there is, and what is allowed.

Exit status: 0 the run completed, or every run of a sweep has a row that says how it ended; 2 the
input is wrong, nothing was run (one line on stderr); 3 a fault stopped the run, or a live session
ended while one did, everything logged so far is kept; 4 results could not be written, one line
says which and where they are instead; 130 interrupted, everything logged so far is kept.
"""

from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from experiments.hardware_commands import drive_command, lead_command, robot_command
from experiments.run_commands import (
    compare_command,
    list_command,
    live_command,
    run_command,
    schema_command,
    sweep_command,
)
from experiments.study_commands import (
    export_command,
    margins_command,
    replay_command,
    study_command,
    teach_command,
)
from reporting.provenance import version_line
from reporting.terminal import grouped, run_app

_COMMANDS: dict[str, Callable[..., None]] = {
    "list": list_command,
    "schema": schema_command,
    "run": run_command,
    "live": live_command,
    "compare": compare_command,
    "sweep": sweep_command,
    "study": study_command,
    "teach": teach_command,
    "margins": margins_command,
    "export": export_command,
    "replay": replay_command,
    "robot": robot_command,
    "drive": drive_command,
    "lead": lead_command,
}


def make_app(*, completion: bool = False) -> typer.Typer:
    """Return the commands.

    Args:
        completion: Whether there are ``--install-completion`` and ``--show-completion``, which
            take a program of one word.
    """
    app = typer.Typer(
        add_completion=completion,
        pretty_exceptions_enable=False,
        help="Path and surface following experiments, from scenario files to reports.",
    )
    app.callback()(_root)
    for name, command in _COMMANDS.items():
        app.command(name)(grouped(command))
    return app


def _tell_version(asked: bool) -> None:
    """Print one line and end the process, if that was asked."""
    if asked:
        typer.echo(version_line())
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=_tell_version,
            help="Tell versions of the program, Drake and CasADi, and the git revision.",
        ),
    ] = False,
) -> None:
    """Take the options of the program itself."""


app = make_app()


def main(arguments: Sequence[str] | None = None, program: str = "python -m experiments") -> int:
    """Runs the command line.

    Args:
        arguments: Without the program's name; by default those of the process.
        program: How it is called.

    Returns:
        Exit status, see the module.
    """
    own = make_app(completion=True) if " " not in program else app
    return run_app(own, program, arguments)
