"""Inputs that need not be connected."""

import numpy as np
from pydrake.systems.framework import Context, InputPort


def value_or_none(port: InputPort | None, context: Context) -> np.ndarray | None:
    """Return the value of a vector input, None if nothing is connected or there is no port.

    Args:
        port: The port.
        context: Of its system.
    """
    if port is None or not port.HasValue(context):
        return None
    return port.Eval(context)
