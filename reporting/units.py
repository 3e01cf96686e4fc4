"""Numbers with units as a person reads them: three or four digits and an SI prefix."""

import math

NOT_A_NUMBER = "\u2013"
NARROW_SPACE = "\u202f"

_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
# Lowest and highest power of ten a prefix may stand for, for units that take one.
_PREFIX_RANGE = {"m": (-9, 0), "rad": (-9, 0), "m/s": (-6, 0), "s": (-9, 0), "N": (-3, 3)}
_SPELLINGS = {"us": "µs", "Nm": "N\u2009m", "1": "", "-": ""}


def format_quantity(value: float, unit: str, scale_by: float | None = None) -> str:
    """Formats a value with its unit, e.g. ``0.0000432``, ``"m"`` as ``43.2 µm``.

    Args:
        value: In ``unit``.
        unit: ``"m"``, ``"rad"``, ``"m/s"``, ``"s"``, ``"N"`` get an SI prefix, others stay as is;
            ``"1"``, ``"-"`` and ``""`` are no unit.
        scale_by: Value [unit] that chooses the prefix, so that several values share it; by
            default ``value`` itself.

    Returns:
        Text with a narrow no-break space before the unit; an en dash for NaN and infinity.
    """
    if not math.isfinite(value):
        return NOT_A_NUMBER
    exponent = _prefix_exponent(value if scale_by is None else scale_by, unit)
    number = _format_number(value / 10.0**exponent)
    symbol = _PREFIXES[exponent] + _SPELLINGS.get(unit, unit)
    return f"{number}{NARROW_SPACE}{symbol}" if symbol else number


def _prefix_exponent(value: float, unit: str) -> int:
    """Power of ten of the prefix that suits a value, 0 for units without prefixes."""
    if unit not in _PREFIX_RANGE or value == 0.0 or not math.isfinite(value):
        return 0
    lowest, highest = _PREFIX_RANGE[unit]
    # Rounded to four digits first: 0.99999e-3 is 1 m..., not 1000 µ...
    decade = math.floor(math.log10(float(f"{abs(value):.3e}")))
    return min(max(3 * (decade // 3), lowest), highest)


def _format_number(value: float) -> str:
    """Four significant digits without trailing zeros; whole numbers in full up to a million."""
    if float(value).is_integer() and abs(value) < 1e6:
        return f"{value:.0f}"
    if 1e-3 <= abs(value) < 1e6:
        digits = max(0, 3 - math.floor(math.log10(abs(value))))
        text = f"{value:.{digits}f}"
        return text.rstrip("0").rstrip(".") if digits else text
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
