"""Results of elastic joints as tables."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.elastic.joint_estimate import JointEstimate
from identification.output import write_text
from reporting.page import Table

COLUMNS = ("joint", "parameter", "value", "standard_deviation", "relative_percent", "unit")
_UNITS = {
    "stiffness": ("Nm/rad", "N/m"),
    "damping": ("Nm s/rad", "N s/m"),
    "inertia": ("kg m^2", "kg"),
    "coulomb": ("Nm", "N"),
    "lag": ("Nm s", "N s"),
    "viscous": ("Nm s/rad", "N s/m"),
    "offset": ("Nm", "N"),
}


def parameter_unit(parameter: str, joint_unit: str) -> str:
    """Return the unit of a parameter.

    Args:
        parameter: One of :class:`~identification.elastic.joint_estimate.JointEstimate`.
        joint_unit: ``rad`` or ``m``.
    """
    return _UNITS[parameter][joint_unit != "rad"]


def table_rows(estimates: Sequence[JointEstimate]) -> list[tuple[str, str, float, float, str]]:
    """Return joint, parameter, value, standard deviation and unit, line by line."""
    return [
        (e.name, name, e.value(name), e.deviation(name), parameter_unit(name, e.unit))
        for e in estimates
        for name in e.parameters
    ]


def joint_table(estimates: Sequence[JointEstimate]) -> Table:
    """Return the parameters of joints with their standard deviations.

    Args:
        estimates: Of the joints.
    """
    rows: list[list[str | float]] = [
        [joint, name, value, deviation, 100.0 * deviation / abs(value) if value else np.inf, unit]
        for joint, name, value, deviation, unit in table_rows(estimates)
    ]
    head = ["joint", "parameter", "value", "standard deviation", "in %", "unit"]
    return Table("Elastic joints", "On the joint side.", head, rows)


def write_table(path: str | Path, estimates: Sequence[JointEstimate]) -> None:
    """Write the parameters of joints with their standard deviations as CSV.

    Args:
        path: Of the file, which is replaced.
        estimates: Of the joints.

    Raises:
        InputError: If the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for joint, name, value, deviation, unit in table_rows(estimates):
        relative = 100.0 * deviation / abs(value) if value else np.inf
        numbers = (f"{value:.6g}", f"{deviation:.3g}", f"{relative:.3g}")
        writer.writerow((joint, name, *numbers, unit))
    write_text(Path(path), text.getvalue())
