"""Entry point of ``python -m experiments`` and ``pfsc``, before any slow import."""

import sys

from reporting.interruption import leave_when_interrupted
from reporting.terminal import prepare_streams, silence_libraries


def start(name: str) -> int:
    """Run the command line that the process was started with.

    Args:
        name: Name of the program, ``python -m experiments`` or ``pfsc``.

    Returns:
        Exit status, see :mod:`experiments.cli`.
    """
    leave_when_interrupted()
    prepare_streams()
    silence_libraries()
    from experiments.cli import main

    return main(program=name)


if __name__ == "__main__":
    sys.exit(start("python -m experiments"))
