"""Processes of this machine, which accept work from each other only."""

import pytest

from reporting.processes import local_cluster


@pytest.mark.slow
def test_a_stranger_on_this_machine_is_not_served():
    distributed = pytest.importorskip("distributed")
    with local_cluster(1, "reporting.processes") as client:
        assert client.submit(sum, [1, 2]).result() == 3
        address = client.scheduler.address
        strangers = (
            (address.replace("tls://", "tcp://"), None),
            (address, distributed.Security.temporary()),
        )
        for at, security in strangers:
            with pytest.raises(OSError):
                distributed.Client(at, timeout="3s", security=security, set_as_default=False)
