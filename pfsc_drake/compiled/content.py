"""What is made of the same content is made once per process.

Setting up functions takes most of the time that building a station takes, and most stations of a
process, those of a sweep or of a study of margins, have most of their parts in common. What is
decorated with :func:`once_per_content` must be a function of its arguments alone, and what it
returns must never be changed by anybody: CasADi functions, frozen dataclasses of them, tuples,
arrays, which are made read-only.
"""

import enum
import functools
import hashlib
import struct
import threading
import types
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from pathlib import PurePath
from typing import Any, NamedTuple, ParamSpec, TypeVar

import casadi as ca
import numpy as np

__all__ = ["NoContentError", "content", "function_digest", "once_per_content"]

P = ParamSpec("P")
R = TypeVar("R")

# of many functions in a process, those whose digests are kept
_MOST_FUNCTIONS = 1000
# and frozen objects
_MOST_REMEMBERED = 2000
# bytes, up to which nothing is hashed
_SHORT = 200


class NoContentError(TypeError):
    """What an object is cannot be told from what it holds."""


def once_per_content(most_kept: int = 100) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator by which a function returns what it returned for the same content.

    The same content is the same types and the same values to the last bit, however deep. Where an
    argument holds what has no content, a Drake system for example, the function is called anew.

    Args:
        most_kept: Largest number kept of how many contents results are kept, those asked for last.
    """

    def decorator(function: Callable[P, R]) -> Callable[P, R]:
        kept: OrderedDict[Any, R] = OrderedDict()
        lock = threading.Lock()

        @functools.wraps(function)
        def once(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                key = content((args, sorted(kwargs.items())))
            except NoContentError:
                return function(*args, **kwargs)
            with lock:
                if key in kept:
                    kept.move_to_end(key)
                    return kept[key]
            made = function(*args, **kwargs)
            for part in made if isinstance(made, tuple) else (made,):
                if isinstance(part, np.ndarray):
                    part.flags.writeable = False
            with lock:
                # what another thread was first to make has been handed out
                made = kept.setdefault(key, made)
                kept.move_to_end(key)
                while len(kept) > most_kept:
                    kept.popitem(last=False)
            return made

        return once

    return decorator


def content(value: Any) -> bytes:
    """Return a key that is equal for equal content, and for nothing else, in this process.

    Numbers, text, arrays, containers and CasADi functions are told by their values; objects by
    their type and attributes, those left out that a ``cached_property`` has found. An object that
    less decides over says what by a method ``__content__``. Types and functions of Python are
    themselves; of closures and bound methods what they hold counts as well.

    Args:
        value: Anything.

    Raises:
        NoContentError: If something in it has no such content.
    """
    return _Walk().digest(value).key


def function_digest(function: ca.Function) -> bytes:
    """Return a digest of what a CasADi function does.

    Args:
        function: Any function.
    """
    key = function.__hash__()
    found = _digests.get(key)
    if found is None:
        found = function, hashlib.sha256(function.serialize().encode()).digest()
        with _digests_lock:
            # the function is kept, for the key is its address
            _digests[key] = found
            while len(_digests) > _MOST_FUNCTIONS:
                _digests.popitem(last=False)
    return found[1]


_digests: OrderedDict[int, tuple[ca.Function, bytes]] = OrderedDict()
_digests_lock = threading.Lock()


class _Digest(NamedTuple):
    """The digest of a value.

    Attributes:
        key: The digest.
        arrays: Arrays in what else can never change; None if more than these could.
    """

    key: bytes
    arrays: tuple[np.ndarray, ...] | None


class _Remembered(NamedTuple):
    """A frozen object, its digest, and the bytes of its arrays at that time."""

    value: Any
    digest: _Digest
    told: list[bytes]

    def holds(self, value: Any) -> bool:
        """Return whether the digest is still that of the object."""
        arrays = self.digest.arrays or ()
        return self.value is value and [a.tobytes() for a in arrays] == self.told


_remembered: OrderedDict[int, _Remembered] = OrderedDict()
_remembered_lock = threading.Lock()
# types and code of functions, each with its number in this process
_things: dict[Any, int] = {}
_UNCHANGING = (
    str,
    bytes,
    type,
    enum.Enum,
    np.generic,
    np.ufunc,
    PurePath,
    slice,
    ca.Function,
    ca.Sparsity,
    types.BuiltinFunctionType,
    types.CodeType,
)


class _Walk:
    """A walk through a value and all that it holds, each object once."""

    def __init__(self) -> None:
        # the objects are kept, for the keys are their addresses; None of those not left yet
        self._known: dict[int, tuple[Any, _Digest | None]] = {}

    def digest(self, value: Any) -> _Digest:
        """Return the digest of a value."""
        atom = _ATOMS.get(type(value))
        if atom is not None:
            return _Digest(atom(value), ())
        known = self._known.get(id(value))
        if known is None:
            self._known[id(value)] = value, None
            found = self._found(value)
            self._known[id(value)] = value, found
            return found
        if known[1] is None:
            raise NoContentError(f"{type(value).__name__}: holds itself")
        return known[1]

    def _found(self, value: Any) -> _Digest:
        """Return the digest of what this walk has not met; of frozen objects it is remembered."""
        if not _is_frozen(type(value)):
            return self._made(value)
        before = _remembered.get(id(value))
        if before is not None and before.holds(value):
            return before.digest
        made = self._made(value)
        if made.arrays is not None:
            with _remembered_lock:
                told = [array.tobytes() for array in made.arrays]
                _remembered[id(value)] = _Remembered(value, made, told)
                while len(_remembered) > _MOST_REMEMBERED:
                    _remembered.popitem(last=False)
        return made

    def _made(self, value: Any) -> _Digest:
        tag, parts = self._parts(value)
        keys: list[bytes] = []
        held: tuple[np.ndarray, ...] | None = ()
        for part in parts:
            # most parts are atoms
            atom = _ATOMS.get(type(part))
            if atom is not None:
                keys.append(atom(part))
                continue
            key, arrays = self.digest(part)
            keys.append(key)
            held = None if held is None or arrays is None else held + arrays
        key = _hash(tag, keys)
        kind = type(value)
        if issubclass(kind, np.ndarray):
            return _Digest(key, (value,))
        if _never_changes(kind):
            return _Digest(key, ())
        # of cells what they hold can be another tomorrow
        open_ended = issubclass(kind, types.FunctionType) and value.__closure__
        return _Digest(key, held if _never_holds_else(kind) and not open_ended else None)

    def _met(self, thing: Any) -> bytes:
        number = _things.get(thing)
        if number is None:
            with _remembered_lock:
                number = _things.setdefault(thing, len(_things))
        return b"m%d" % number

    def _parts(self, value: Any) -> tuple[bytes, Iterable[Any]]:
        """Return what kind of object it is, and what it holds."""
        if _is_sequence(type(value)):
            return self._met(type(value)), value
        if isinstance(value, ca.Function):
            return b"function", [function_digest(value)]
        if isinstance(value, type | types.BuiltinFunctionType | types.CodeType | np.ufunc):
            return self._met(value), []
        if isinstance(value, types.FunctionType):
            held = tuple(cell.cell_contents for cell in value.__closure__ or ())
            defaults = value.__defaults__, value.__kwdefaults__
            return self._met(value.__code__), [value.__module__, held, *defaults]
        if isinstance(value, types.MethodType):
            return b"method", [value.__self__, value.__func__]
        if isinstance(value, functools.partial):
            return b"partial", [value.func, value.args, value.keywords]
        kind = self._met(type(value))
        if isinstance(value, enum.Enum):
            return kind, [value.name]
        if isinstance(value, np.ndarray | np.generic):
            if value.dtype.hasobject:
                raise NoContentError(f"array of {value.dtype}")
            return kind, [value.dtype.str, value.shape, value.tobytes()]
        if isinstance(value, ca.DM):
            return kind, [value.sparsity(), np.array(value.nonzeros())]
        if isinstance(value, ca.Sparsity):
            return kind, [value.size1(), value.size2(), *value.get_triplet()]
        if isinstance(value, ca.SX | ca.MX):
            return kind, [_constant(value)]
        if isinstance(value, PurePath):
            return kind, [str(value)]
        if isinstance(value, slice):
            return kind, [value.start, value.stop, value.step]
        if isinstance(value, set | frozenset):
            return kind, sorted(self.digest(part).key for part in value)
        if isinstance(value, Mapping):
            return kind, [part for item in value.items() for part in item]
        if hasattr(type(value), "__content__"):
            return kind, [value.__content__()]
        return kind, _reduced(value)


def _short(kind: bytes, value: bytes) -> bytes:
    if len(value) < _SHORT:
        return kind + value
    return kind.upper() + hashlib.sha256(value).digest()


# of values that hold nothing their own digests
_ATOMS: dict[type, Callable[[Any], bytes]] = {
    float: lambda value: b"f" + struct.pack("<d", value),
    str: lambda value: _short(b"s", value.encode("utf-8", "surrogatepass")),
    int: lambda value: b"i%d" % value,
    bool: lambda value: b"t" if value else b"0",
    types.NoneType: lambda _: b"n",
    bytes: lambda value: _short(b"b", value),
}


def _constant(value: ca.SX | ca.MX) -> ca.Function:
    """Return an expression without symbols as a function."""
    try:
        return ca.Function("constant", [], [value])
    except RuntimeError:
        raise NoContentError(f"{value}: has symbols") from None


def _reduced(value: Any) -> list[Any]:
    """Return what pickle would write of an object."""
    try:
        made = value.__reduce_ex__(2)
    except Exception as error:
        raise NoContentError(f"{type(value).__name__}: {error}") from None
    if isinstance(made, str):
        return [made]
    maker, arguments, *rest = made
    state, *items = [*rest, None][: len(rest) or 1]
    parts = state if isinstance(state, tuple) else (state,)
    return [
        maker,
        arguments,
        *(_attributes(type(value), part) for part in parts),
        *(None if part is None else list(part) for part in items[:2]),
    ]


def _once_per_type(tell: Callable[[type], bool]) -> Callable[[type], bool]:
    """Return a function of types that calculates once for each."""
    kept: dict[type, bool] = {}

    def told(kind: type) -> bool:
        found = kept.get(kind)
        if found is None:
            found = kept[kind] = tell(kind)
        return found

    return told


@_once_per_type
def _is_sequence(kind: type) -> bool:
    return issubclass(kind, tuple | list) and not issubclass(kind, enum.Enum)


@_once_per_type
def _never_changes(kind: type) -> bool:
    return issubclass(kind, _UNCHANGING)


@_once_per_type
def _never_holds_else(kind: type) -> bool:
    return _is_frozen(kind) or issubclass(kind, tuple | frozenset | types.FunctionType)


@_once_per_type
def _is_frozen(kind: type) -> bool:
    parameters = getattr(kind, "__dataclass_params__", None)
    return parameters is not None and parameters.frozen and not hasattr(kind, "__content__")


@functools.cache
def _is_found_later(kind: type, name: str) -> bool:
    return isinstance(getattr(kind, name, None), functools.cached_property)


def _attributes(kind: type, state: Any) -> Any:
    """Return an object's attributes by name, without those that follow from others."""
    if not isinstance(state, dict):
        return state
    names = [name for name in sorted(state) if not _is_found_later(kind, name)]
    return tuple((name, state[name]) for name in names)


def _hash(tag: bytes, parts: list[bytes]) -> bytes:
    """Return what tells several parts from all others: themselves if they are short."""
    told = b"".join([b"%d:%s" % (len(part), part) for part in (tag, *parts)])
    return b"p" + told if len(told) < _SHORT else b"h" + hashlib.sha256(told).digest()
