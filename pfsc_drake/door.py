"""The door of a package: names that users import, and modules that are loaded when they do."""

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def door(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a package's ``__getattr__``, which loads what is asked for.

    Whoever needs a part does not wait for the whole, which may be Drake.

    Args:
        package: Name of the package.
        modules: Where each name is defined.
    """

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(modules[name]), name)

    return load
