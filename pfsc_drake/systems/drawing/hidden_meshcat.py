"""Meshcat at a secret address of this machine.

Meshcat does not check the origin of a page, and one malformed message ends it: any page in a
browser on this machine could send one to an address that it guesses.
"""

import secrets

from pydrake.geometry import Meshcat, MeshcatParams

_HOST = "127.0.0.1"


def hidden_meshcat() -> Meshcat:
    """Return a Meshcat at an address of this machine that is hard to guess, if many are free."""
    own = ".".join(["127", *(str(secrets.choice(range(1, 255))) for _ in range(3))])
    try:
        return Meshcat(MeshcatParams(host=own, port=0))
    except RuntimeError:
        return Meshcat(MeshcatParams(host=_HOST, port=0))
