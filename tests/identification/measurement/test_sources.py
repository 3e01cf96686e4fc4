"""Signals of sources at instants between their samples."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder

from identification.measurement.servo import (
    add_curves,
    add_samples,
    add_signs,
    add_sines,
    add_sum,
)

T = np.linspace(0.0, 1.0, 11)


def signal(add, *arguments):
    """Return the value of a source over time."""
    builder = DiagramBuilder()
    builder.ExportOutput(add(builder, "source", *arguments), "signal")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()

    def at(t):
        context.SetTime(t)
        return diagram.GetOutputPort("signal").Eval(context)

    return at


def test_zero_order_hold_and_smooth_samples():
    values = np.column_stack([T**2, 1.0 - T])
    steps, curves = (signal(f, T, values) for f in (add_samples, add_curves))
    np.testing.assert_allclose(steps(0.47), [0.16, 0.6])
    np.testing.assert_allclose(steps(0.4), [0.16, 0.6])
    np.testing.assert_allclose(steps(1.0), [1.0, 0.0])
    np.testing.assert_allclose(curves(0.45), [0.2025, 0.55])


def test_signs_change_between_the_samples():
    v = np.column_stack([T - 0.33, 0.72 - T, np.ones_like(T), T])
    at = signal(add_signs, T, v, np.array([2.0, 3.0, 1.0, 4.0]))
    np.testing.assert_allclose(at(0.0), [-2.0, 3.0, 1.0, 4.0])
    np.testing.assert_allclose(at(0.329), [-2.0, 3.0, 1.0, 4.0])
    np.testing.assert_allclose(at(0.331), [2.0, 3.0, 1.0, 4.0])
    np.testing.assert_allclose(at(0.719), [2.0, 3.0, 1.0, 4.0])
    np.testing.assert_allclose(at(0.721), [2.0, -3.0, 1.0, 4.0])
    np.testing.assert_allclose(at(1.0), [2.0, -3.0, 1.0, 4.0])


def test_sums_of_sines():
    A, w, p = np.random.default_rng(0).uniform(0.5, 2.0, (3, 2, 4))
    at = signal(add_sines, A, w, p)
    np.testing.assert_allclose(at(0.7), np.sum(A * np.sin(w * 0.7 + p), axis=1))


def test_sum():
    def twice(builder, name):
        first = add_samples(builder, "first", T, np.column_stack([T, T**2]))
        return add_sum(builder, name, first, first)

    np.testing.assert_allclose(signal(twice)(0.5), [1.0, 0.5])
