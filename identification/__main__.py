"""``python -m identification``."""

import sys

from reporting.interruption import leave_when_interrupted
from reporting.terminal import prepare_streams, silence_libraries

if __name__ == "__main__":
    leave_when_interrupted()
    prepare_streams()
    silence_libraries()
    from identification.cli import main

    sys.exit(main())
