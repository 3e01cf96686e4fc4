"""Progress callback of long computations."""

from collections.abc import Callable

# called with the fraction done and the name of the step
Progress = Callable[[float, str], None]
