"""Page of the command line, generated from its help."""

import inspect
import typing
from pathlib import Path
from typing import Any

import typer

import experiments.cli
import identification.cli
from docs.making.text import as_markdown, table

# by program: prefix of labels, module that documents the exit status, commands
_PROGRAMS = {
    "pfsc": ("experiments", experiments.cli, experiments.cli.app),
    "pfsc identify": ("identification", identification.cli, identification.cli.app),
}
_TYPES = {Path: "PATH", float: "NUMBER", int: "INTEGER"}
_HEAD = ["Argument or option", "Default", "Meaning"]


def command_line() -> str:
    """Return every command of both programs, with its arguments and options, as Markdown."""
    page = []
    for program, (label, module, app) in _PROGRAMS.items():
        group: Any = typer.main.get_command(app)
        page += [f"## `{program}`", _text(group.help)]
        page.append(as_markdown(_status(inspect.getdoc(module) or "")))
        rows = [_row(parameter) for parameter in group.params if parameter.name == "version"]
        page += [table(_HEAD, rows, "options")] if rows else []
        for name, command in group.commands.items():
            if f"{program} {name}" not in _PROGRAMS:
                page += _section(program, f"{label}-{name}", name, command)
    return "\n\n".join(page)


def _status(text: str) -> str:
    """Return the paragraph of a module's docstring on the exit status."""
    return next((part for part in text.split("\n\n") if part.startswith("Exit status")), "")


def _section(program: str, label: str, name: str, command: Any) -> list[str]:
    shown = [parameter for parameter in command.params if not getattr(parameter, "hidden", False)]
    needed = [p.name.upper() for p in shown if p.param_type_name == "argument" and p.required]
    synopsis = " ".join([program, name, *needed])
    parts = [f"({label})=", f"### `{name}`", _text(command.help), f"`{synopsis}`"]
    parts += [_text(command.epilog)] if command.epilog else []
    rows = [_row(parameter) for parameter in shown]
    return [*parts, table(_HEAD, rows, "options")] if rows else parts


def _row(parameter: Any) -> list[str]:
    if parameter.param_type_name == "argument":
        name = f"`{parameter.name.upper()}`{' …' if parameter.nargs == -1 else ''}"
    else:
        names = [*parameter.opts, *parameter.secondary_opts]
        value = "" if parameter.is_flag else f" {_value(parameter)}"
        name = ", ".join(f"`{option}{value}`" for option in names)
    return [name, _default(parameter), " ".join(_text(parameter.help).split()).replace("|", r"\|")]


def _value(parameter: Any) -> str:
    """Return the placeholder of an option's value: its metavar, or its type."""
    if parameter.metavar:
        return str(parameter.metavar)
    kind = parameter.type_descriptor.annotation
    inner = [one for one in typing.get_args(kind) if one is not type(None)] or [kind]
    return _TYPES.get(inner[0], "TEXT")


def _default(parameter: Any) -> str:
    if parameter.required:
        return "*required*"
    value = parameter.default
    if value is None or value in ((), "", []) or callable(value):
        return ""
    if isinstance(value, bool):
        names = [*parameter.opts[:1], *parameter.secondary_opts[:1]]
        return f"`{names[0 if value else -1]}`" if len(names) == 2 else ""
    return f"`{value}`"


def _text(text: str | None) -> str:
    return as_markdown(inspect.cleandoc(text or ""))
