"""What a person did, as a CSV file.

The columns are ``tick``, the number of the controller's sampling interval from which on a line
holds, then :func:`columns`: the push along the world's axes [N]; whether the hand holds (1) or not
(0), and where [m]; stiffness and damping of the tangential, transversal and rotational coordinates
in SI units, -1 where they are as the scenario says; for each region, whether it is on (1) or off
(0).
"""

from collections.abc import Sequence

import numpy as np

from pfsc_drake.control.compliance.tuned_impedance import KINDS
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import check_columns, read_numbers

_TICK, _REGION = "tick", "region_"
_HAND = ("push_x", "push_y", "push_z", "hold", "target_x", "target_y", "target_z")


def columns(regions: Sequence[str]) -> list[str]:
    """Return the names of a person's controls, in their order.

    Args:
        regions: Names of what can be switched on and off.
    """
    kinds = [kind.name.lower() for kind in KINDS]
    tuned = [f"{kind}_{name}" for kind in kinds for name in ("stiffness", "damping")]
    return [*_HAND, *tuned, *(f"{_REGION}{name}" for name in regions)]


def read_controls(name: str, regions: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read a file.

    Args:
        name: The file.
        regions: Names of what can be switched on and off.

    Returns:
        The ticks, shape (rows,), and the controls from each on, shape (rows, size).

    Raises:
        InputError: If the file cannot be read, a column is missing, or the ticks are not whole
            numbers that increase from 0.
    """
    known = [_TICK, *columns(regions)]

    def check_header(place: str, header: list[str]) -> None:
        check_columns(place, header, known=known, required=known)

    table = read_numbers(name, "lines of controls", check_header)
    order = [table.header.index(label) for label in known]
    rows = table.rows[:, order]
    ticks = rows[:, 0]
    if ticks[0] != 0.0 or np.any(np.diff(ticks) <= 0.0) or np.any(ticks != np.round(ticks)):
        raise InputError(f"{name}: ticks; whole numbers that increase from 0 are required")
    return ticks, rows[:, 1:]


def controls_text(ticks: Sequence[int], rows: Sequence[np.ndarray], regions: Sequence[str]) -> str:
    """Return what :func:`read_controls` reads back, to the last bit.

    Args:
        ticks: Shape (rows,).
        rows: Each (size,).
        regions: Names of what can be switched on and off.
    """
    lines = [",".join([_TICK, *columns(regions)])]
    for tick, row in zip(ticks, rows, strict=True):
        lines.append(",".join([str(tick), *map(_number, row.tolist())]))
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")
