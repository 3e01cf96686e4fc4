"""Public names of a package that are imported on first use."""

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pfsc_drake.errors import suggestion


def lazy_names(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__all__``, ``__getattr__`` and ``__dir__`` of a package.

    The public names are those that the stub ``__init__.pyi`` beside the package imports, so that
    type checkers, ``dir`` and the interpreter agree. A module is imported with the first use of one
    of its
    names: users of a small part do not wait for Drake.

    Args:
        package: Name of the package, which is being imported.

    Raises:
        AttributeError: By ``__getattr__``, for unknown names; it suggests a similar one.
    """
    module = sys.modules[package]
    assert module.__file__ is not None
    stub = Path(module.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    modules = {
        alias.name: statement.module
        for statement in ast.parse(stub).body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
    names = sorted(modules)

    def load(name: str) -> Any:
        source = modules.get(name)
        if source is None:
            similar = suggestion(name, names) if not name.startswith("_") else ""
            raise AttributeError(f"module {package!r} has no attribute {name!r}{similar}")
        value = getattr(importlib.import_module(source), name)
        setattr(module, name, value)
        return value

    return names, load, lambda: sorted({*vars(module), *names})
