"""Who leads, for how long, and what is nonsense."""

import json
from types import SimpleNamespace

import pytest

from experiments.live.page_server import LEAVE, TAKE, Pages
from pfsc_drake.errors import InputError

PULL, KEY = "pull x [N]", "across k"


@pytest.fixture
def clock():
    return SimpleNamespace(now=50.0)


@pytest.fixture
def pages(clock):
    pages = Pages(lambda: clock.now)
    pages.expect([PULL], [KEY])
    return pages


def say(pages, client, **entries):
    return pages.hear(json.dumps({"client": client, **entries}).encode())


def test_nobody_leads_at_first_and_then_who_is_heard_first(pages):
    assert pages.leader is None
    assert pages.heard().let_go
    assert say(pages, "a", hand={PULL: 3.5}, set={KEY: 2})
    assert not say(pages, "b", hand={PULL: -20}, set={KEY: 7})
    assert pages.leader == "a"
    heard = pages.heard()
    assert heard.hand == {PULL: 3.5}
    assert heard.settings == [(KEY, 2.0)]
    assert pages.heard().settings == []


def test_a_hand_is_what_was_heard_last_and_nothing_after_a_silence(pages, clock):
    say(pages, "a", hand={PULL: 3.5})
    pages.heard()
    clock.now += 0.29
    assert pages.heard().hand == {PULL: 3.5}
    assert not pages.heard().let_go
    clock.now += 0.02
    assert pages.heard().hand == {}
    assert pages.heard().let_go
    say(pages, "a", hand={PULL: 3.5})
    assert pages.heard().hand == {PULL: 3.5}
    say(pages, "a")
    heard = pages.heard()
    assert heard.hand == {}
    assert not heard.let_go


def test_another_leads_when_the_first_is_silent_leaves_or_is_taken_the_lead_from(pages, clock):
    say(pages, "a", hand={PULL: 3.5})
    clock.now += 2.9
    assert not say(pages, "b")
    clock.now += 0.2
    assert pages.leader is None
    assert say(pages, "b")
    assert not say(pages, "a")
    assert say(pages, "a", lead=TAKE, hand={PULL: 1.0})
    assert pages.leader == "a"
    pages.heard()
    assert not say(pages, "a", lead=LEAVE)
    assert pages.leader is None
    assert pages.heard().let_go
    assert say(pages, "b")
    assert not say(pages, "c", lead=LEAVE)
    assert pages.leader == "b"


def test_what_one_hand_asked_for_is_not_done_by_the_next(pages):
    say(pages, "a", hand={PULL: 3.5}, set={KEY: 2})
    say(pages, "b", lead=TAKE, hand={PULL: -1.0})
    heard = pages.heard()
    assert heard.let_go
    assert heard.hand == {PULL: -1.0}
    assert heard.settings == []
    assert not pages.heard().let_go


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"", "not JSON"),
        (b"[[", "not JSON"),
        (b"[" * 5000, "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b'{"client": "a", "set": {"across k": ' + b"9" * 5000 + b"}}", "not JSON"),
        (b'["pull x [N]", 3.5]', "no JSON object"),
        (b"{}", "client"),
        (b'{"client": 3}', "client"),
        (b'{"client": ""}', "client"),
        (b'{"client": "' + b"a" * 65 + b'"}', "client"),
        (b'{"client": "a", "force": 3}', "'force'"),
        (b'{"client": "a", "lead": "please"}', "'please'"),
        (b'{"client": "a", "lead": []}', "lead"),
        (b'{"client": "a", "hand": [1, 2]}', "hand"),
        (b'{"client": "a", "hand": null}', "hand"),
        (b'{"client": "a", "hand": {"pull x [N]": "3"}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": true}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": NaN}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": 1e999}}', "'pull x [N]'"),
        (b'{"client": "a", "hand": {"pull x [N]": ' + b"9" * 400 + b"}}", "'pull x [N]'"),
        (b'{"client": "a", "hand": {"across k": 1}}', "'across k' is no control"),
        (b'{"client": "a", "set": {"pull x [N]": 1}}', "'pull x [N]' is no control"),
        (b'{"client": "a", "set": {"' + b"k" * 900 + b'": 1}}', "kkk...kkk"),
    ],
)
def test_nonsense_is_refused_and_changes_nothing(pages, content, named):
    with pytest.raises(InputError) as error:
        pages.hear(content)
    assert named in str(error.value)
    assert len(str(error.value)) < 150
    assert pages.leader is None
