"""Addresses of buses."""

import pytest

from pfsc_drake.drivers.udpm import UdpmAddress
from pfsc_drake.errors import InputError


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("udpm://", UdpmAddress("239.255.76.67", 7667, 0)),
        ("udpm://239.255.76.67:7667?ttl=1", UdpmAddress("239.255.76.67", 7667, 1)),
        ("udpm://239.1.2.3", UdpmAddress("239.1.2.3", 7667, 0)),
        ("udpm://:7000?recv_buf_size=100&ttl=3", UdpmAddress("239.255.76.67", 7000, 3)),
    ],
)
def test_addresses_as_lcm_writes_them(url, address):
    assert UdpmAddress.of(url) == address


@pytest.mark.parametrize(
    "url",
    [
        *("memq://", "tcpq://localhost:7700", "", "udpm", "udpm://10.0.0.1", "udpm://localhost"),
        *("udpm://239.1.1.1:70000", "udpm://239.1.1.1?ttl=256", "udpm://?ttl=far", "udpm://[::1"),
    ],
)
def test_what_is_no_address(url):
    with pytest.raises(InputError, match="no bus over UDP multicast; allowed: udpm://ADDRESS:PORT"):
        UdpmAddress.of(url)
