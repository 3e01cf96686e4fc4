"""Page of an identification of a robot."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.consistency.nearest import ConsistentParameters
from identification.estimation.least_squares import Estimate
from identification.estimation.residuals import whiteness
from identification.findings import Findings
from identification.model.subject import Subject
from identification.report.figures import (
    excitation_figure,
    fit_figure,
    parameter_figure,
    weakness_figure,
    whiteness_figure,
)
from identification.report.tables import (
    consistent_table,
    friction_table,
    parameter_table,
    torque_table,
    weakness_table,
)
from reporting.folder import ResultsFolder
from reporting.metrics import Metrics
from reporting.page import Page, Report, Table
from reporting.provenance import standard_attributes
from reporting.style import Figure


@dataclass(frozen=True, eq=False)
class PageContent:
    """Content of the page of an identification.

    Attributes:
        subject: The robot.
        findings: Results of the estimation.
        other_t: Times of the predicted motion [s], shape (K,).
        consistent: The consistent set, if there is one.
        recording: Page with the robot's motion, beside this page, if there is one.
        warnings: Warnings, one sentence each.
        metrics: Further metrics.
        figures: Further figures, at the end.
        tables: Further tables, at the beginning.
        attributes: Provenance of the identification.
    """

    subject: Subject
    findings: Findings
    other_t: np.ndarray | None = None
    consistent: ConsistentParameters | None = None
    recording: str | None = None
    warnings: Sequence[str] = ()
    metrics: Metrics = field(default_factory=Metrics)
    figures: Sequence[Figure] = ()
    tables: Sequence[Table] = ()
    attributes: Mapping[str, str] = field(default_factory=dict)


def write_page(results: ResultsFolder, content: PageContent) -> Report:
    """Write figures, metrics and page of an identification.

    Args:
        results: Folder for them.
        content: Content of the page.
    """
    metrics = summary(content)
    results.write("metrics.json", metrics.to_json())
    return Page(
        kind="Identification",
        title=content.subject.name,
        description=_description(content),
        scenario_yaml_text="\n".join(content.findings.estimate.names),
        details="Base parameters in full",
        metrics=metrics,
        figures=_figures(content),
        tables=_tables(content),
        log_attributes={**standard_attributes(content.subject.name), **content.attributes},
        recording=content.recording,
        warnings=content.warnings,
    ).write(results)


def summary(content: PageContent) -> Metrics:
    """Return the metrics of an identification.

    Args:
        content: Content of the page.
    """
    findings, metrics = content.findings, Metrics()
    estimate, runs = findings.estimate, findings.runs
    metrics.add("parameters", float(estimate.base.rank), "1")
    metrics.add("runs", float(len(runs.estimates)), "1")
    metrics.add(
        "log_det",
        _log_determinant(estimate),
        "1",
        source="of the regressor, X'X, torques in Nm or N",
    )
    metrics.add("condition", estimate.condition, "1", source="weighted, columns of length 1")
    metrics.add("badly_identifiable", float(len(estimate.weak_parameters())), "1")
    metrics.add(
        "median_relative_deviation", float(np.median(estimate.relative_standard_deviation)), "1"
    )
    if len(runs.estimates) > 1:
        test = runs.spread_test(friction=False)
        metrics.add("spread_ratio", test.median_ratio, "1", source="of the runs, to the prediction")
        metrics.add("spread_p_value", test.p_value, "1")
    truth = findings.truth_test
    if truth is not None:
        metrics.add(
            "truth_chi_squared",
            truth.chi_squared,
            "1",
            source=f"{truth.degrees_of_freedom} expected",
        )
        metrics.add(
            "truth_p_value", truth.p_value, "1", "> 0.01", "errors agree with their covariance"
        )
    if findings.prediction is not None:
        explained = float(findings.prediction.explained.min())
        metrics.add("least_explained_not_used", explained, "1", source="least of all joints")
    if content.consistent is not None:
        chi_squared, most = content.consistent.chi_squared, estimate.base.rank
        metrics.add("consistent_chi_squared", chi_squared, "1", source=f"of {most} parameters")
    for name, metric in content.metrics.items():
        metrics.add(name, metric.value, metric.unit, metric.target, metric.source)
    return metrics


def _log_determinant(estimate: Estimate) -> float:
    """Return ``log det(X'X)`` of the regressor in SI units (2.79)."""
    X = estimate.system.matrix.reshape(-1, estimate.base.rank)
    return float(2.0 * np.sum(np.log(np.linalg.svd(X, compute_uv=False))))


def _description(content: PageContent) -> str:
    estimate, runs = content.findings.estimate, content.findings.runs.estimates
    terms = [term.name for term in estimate.friction.terms]
    friction = f", friction with {', '.join(terms)}" if terms else ""
    return (
        f"{estimate.base.rank} base parameters of {len(estimate.joint_names)} joints from "
        f"{len(runs)} run{'s' if len(runs) > 1 else ''} of {len(estimate.motion.tau)} samples"
        f"{friction}."
    )


def _figures(content: PageContent) -> list[Figure]:
    findings, subject = content.findings, content.subject
    estimate = findings.estimate
    motion = estimate.motion
    t = np.asarray(getattr(motion, "t", np.arange(len(motion.tau))))
    units = ["Nm" if unit == "rad" else "N" for unit in estimate.joint_units]
    fit = (estimate.system.torques, estimate.prediction)
    figures = [
        excitation_figure(t, motion.q, subject.position_limits, subject.joint_units),
        fit_figure(t, fit, units, "Torques of the estimate", "Means of the periods."),
    ]
    if findings.prediction is not None and content.other_t is not None:
        torques = (findings.prediction.measured, findings.prediction.predicted)
        caption = "Means of the periods of a motion that was not used to estimate."
        title = "Torques of another motion"
        figures.append(fit_figure(content.other_t, torques, units, title, caption))
    figures.append(parameter_figure(findings.runs, findings.truth, content.consistent))
    test = whiteness(estimate.residuals, estimate.system.used, estimate.joint_names)
    figures += [whiteness_figure(test), weakness_figure(estimate)]
    return [*figures, *content.figures]


def _tables(content: PageContent) -> list[Table]:
    findings = content.findings
    tables = [*content.tables, torque_table(findings)]
    weak = weakness_table(findings.estimate)
    tables += [weak] if weak.rows else []
    if findings.choice is not None:
        tables.append(friction_table(findings.choice, findings.estimate.joint_names))
    tables.append(parameter_table(findings))
    if content.consistent is not None:
        units = findings.estimate.robot_base.full_units
        tables.append(consistent_table(content.consistent, units))
    return tables
