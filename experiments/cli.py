"""The command line: ``list``, ``run``, ``live``, ``compare``, ``sweep``, ``teach`` and others.

It is called as ``python -m experiments`` from a clone's folder, or as ``pfsc`` in its environment,
from any folder; ``pfsc --install-completion`` lets the shell complete commands, options and names.
A message about wrong input is one line with file, line or ``--set`` option, key, value, allowed
values and the nearest known word; all errors of a file are reported together.

Exit status: 0 the run completed, or every run of a sweep has a row that says how it ended; 2 the
input is wrong, nothing was run (one line on stderr); 3 a fault stopped the run or was active at the
end of a live session, log written up to then; 4 results could not be written, one line names them
and their substitute; 130 interrupted, log written up to then.
"""

from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from experiments.hardware_commands import drive_command, lead_command, robot_command
from experiments.init_command import init_command
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
from identification.cli import app as identification_app
from reporting.provenance import version_line
from reporting.terminal import flatten_options, run_app

# by panel of the help: command and example
_COMMANDS: dict[str, dict[str, tuple[Callable[..., None], str]]] = {
    "First steps": {
        "init": (init_command, "my_arm.urdf teach_in.csv --out mine.yaml"),
        "list": (list_command, ""),
        "run": (run_command, "pfc_elastic_6r --set controller.law=rigid"),
        "live": (live_command, "operator_hand_6r"),
        "compare": (compare_command, "out/mine out/mine_off"),
        "schema": (schema_command, "--tags"),
    },
    "Robustness": {
        "margins": (margins_command, "pfc_elastic_6r"),
        "sweep": (sweep_command, "pfc_elastic_6r --vary model_error.mass=0.9:1.1 --samples 50"),
        "study": (study_command, "robustness"),
    },
    "Robots": {
        "robot": (robot_command, "pfc_panda_7r"),
        "drive": (drive_command, "pfc_panda_7r --out out/driven"),
        "lead": (lead_command, "teleop_path"),
        "export": (export_command, "pfc_elastic_6r --out controller"),
        "replay": (replay_command, "controller out/pfc_elastic_6r/log.h5"),
    },
    "Data": {
        "teach": (teach_command, "out/operator_hand_6r"),
    },
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
        rich_markup_mode="markdown",
        help="Path and surface following experiments, from scenario files to reports.",
    )
    app.callback()(_root)
    for panel, commands in _COMMANDS.items():
        for name, (command, example) in commands.items():
            epilog = f"Example: `pfsc {name} {example}".rstrip() + "`"
            app.command(name, rich_help_panel=panel, epilog=epilog)(flatten_options(command))
    app.add_typer(identification_app, name="identify", rich_help_panel="Data")
    return app


def _print_version(requested: bool) -> None:
    """Print the version line and exit, if requested."""
    if requested:
        typer.echo(version_line())
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=_print_version,
            help="Print the versions of the program, Drake and CasADi, and the git revision.",
        ),
    ] = False,
) -> None:
    """Take the options of the program itself."""


app = make_app()


def main(arguments: Sequence[str] | None = None, program: str = "python -m experiments") -> int:
    """Run the command line.

    Args:
        arguments: Without the program's name; by default those of the process.
        program: Name of the program.

    Returns:
        Exit status, see the module.
    """
    own = make_app(completion=True) if " " not in program else app
    return run_app(own, program, arguments)
