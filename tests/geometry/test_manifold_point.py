"""Layout of a path point."""

import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PathPointLayout


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("oriented", [False, True])
def test_fields_tile_the_array(order: int, oriented: bool) -> None:
    layout = PathPointLayout(order, oriented)
    fields = [layout.theta, layout.eta, layout.alpha, layout.status]
    fields += [layout.normal, layout.position, layout.quaternion]
    lengths = [field.stop - field.start for field in fields]
    assert lengths == [1, 1, 1, 1, 3, 3 * (order + 2), 4 * (order + 1) * oriented]
    assert [field.start for field in fields] == [0, *[field.stop for field in fields[:-1]]]
    assert layout.size == sum(lengths)


@pytest.mark.parametrize("order", [0, 6, 1.5])
def test_order_is_checked(order: float) -> None:
    with pytest.raises(InputError, match="from 1 to 5"):
        PathPointLayout(order, True)  # type: ignore[arg-type]
