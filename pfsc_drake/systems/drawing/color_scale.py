"""Colours that tell signed values."""

from pydrake.geometry import Rgba

# red, green, blue of the lowest value, of zero, and of the highest
_LOW, _ZERO, _HIGH = (0.05, 0.2, 0.9), (1.0, 1.0, 1.0), (0.9, 0.1, 0.05)


def signed_color(value: float, largest: float) -> Rgba:
    """Return the colour of a value: blue below zero, white at zero, red above.

    Args:
        value: The value, in any unit.
        largest: Magnitude of the values that have full colour, in the same unit, positive; what
            is beyond has full colour, too.
    """
    share = min(abs(value) / largest, 1.0)
    end = _HIGH if value > 0.0 else _LOW
    red, green, blue = (zero + share * (x - zero) for zero, x in zip(_ZERO, end, strict=True))
    return Rgba(red, green, blue, 1.0)
