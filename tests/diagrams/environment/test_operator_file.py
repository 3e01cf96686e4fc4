"""Files of recorded controls."""

import numpy as np
import pytest

from diagrams.environment.operator import columns, controls_text, read_controls
from pfsc_drake.errors import InputError

REGIONS, PERIOD = ["cylinder"], 2e-3


def test_what_is_written_is_read_back_to_the_last_bit(tmp_path):
    random = np.random.default_rng(3)
    rows = list(random.normal(0.0, 10.0, (20, len(columns(REGIONS)))))
    rows[3][:] = [1.0, 0.0, -1.0, 1e-17, 1 / 3, -0.0, 5e-300, *rows[3][7:]]
    ticks = np.cumsum(random.integers(1, 2000, 20)) * np.array([0, *[1] * 19])
    file = tmp_path / "operator.csv"
    file.write_text(controls_text(ticks.tolist(), rows, REGIONS, PERIOD), encoding="utf-8")
    read_ticks, read = read_controls(str(file), REGIONS, PERIOD)
    assert np.array_equal(read_ticks, ticks)
    assert read.tobytes() == np.array(rows).tobytes()


@pytest.mark.parametrize("column", ["time", "tick"])
@pytest.mark.parametrize(
    ("times", "what"), [([0, 5, 5], "increase"), ([1, 2, 3], "from 0"), ([0, 2.5, 3], "whole")]
)
def test_times_that_cannot_be_are_refused(tmp_path, column, times, what):
    file = tmp_path / "operator.csv"
    rows = [np.zeros(len(columns([])))] * 3
    text = controls_text(times, rows, [], 1.0).replace("time", column, 1)
    file.write_text(text, encoding="utf-8")
    if (column, what) == ("time", "whole"):
        assert read_controls(str(file), [], 1.0)[0].tolist() == [0.0, 3.0, 3.0]
        return
    with pytest.raises(InputError, match=f"column '{column}' must .*{what}"):
        read_controls(str(file), [], 1.0)


def test_a_column_for_every_region_is_required(tmp_path):
    file = tmp_path / "operator.csv"
    file.write_text(controls_text([0], [np.zeros(len(columns([])))], [], PERIOD), encoding="utf-8")
    with pytest.raises(InputError, match="'region_cylinder' is missing"):
        read_controls(str(file), REGIONS, PERIOD)
