"""The address of an LCM bus over UDP multicast."""

import ipaddress
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from pfsc_drake.errors import InputError

# LCM's own
_ADDRESS, _PORT = "239.255.76.67", 7667


@dataclass(frozen=True)
class UdpmAddress:
    """Where the messages of a bus are sent.

    Attributes:
        address: Multicast address.
        port: Port.
        ttl: How many routers they may pass; 0 keeps them on this machine.
    """

    address: str
    port: int
    ttl: int

    @classmethod
    def of(cls, url: str) -> "UdpmAddress":
        """Read an address as LCM writes it, ``udpm://239.255.76.67:7667?ttl=0``.

        Args:
            url: The address; what is left out of it is as LCM has it.

        Raises:
            InputError: If it is none.
        """
        try:
            parts = urlsplit(url)
            found = cls(
                parts.hostname or _ADDRESS,
                parts.port or _PORT,
                int(parse_qs(parts.query).get("ttl", ["0"])[0]),
            )
            is_good = ipaddress.IPv4Address(found.address).is_multicast and 0 <= found.ttl <= 255
        except ValueError:
            is_good = False
        if not url.startswith("udpm://") or not is_good:
            raise InputError(
                f"--lcm {url}: no bus over UDP multicast; allowed: udpm://ADDRESS:PORT?ttl=N, "
                "ADDRESS from 224.0.0.0 to 239.255.255.255"
            )
        return found
