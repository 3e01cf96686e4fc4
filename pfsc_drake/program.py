"""The program ``pfsc``: the commands of a clone, callable from any folder.

``make setup`` installs it into the clone's environment. In any folder it is the same as
``python -m experiments``; ``pfsc --install-completion`` enables completion in the shell. The
library installed without a clone has no commands, and reports this in one line.
"""

import importlib
import sys
from pathlib import Path

_NAME = "pfsc"
_WRONG_INPUT = 2
_ROOT = Path(__file__).resolve().parents[1]


def main(root: Path = _ROOT) -> int:
    """Run the command line of the process.

    Args:
        root: Top folder of the clone.

    Returns:
        Exit status, see ``experiments.cli``; 2 without a clone.
    """
    if not (root / "experiments" / "__main__.py").is_file():
        return _fail(
            "the commands run from a clone of the project; here is the library alone, for which "
            "import pfsc_drake"
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    try:
        program = importlib.import_module("experiments.__main__")
    except ModuleNotFoundError as error:
        return _fail(f"the package {error.name} is missing; install with make setup")
    status: int = program.start(_NAME)
    return status


def _fail(reason: str) -> int:
    sys.stderr.write(f"error: {_NAME}: {reason}\n")
    return _WRONG_INPUT
