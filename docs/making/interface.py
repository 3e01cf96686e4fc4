"""The library's door and that of the experiments, as directives that read their docstrings."""

import importlib
import inspect
from types import ModuleType

_DOORS = {
    "pfsc_drake": "The library",
    "experiments": "Runs, exports, robots",
    "identification": "Models from measurements",
}


def interface() -> str:
    """Return a section for each module that has a door: its functions, then its classes."""
    page = []
    for name, title in _DOORS.items():
        module = importlib.import_module(name)
        offered = [entry for entry in getattr(module, "__all__", []) if entry[0] != "_"]
        if offered:
            page += [f"## {title}: `{name}`", _section(module, offered)]
    return "\n\n".join(page)


def _section(module: ModuleType, offered: list[str]) -> str:
    lines = ["```{eval-rst}"]
    for kind, wanted in (("function", False), ("class", True)):
        for name in offered:
            value = getattr(module, name)
            if not callable(value) or inspect.isclass(value) != wanted:
                continue
            lines += ["", f".. auto{kind}:: {module.__name__}.{name}"]
            if wanted:
                lines.append("   :members:")
    return "\n".join([*lines, "```"])
