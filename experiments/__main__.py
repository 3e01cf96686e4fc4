"""``python -m experiments``."""

import sys

from experiments.program import start

if __name__ == "__main__":
    sys.exit(start("python -m experiments"))
