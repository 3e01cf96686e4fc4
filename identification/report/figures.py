"""Figures of an identification."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from identification.consistency.nearest import ConsistentParameters
from identification.estimation.identifiability import BADLY
from identification.estimation.least_squares import Estimate
from identification.estimation.repetitions import Repetitions
from identification.estimation.residuals import Whiteness
from reporting.style import (
    ALERT,
    COLOURS,
    REFERENCE,
    STYLE,
    WIDTH,
    Drawing,
    Figure,
    make_panels,
    render,
)

_ROW = 1.35  # height of a joint's panel [inches]
_LINE = 0.19  # height of a parameter's line [inches]


def excitation_figure(
    t: np.ndarray, q: np.ndarray, limits: np.ndarray, units: Sequence[str]
) -> Figure:
    """Return the figure of the measured motion.

    Args:
        t: Times [s], shape (K,).
        q: Positions [rad or m], shape (K, N).
        limits: Lower and upper limits, shape (N, 2); infinite if unknown.
        units: ``rad`` or ``m`` of each joint.
    """
    with plt.rc_context(STYLE):
        canvas, panels = make_panels(q.shape[1], _ROW)
        for j, panel in enumerate(panels):
            panel.plot(t, q[:, j], color=COLOURS[0])
            for limit in limits[j][np.isfinite(limits[j])]:
                panel.axhline(limit, color=ALERT, linewidth=0.9, linestyle="--")
            panel.set_ylabel(f"$q_{j + 1}$ in {units[j]}")
        caption = "Mean of the periods; limits of the joints are dashed."
        return render(Drawing("excitation", "Excitation", caption, canvas))


def fit_figure(
    t: np.ndarray,
    torques: tuple[np.ndarray, np.ndarray],
    units: Sequence[str],
    title: str,
    caption: str,
) -> Figure:
    """Return the figure of measured, predicted and residual torques, as in Fig. C.2.

    Args:
        t: Times [s], shape (K,).
        torques: Measured and predicted torques of that motion [Nm or N], each (K, N).
        units: ``Nm`` or ``N`` of each joint.
        title: Title.
        caption: Explanation.
    """
    measured, predicted = torques
    with plt.rc_context(STYLE):
        canvas, panels = make_panels(len(units), _ROW)
        for j, panel in enumerate(panels):
            left = measured[:, j] - predicted[:, j]
            panel.plot(t, measured[:, j], color="#9CA3AF", linewidth=2.6, label="measured")
            panel.plot(t, predicted[:, j], color=COLOURS[0], linewidth=1.1, label="predicted")
            panel.plot(t, left, color=COLOURS[1], linewidth=0.8, label="left")
            panel.set_ylabel(f"$\\tau_{j + 1}$ in {units[j]}")
        handles = panels[0].get_legend_handles_labels()
        canvas.legend(*handles, loc="outside upper right", ncols=3, frameon=False)
        name = "prediction" if "not used" in title else "fit"
        return render(Drawing(name, title, caption, canvas))


def parameter_figure(
    runs: Repetitions, truth: np.ndarray | None, consistent: ConsistentParameters | None
) -> Figure:
    """Return the figure of the parameters' uncertainties and errors.

    Args:
        runs: Runs of the same excitation.
        truth: Ground truth of the base parameters, shape (n_b,), or None.
        consistent: The nearest consistent set, or None.
    """
    first = runs.estimates[0]
    names, rows = first.short_names, np.arange(first.base.rank)[::-1]
    sigma = runs.predicted_standard_deviation
    relative = 100.0 * sigma / np.abs(runs.mean)
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(1.15 * WIDTH, _LINE * len(names) + 1.4))
        left, right = canvas.subplots(1, 2, sharey=True)
        badly = relative > 100.0 * BADLY
        left.barh(rows[~badly], relative[~badly], color=COLOURS[0], label="predicted")
        if badly.any():
            left.barh(rows[badly], relative[badly], color=COLOURS[4], label="badly identifiable")
        if len(runs.estimates) > 1:
            spread = 100.0 * runs.standard_deviation / np.abs(runs.mean)
            left.plot(spread, rows, "o", color=COLOURS[1], markersize=3.5, label="of the runs")
        left.set(xscale="log", xlabel="standard deviation in % of the value")
        left.set_yticks(rows, names, fontsize=7)
        left.set_ylim(-1, len(names))
        right.axvspan(-2.0, 2.0, color="#E5E7EB")
        right.axvline(0.0, color=REFERENCE, linewidth=0.8)
        for run in runs.estimates:
            about = runs.mean if truth is None else truth
            right.plot(
                (run.base_parameters - about) / sigma, rows, ".", color=COLOURS[0], markersize=4
            )
        right.plot([], [], ".", color=COLOURS[0], label="runs")
        if consistent is not None:
            own = (
                consistent.base_values
                - (runs.mean if truth is None else truth)[: len(consistent.base_values)]
            )
            deviation = own / sigma[: len(own)]
            right.plot(
                deviation,
                rows[: len(own)],
                "D",
                color=COLOURS[2],
                markersize=3.5,
                label="consistent",
            )
        of = "mean of the runs" if truth is None else "truth"
        right.set(xlabel=f"deviation from the {of} in standard deviations")
        handles = [panel.get_legend_handles_labels() for panel in (left, right)]
        canvas.legend(
            *map(list, (handles[0][0] + handles[1][0], handles[0][1] + handles[1][1])),
            loc="outside lower center",
            ncols=5,
            frameon=False,
        )
        caption = (
            "Left: standard deviations of the base parameters. Right: errors of the runs and of "
            "the consistent model; two standard deviations are shaded."
        )
        return render(Drawing("parameters", "Parameters", caption, canvas))


def whiteness_figure(test: Whiteness) -> Figure:
    """Return the figure of the autocorrelation of the residuals.

    Args:
        test: Test of the residuals.
    """
    lags = np.arange(1, len(test.autocorrelation) + 1)
    with plt.rc_context(STYLE):
        canvas, panels = make_panels(len(test.joint_names), 1.0)
        for j, panel in enumerate(panels):
            panel.axhspan(-test.bound[j], test.bound[j], color="#E5E7EB")
            panel.vlines(lags, 0.0, test.autocorrelation[:, j], color=COLOURS[0])
            panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
            panel.set_ylabel(f"joint {j + 1}")
        panels[-1].set_xlabel("delay in samples")
        caption = "95 % of the autocorrelations of white residuals are in the shaded band."
        return render(Drawing("whiteness", "Autocorrelation of the residuals", caption, canvas))


def weakness_figure(estimate: Estimate) -> Figure:
    """Return the figure of the singular values of the weighted, normalized regressor.

    Args:
        estimate: Estimate with the regressor.
    """
    values = estimate.factors.values
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 2.6))
        panel = canvas.subplots()
        panel.bar(np.arange(1, len(values) + 1), values, color=COLOURS[0])
        panel.set(yscale="log", xlabel="direction", ylabel="singular value")
        caption = "Directions of the parameters by their effect on the torques."
        return render(Drawing("directions", "Singular values of the excitation", caption, canvas))
