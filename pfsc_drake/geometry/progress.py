"""How what takes long says how far it is."""

from collections.abc import Callable

# told the fraction done and what is done
Progress = Callable[[float, str], None]
