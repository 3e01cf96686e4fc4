"""Addresses that no page of another origin guesses."""

from urllib.parse import urlsplit

from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat


def test_two_scenes_are_at_addresses_that_nobody_guesses():
    hosts = {urlsplit(hidden_meshcat().web_url()).hostname for _ in range(3)}
    assert all(host.startswith("127.") for host in hosts)
    if hosts != {"127.0.0.1"}:  # a system with one address for itself
        assert len(hosts) == 3
