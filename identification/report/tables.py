"""Tables of an identification, Tab. C.3 and C.4 among them."""

import math
from collections.abc import Sequence

import numpy as np

from identification.consistency.nearest import ConsistentParameters
from identification.estimation.choice import FrictionChoice
from identification.estimation.least_squares import Estimate
from identification.findings import Findings
from reporting.page import Table


def parameter_table(findings: Findings, words: bool = True) -> Table:
    """Return Tab. C.3: each base parameter with its standard deviations.

    Args:
        findings: Results of the estimation.
        words: Whether to print the combination of each parameter, or only its leading parameter.
    """
    runs, base = findings.runs, findings.estimate.base
    scale = 100.0 / np.abs(runs.mean)
    columns = zip(
        base.names if words else base.short_names,
        runs.mean.tolist(),
        base.units,
        (runs.standard_deviation * scale).tolist(),
        (runs.predicted_standard_deviation * scale).tolist(),
        (np.full(base.rank, np.nan) if findings.truth is None else findings.truth).tolist(),
        strict=True,
    )
    rows = [[str(number), *row] for number, row in enumerate(columns, start=1)]
    caption = (
        "Mean of the runs; standard deviation of one run in % of it, of the runs and predicted."
    )
    head = ["", "parameter", "mean", "unit", "of the runs in %", "predicted in %", "true"]
    return _drop_empty_columns("Base parameters", caption, head, rows)


def torque_table(findings: Findings) -> Table:
    """Return Tab. C.4: residual torques of the model, beside their noise."""
    runs, used = findings.runs, findings.prediction
    unknown = np.full(len(findings.estimate.joint_names), np.nan)
    columns = zip(
        findings.estimate.joint_names,
        ["Nm" if unit == "rad" else "N" for unit in findings.estimate.joint_units],
        runs.noise_level.tolist(),
        runs.error_rms.tolist(),
        (100.0 * runs.explained).tolist(),
        (unknown if used is None else used.error_rms).tolist(),
        (unknown if used is None else 100 * used.explained).tolist(),
        strict=True,
    )
    head = [
        "joint",
        "unit",
        "noise",
        "error",
        "explained in %",
        "error, not used",
        "explained in %",
    ]
    caption = (
        "Root mean squares of single measured torques: noise, and error of the model on its own "
        "motion and on one that was not used; share of the torques' variance that it "
        "explains."
    )
    return _drop_empty_columns("Torques", caption, head, [list(row) for row in columns])


def _drop_empty_columns(
    title: str, caption: str, head: Sequence[str], rows: Sequence[Sequence[str | float]]
) -> Table:
    """Return a table without its empty columns."""
    columns = [
        k
        for k in range(len(head))
        if any(isinstance(row[k], str) or not math.isnan(float(row[k])) for row in rows)
    ]
    return Table(
        title, caption, [head[k] for k in columns], [[row[k] for k in columns] for row in rows]
    )


def weakness_table(estimate: Estimate) -> Table:
    """Return the table of badly identifiable parameters with reasons."""
    rows: list[list[str | float]] = [
        [weak.name, 100.0 * weak.relative_deviation, weak.reason]
        for weak in estimate.weak_parameters()
    ]
    caption = "Parameters with a standard deviation above 15 % of their value."
    return Table("Badly identifiable", caption, ["parameter", "in %", "why"], rows)


def friction_table(choice: FrictionChoice, joints: Sequence[str]) -> Table:
    """Return the table of the tested friction terms."""
    rows: list[list[str | float]] = [
        [
            joints[judged.term.joint],
            judged.term.kind,
            "" if judged.term.width is None else f"{judged.term.width:.3g}",
            100.0 * judged.share,
            judged.significance,
            "chosen" if judged.chosen else "",
        ]
        for judged in choice.judgements
    ]
    caption = (
        "Reduction of the error of a motion that was not used by terms beside Coulomb and viscous "
        f"friction; chosen above a significance of {choice.threshold:.2f}."
    )
    head = ["joint", "term", "width", "share in %", "significance", ""]
    return Table("Friction", caption, head, rows)


def consistent_table(found: ConsistentParameters, units: Sequence[str]) -> Table:
    """Return the table of all parameters of the consistent set."""
    rows: list[list[str | float]] = [
        [name, value, unit]
        for name, value, unit in zip(found.names, found.parameters.tolist(), units, strict=True)
    ]
    caption = f"Every link is a body of positive density; chi squared {found.chi_squared:.4g}."
    return Table("Physically consistent parameters", caption, ["parameter", "value", "unit"], rows)
