"""Public interface of the packages, as directives that read the docstrings."""

import importlib
import inspect
from types import ModuleType

_MODULES = {
    "pfsc_drake": "The library",
    "experiments": "Runs, exports, robots",
    "identification": "Models from measurements",
}


def interface() -> str:
    """Return a section for each module with public names: its functions, then its classes."""
    page = []
    for name, title in _MODULES.items():
        module = importlib.import_module(name)
        public = [entry for entry in getattr(module, "__all__", []) if entry[0] != "_"]
        if public:
            page += [f"## {title}: `{name}`", _section(module, public)]
    return "\n\n".join(page)


def _section(module: ModuleType, public: list[str]) -> str:
    lines = ["```{eval-rst}"]
    for kind, is_class in (("function", False), ("class", True)):
        for name in public:
            value = getattr(module, name)
            if not callable(value) or inspect.isclass(value) != is_class:
                continue
            lines += ["", f".. auto{kind}:: {module.__name__}.{name}"]
            if is_class:
                lines.append("   :members:")
    return "\n".join([*lines, "```"])
