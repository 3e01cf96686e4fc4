"""Tables of estimates."""

import csv

import numpy as np
import pytest

from identification.elastic.command import table_rows, write_table
from identification.elastic.estimate import JointEstimate
from pfsc_drake.errors import InputError

NAMES = ("stiffness", "damping", "inertia", "coulomb", "viscous", "offset")


@pytest.fixture
def estimates():
    values = np.array([30_123.4, -0.02, 0.174, 4.2, 1.8, 0.0])
    covariance = np.diag([21.0, 0.05, 1e-4, 0.01, 0.005, 0.006]) ** 2
    slide = np.array([5e5, 12.3456, 2.0, 5.0, 12.0, 0.1])
    return [
        JointEstimate("elbow", "rad", values, covariance, NAMES, 0.3, 1000),
        JointEstimate("lift", "m", slide, covariance, NAMES, 0.3, 1000),
    ]


def test_rows_have_the_units_of_the_joint(estimates):
    rows = table_rows(estimates)
    assert rows[0] == ("elbow", "stiffness", 30_123.4, pytest.approx(21.0), "Nm/rad")
    assert rows[8][:2] == ("lift", "inertia") and rows[8][4] == "kg"


def test_file(estimates, tmp_path):
    write_table(tmp_path / "joints.csv", estimates)
    with (tmp_path / "joints.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    assert float(rows[0]["value"]) == pytest.approx(30_123.4)
    assert float(rows[0]["relative_percent"]) == pytest.approx(0.0697, rel=0.01)
    assert rows[5]["relative_percent"] == "inf"
    with pytest.raises(InputError, match="cannot be written: No such"):
        write_table(tmp_path / "none" / "joints.csv", estimates)
