"""Names of columns, and files that are not there."""

import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import check_columns, read_regular_file

KNOWN = ["radius", "height"]


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (["radius"], "here: column 'height' is missing; it is required"),
        (["other"], "here: column 'other' is unknown; allowed: radius, height"),
        ([], "here: columns 'radius', 'height' are missing; required"),
        (
            ["radus", "heigth"],
            "here: 2 things are wrong: (1) column 'radus' is unknown; allowed: radius, height; "
            "did you mean 'radius'?; (2) column 'heigth' is unknown; allowed: radius, height; "
            "did you mean 'height'?",
        ),
        (
            ["radius", "radius", "x"],
            "here: 2 things are wrong: (1) column 'radius' twice; once is allowed; "
            "(2) column 'x' is unknown; allowed: radius, height",
        ),
        (
            ["0.1", "0.2"],
            "here: column '0.1' is unknown; allowed: radius, height; the first line names the "
            "columns",
        ),
    ],
)
def test_all_columns_that_are_wrong(header, message):
    with pytest.raises(InputError) as caught:
        check_columns("here", header, KNOWN, KNOWN)
    assert str(caught.value) == message


def test_the_nearest_file(tmp_path):
    (tmp_path / "profile.csv").touch()
    with pytest.raises(InputError, match=r"No such file.*; did you mean 'profile\.csv'\?; a read"):
        read_regular_file(tmp_path / "profle.csv", "CSV")
    with pytest.raises(InputError, match="Is a directory; a readable CSV"):
        read_regular_file(tmp_path, "CSV")
