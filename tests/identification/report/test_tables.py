"""Tables: unknown values have no column."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from identification.report.tables import parameter_table, torque_table
from reporting.page import Table
from reporting.terminal import print_table


def findings(spread=np.nan, truth=None):
    base = SimpleNamespace(
        names=["link_1.m + 2 link_2.m"], short_names=["link_1.m"], units=["kg"], rank=1
    )
    runs = SimpleNamespace(
        mean=np.array([-3.0]),
        standard_deviation=np.array([spread]),
        predicted_standard_deviation=np.array([0.015]),
        noise_level=np.array([0.2]),
        error_rms=np.array([0.3]),
        explained=np.array([0.99]),
    )
    estimate = SimpleNamespace(base=base, joint_names=("swing",), joint_units=("rad",))
    return SimpleNamespace(runs=runs, estimate=estimate, truth=truth, prediction=None)


def test_one_run_of_a_real_robot_has_neither_spread_nor_truth():
    table = parameter_table(findings())
    assert table.head == ["", "parameter", "mean", "unit", "predicted in %"]
    assert table.rows == [["1", "link_1.m + 2 link_2.m", -3.0, "kg", pytest.approx(0.5)]]


def test_several_runs_of_a_simulated_one_have():
    table = parameter_table(findings(0.012, np.array([2.9])), words=False)
    assert table.head[4:] == ["of the runs in %", "predicted in %", "true"]
    assert table.rows == [
        ["1", "link_1.m", -3.0, "kg", pytest.approx(0.4), pytest.approx(0.5), 2.9]
    ]


def test_without_another_motion_there_is_no_prediction():
    table = torque_table(findings())
    assert table.rows == [["swing", "Nm", 0.2, 0.3, 99.0]]
    assert len(table.head) == 5


def test_long_tables_are_cut_on_the_terminal():
    stream = io.StringIO()
    table = Table("Many", "", ["name", "value"], [[f"[{k}]", k / 7.0] for k in range(9)])
    print_table(Console(file=stream, width=80), table, most=2)
    text = stream.getvalue()
    assert "[1]" in text and "0.1429" in text
    assert "[2]" not in text
    assert "7 more on the page" in text
