"""Files of profiles."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.point_file import read_profile


def test_columns_in_any_order(tmp_path):
    file = tmp_path / "profile.csv"
    file.write_text("# a vase\nheight,stamp,radius\n0.0,7,0.1\n0.2,8,0.15\n", encoding="utf-8")
    points, notes = read_profile(file, ["radius", "height"])
    assert notes == (f"{file}: column 'stamp' ignored",)
    np.testing.assert_array_equal(points, [[0.1, 0.0], [0.15, 0.2]])


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("radius,height\n0.1,2e4\n", ("line 2", "height", "20000 m", "10000 m")),
        ("radius\n0.1\n", ("line 1", "'height'")),
        ("radius,height,Height\n0.1,0,0\n", ("line 1", "'Height'", "radius, height")),
        ("radius,height\n0.1,a\n", ("line 2", "'a'")),
        ("", ("no points",)),
    ],
)
def test_files_that_are_refused(tmp_path, text, parts):
    file = tmp_path / "profile.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_profile(file, ["radius", "height"])
    for part in (str(file), *parts):
        assert part in str(caught.value)
