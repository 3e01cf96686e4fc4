"""Colours that tell signed values."""

from pydrake.geometry import Rgba

# red, green, blue of the lowest value, of zero, and of the highest
_LOW, _ZERO, _HIGH = (0.0, 0.35, 1.0), (0.12, 0.12, 0.12), (1.0, 0.15, 0.0)


def signed_color(value: float, largest: float) -> Rgba:
    """Return the colour of a value: blue below zero, dark at zero, red above.

    Args:
        value: The value, in any unit.
        largest: Magnitude of the values that have full colour, in the same unit, positive; what
            is beyond has full colour, too.
    """
    share = min(abs(value) / largest, 1.0)
    end = _HIGH if value > 0.0 else _LOW
    red, green, blue = (zero + share * (x - zero) for zero, x in zip(_ZERO, end, strict=True))
    return Rgba(red, green, blue, 1.0)
