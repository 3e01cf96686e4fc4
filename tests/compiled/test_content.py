"""Results that are computed once per content."""

import dataclasses
import functools
import threading

import casadi as ca
import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.compiled import content as module
from pfsc_drake.compiled.content import NoContentError, content, function_digest, once_per_content


@dataclasses.dataclass(frozen=True)
class Link:
    """Holds a number, an array and a name."""

    mass: float
    inertia: np.ndarray
    name: str = "link"


class Lag:
    """Holds a number, a function, and what follows from them."""

    def __init__(self, rate):
        self.rate = rate
        self.function = squared(rate)

    @functools.cached_property
    def period(self):
        return 1.0 / self.rate

    def at(self, time):
        return self.rate * time


class OtherLag(Lag):
    """Is another type with the same attributes."""


class Slotted:
    """Has no dictionary of attributes."""

    __slots__ = ("value",)

    def __init__(self, value):
        self.value = value


def squared(factor, symbol=ca.SX):
    x = symbol.sym("x", 2)
    return ca.Function("squared", [x], [factor * x**2])


def adding(number):
    return lambda x: x + number


def make(mass=1.0, inertia=3.0, name="link"):
    return Link(mass, np.array([1.0, 2.0, inertia]), name)


@pytest.mark.parametrize(
    "create",
    [
        lambda: make(),
        lambda: [make(), {"a": (1, 2.5, "b", None, True)}, {"x", "y"}, b"c", slice(1, 3)],
        lambda: Lag(2.0),
        lambda: Lag(2.0).at,
        lambda: functools.partial(make, 2.0),
        lambda: adding(3.0),
        lambda: squared(2.0),
        lambda: squared(2.0, ca.MX),
        lambda: ca.DM([1.0, 2.0]),
        lambda: ca.MX(ca.DM([1.0, 2.0])),
        lambda: Slotted(np.eye(2)),
        lambda: [Link, make, np.sin, np.float64(1.0), float("nan")],
    ],
)
def test_equal_content_has_an_equal_key(create):
    assert content(create()) == content(create())


LARGE = np.zeros(1000)
CHANGED = LARGE.copy()
CHANGED[700] = 1e-300


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (make(1.0), make(np.nextafter(1.0, 2.0))),
        (make(inertia=3.0), make(inertia=np.nextafter(3.0, 4.0))),
        (make(name="a"), make(name="b")),
        (0.0, -0.0),
        (1, 1.0),
        (1, True),
        (None, False),
        ("1", b"1"),
        (["ab", "c"], ["a", "bc"]),
        ([[1], 2], [1, [2]]),
        ((1, 2), [1, 2]),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
        ("x" * 500, "x" * 499 + "y"),
        (LARGE, CHANGED),
        (np.zeros((2, 3)), np.zeros((3, 2))),
        (np.zeros(2), np.zeros(2, dtype=int)),
        (Lag(2.0), Lag(3.0)),
        (Lag(2.0), OtherLag(2.0)),
        (Lag(2.0).at, Lag(3.0).at),
        (adding(1.0), adding(2.0)),
        (functools.partial(make, 1.0), functools.partial(make, 2.0)),
        (squared(2.0), squared(np.nextafter(2.0, 3.0))),
        (ca.DM([1.0, 0.0]), ca.sparsify(ca.DM([1.0, 0.0]))),
        (ca.MX(ca.DM([1.0, 2.0])), ca.MX(ca.DM([1.0, 2.5]))),
        (Slotted(1.0), Slotted(2.0)),
        (slice(1, 3), slice(1, 4)),
    ],
)
def test_other_content_has_another_key(one, other):
    assert content(one) != content(other)


def test_types_of_equal_names_are_two():
    def local():
        class Local:
            pass

        return Local()

    assert content(local()) != content(local())


def test_what_follows_from_the_rest_does_not_count():
    evaluated = Lag(2.0)
    assert evaluated.period == 0.5
    assert content(evaluated) == content(Lag(2.0))


def test_an_object_may_say_what_decides():
    class Reported:
        def __init__(self, value, scratch):
            self.value, self.scratch = value, scratch

        def __content__(self):
            return self.value

    assert content(Reported(1, 2)) == content(Reported(1, 3))
    assert content(Reported(1, 2)) != content(Reported(2, 2))


def itself():
    value = []
    value.append(value)
    return value


@pytest.mark.parametrize(
    "value",
    [
        DiagramBuilder(),
        [1, {"a": threading.Lock()}],
        ca.SX.sym("x"),
        ca.MX.sym("x"),
        np.array([None]),
        itself(),
        (x for x in range(3)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_has_no_content_is_refused(value):
    with pytest.raises(NoContentError):
        content(value)


class Counted:
    """A function that counts its calls."""

    def __init__(self, **options):
        self.calls = []

        @once_per_content(**options)
        def double(link, factor=2.0):
            self.calls.append((link, factor))
            return Link(factor * link.mass, link.inertia)

        self.double = double


def test_equal_content_gives_the_same_object():
    counted = Counted()
    found = counted.double(make())
    assert counted.double(make()) is found
    assert found.mass == 2.0
    assert len(counted.calls) == 1


def test_any_change_gives_another():
    counted = Counted()
    found = counted.double(make())
    for other in (make(mass=1.0 + 1e-15), make(inertia=3.5), make(name="other")):
        assert counted.double(other) is not found
    assert counted.double(make(), factor=3.0).mass == 3.0
    assert len(counted.calls) == 5


def test_a_changed_argument_has_other_content():
    counted = Counted()
    link = make()
    before = counted.double(link)
    link.inertia[1] += 1e-12
    assert counted.double(link) is not before


def test_the_number_of_results_is_limited():
    counted = Counted(capacity=2)
    first = counted.double(make(1.0))
    counted.double(make(2.0))
    assert counted.double(make(1.0)) is first  # asked for last
    counted.double(make(3.0))
    assert counted.double(make(1.0)) is first
    assert len(counted.calls) == 3
    counted.double(make(2.0))
    assert len(counted.calls) == 4


def test_without_content_the_function_is_called_anew():
    calls = []
    count = once_per_content()(lambda system: calls.append(system))
    builder = DiagramBuilder()
    count(builder)
    count(builder)
    assert len(calls) == 2


def test_an_error_is_raised_each_time():
    @once_per_content()
    def refuse(value):
        raise ValueError(value)

    for _ in range(2):
        with pytest.raises(ValueError, match="3"):
            refuse(3)


def test_arrays_that_are_shared_cannot_be_changed():
    both = once_per_content()(lambda size: (np.zeros(size), np.ones(size)))
    for array in both(2):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0


def test_threads_get_the_same_object():
    start = threading.Barrier(4)

    @once_per_content()
    def wait(link):
        start.wait()
        return Link(2.0 * link.mass, link.inertia)

    found = []
    threads = [threading.Thread(target=lambda: found.append(wait(make()))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert all(one is found[0] for one in found)


def test_the_digest_of_a_function_is_of_what_it_does():
    assert function_digest(squared(2.0)) == function_digest(squared(2.0))
    assert function_digest(squared(2.0)) != function_digest(squared(2.5))


def test_the_number_of_digests_is_limited(monkeypatch):
    monkeypatch.setattr(module, "_MOST_FUNCTIONS", 3)
    for factor in range(10):
        function_digest(squared(factor))
    assert len(module._digests) == 3
