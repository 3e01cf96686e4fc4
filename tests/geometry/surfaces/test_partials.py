"""Rows of partial derivatives, and the layout of a surface point."""

import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    SurfacePointLayout,
    partial_count,
    partial_index,
    partial_orders,
)


def test_rows_by_total_order_then_from_theta_1_to_theta_2():
    expected = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]
    assert partial_orders(3) == expected


@pytest.mark.parametrize("order", range(7))
def test_index_and_count_agree_with_the_list(order):
    orders = partial_orders(order)
    assert len(orders) == partial_count(order)
    assert [partial_index(i, j) for i, j in orders] == list(range(len(orders)))


@pytest.mark.parametrize("oriented", [False, True])
@pytest.mark.parametrize("order", range(1, 6))
def test_slices_of_a_point_follow_each_other(order, oriented):
    layout = SurfacePointLayout(order, oriented)
    slices = [layout.theta, layout.eta, layout.alpha, layout.status, layout.position]
    slices.append(layout.quaternion)
    lengths = [s.stop - s.start for s in slices]
    quaternion = 4 * partial_count(order) if oriented else 0
    assert lengths == [2, 2, 1, 1, 3 * partial_count(order + 1), quaternion]
    assert [s.start for s in slices] == [0, *(s.stop for s in slices[:-1])]
    assert layout.size == layout.quaternion.stop == sum(lengths)


@pytest.mark.parametrize("order", [0, 6, -1, 1.0])
def test_order_of_a_point_out_of_range(order):
    with pytest.raises(InputError, match=r"order of surface point: .* from 1 to 5"):
        SurfacePointLayout(order, oriented=False)
