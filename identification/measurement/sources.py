"""Signals that are known beforehand, and sums of signals, in diagrams."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain, Sine, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

_APART = 1e-9  # s, least distance of two changes


def add_samples(
    builder: DiagramBuilder, name: str, t: np.ndarray, values: np.ndarray
) -> OutputPort:
    """Return values that hold from their instants on.

    Args:
        builder: Builder of the diagram.
        name: Of the source.
        t: Evenly spaced instants [s], shape (K,).
        values: Shape (K, n).
    """
    # the last value of such a trajectory only ends it
    ends = np.append(t, 2.0 * t[-1] - t[-2])
    held = PiecewisePolynomial.ZeroOrderHold(ends, np.vstack([values, values[-1]]).T)
    return builder.AddNamedSystem(name, TrajectorySource(held)).get_output_port()


def add_curves(builder: DiagramBuilder, name: str, t: np.ndarray, values: np.ndarray) -> OutputPort:
    """Return values that change smoothly between their instants, by cubic polynomials.

    Args:
        builder: Builder of the diagram.
        name: Of the source.
        t: Instants [s], shape (K,).
        values: Shape (K, n).
    """
    slopes = np.gradient(values, t, axis=0)
    curves = PiecewisePolynomial.CubicHermite(t, values.T, slopes.T)
    return builder.AddNamedSystem(name, TrajectorySource(curves)).get_output_port()


def add_lines(builder: DiagramBuilder, name: str, t: np.ndarray, values: np.ndarray) -> OutputPort:
    """Return values that change evenly between their instants.

    Args:
        builder: Builder of the diagram.
        name: Of the source.
        t: Instants [s], shape (K,).
        values: Shape (K, n).
    """
    lines = PiecewisePolynomial.FirstOrderHold(t, values.T)
    return builder.AddNamedSystem(name, TrajectorySource(lines)).get_output_port()


def add_signs(
    builder: DiagramBuilder, name: str, t: np.ndarray, v: np.ndarray, size: np.ndarray
) -> OutputPort:
    """Return ``size sign(v)`` that changes where ``v`` is zero, between the instants.

    Args:
        builder: Builder of the diagram.
        name: Of the source.
        t: Instants [s], shape (K,).
        v: Shape (K, n).
        size: Shape (n,).
    """
    changes = [t[[0, -1]]]
    for column in v.T:
        k = np.flatnonzero(column[1:] * column[:-1] < 0.0)
        part = column[k] / (column[k] - column[k + 1])
        changes.append(t[k] + part * (t[k + 1] - t[k]))
    breaks = np.unique(np.concatenate(changes))
    far = np.diff(breaks, prepend=-np.inf) > _APART
    breaks = breaks[far]
    middles = 0.5 * (breaks[1:] + breaks[:-1])
    signs = np.sign([np.interp(middles, t, column) for column in v.T]) * size[:, None]
    held = PiecewisePolynomial.ZeroOrderHold(breaks, np.hstack([signs, signs[:, -1:]]))
    return builder.AddNamedSystem(name, TrajectorySource(held)).get_output_port()


def add_sines(
    builder: DiagramBuilder,
    name: str,
    amplitude: np.ndarray,
    frequency: np.ndarray,
    phase: np.ndarray,
) -> OutputPort:
    """Return sums of sines, ``sum_m A_im sin(w_im t + p_im)``, shape (N,).

    Args:
        builder: Builder of the diagram.
        name: Of the sum.
        amplitude: A, shape (N, M).
        frequency: w [rad/s], shape (N, M).
        phase: p [rad], shape (N, M).
    """
    source = Sine(amplitude.ravel(), frequency.ravel(), phase.ravel(), is_time_based=True)
    sines = builder.AddNamedSystem(f"{name}_parts", source)
    rows = np.kron(np.eye(len(amplitude)), np.ones(amplitude.shape[1]))
    total = builder.AddNamedSystem(name, MatrixGain(rows))
    builder.Connect(sines.get_output_port(0), total.get_input_port())
    return total.get_output_port()


def add_sum(
    builder: DiagramBuilder, name: str, first: OutputPort, second: OutputPort
) -> OutputPort:
    """Return the sum of two signals of the same size.

    Args:
        builder: Builder of the diagram.
        name: Of the sum.
        first: Shape (n,).
        second: Shape (n,).
    """
    adder = builder.AddNamedSystem(name, Adder(2, first.size()))
    builder.Connect(first, adder.get_input_port(0))
    builder.Connect(second, adder.get_input_port(1))
    return adder.get_output_port()
