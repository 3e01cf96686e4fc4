"""Tab. B.2 row by row, and Tab. C.3 beside the robot's model."""

import re

import numpy as np
import pytest

from identification.model.dynamic_parameters import parameter_names, true_parameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.robot_parameters import load_parameters
from tests.identification.model.closed_form_base import analytic_base, load_printed_identification

# Tab. B.2 with the errata (rows 1, 2, 12, 18, 22); `m4+` stands for m_4 + m_5 + m_6
TABLE = """
1Izz + 2Iyy + 3Iyy + a1*a1*m2+ + a2*a2*m3+ + a3*a3*m4+ + (n1*n1+2*n1)*1I_M
2Izz + a2*a2*m3+ + n2*n2*2I_M
2mx + a2*m3+
2my
2Ixx - 2Iyy - a2*a2*m3+
2Ixy
2Ixz - a2*3mz
2Iyz
3Izz + 4Iyy + a3*a3*m4+ + d4*d4*m5+
3mx + a3*m4+
3my - 4mz - d4*m5+
3Ixx - 3Iyy + 4Iyy - a3*a3*m4+ + d4*d4*m5+
3Ixy + a3*4mz + a3*d4*m5+
3Ixz
3Iyz
4Izz + 5Iyy
4mx
4my + 5mz
4Ixx - 4Iyy + 5Iyy
4Ixy
4Ixz
4Iyz - d4*5mz
5Izz + 6Iyy
5mx
5my - 6mz
5Ixx - 5Iyy + 6Iyy
5Ixy
5Ixz
5Iyz
6Izz
6mx
6my
6Ixx - 6Iyy
6Ixy
6Ixz
6Iyz
3I_M
4I_M
5I_M
6I_M
"""


def table_of(subject):
    """Return the rows of Tab. B.2 as numbers."""
    dh, gear = load_parameters("comau_racer_1_4").denavit_hartenberg, subject.gear_ratio
    symbols = {f"a{i + 1}": a for i, a in enumerate(dh.a)} | {"d4": dh.d[3]}
    symbols |= {"n1": gear[0], "n2": gear[1]}
    index_of = {name: i for i, name in enumerate(parameter_names(subject))}
    rows = []
    for line in TABLE.split("\n")[1:-1]:
        row = np.zeros(len(index_of))
        for sign, term in re.findall(r"(^|[+-] )([^ ]+)", line):
            *factors, last = term.rsplit("*", 1)
            size = eval(factors[0], symbols.copy()) if factors else 1.0
            if last.endswith("+"):
                names = [f"link_{i}.m" for i in range(int(last[1]), 7)]
            else:
                kind = "joint" if last.endswith("I_M") else "link"
                names = [f"{kind}_{last[0]}.{last[1:]}"]
            for name in names:
                row[index_of[name]] += -size if sign == "- " else size
        rows.append(row)
    return np.vstack([*rows, np.eye(len(index_of))[66:]])


def test_every_row_of_the_table(comau):
    np.testing.assert_allclose(analytic_base(comau).projection, table_of(comau), atol=1e-12)


def test_the_model_is_near_what_was_identified(comau):
    """The shipped model is the nearest consistent one, weighted with the printed deviations."""
    printed = load_printed_identification().base_parameters
    model = analytic_base(comau).projection @ true_parameters(comau)
    deviation = (model - printed.mean) / printed.standard_deviation
    np.testing.assert_allclose(deviation[40:], 0.0, atol=1e-12)
    assert deviation @ deviation == pytest.approx(1346.8, abs=0.1)


def test_noise_of_the_torques():
    torque = load_printed_identification().torque
    np.testing.assert_allclose(torque.noise_level**2, torque.variance, rtol=0.03)


def test_other_robots_have_no_such_table():
    with pytest.raises(InputError, match="'franka_emika_panda': must be a file or one of comau"):
        load_printed_identification("franka_emika_panda")
