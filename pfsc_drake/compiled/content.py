"""Results that are computed once per process for the same content.

The setup of functions takes most of the time that building a station takes, and most stations of a
process, such as those of a sweep or of a study of margins, share most of their parts. A function
decorated with :func:`once_per_content` must depend on its arguments alone, and its results must
never be changed: CasADi functions, frozen dataclasses of them, tuples, arrays, which become
read-only.
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

# functions in a process whose digests are stored
_MOST_FUNCTIONS = 1000
# frozen objects whose digests are stored
_MOST_REMEMBERED = 2000
# bytes, up to which nothing is hashed
_SHORT = 200


class NoContentError(TypeError):
    """Error for an object whose content cannot be found from its attributes."""


def once_per_content(capacity: int = 100) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that reuses the result of a function for the same content.

    The same content is the same types and the same values to the last bit, however deep. If an
    argument has no content, such as a Drake system, the function is called anew.

    Args:
        capacity: Largest number of stored results; the least recently used ones are dropped.
    """

    def decorator(function: Callable[P, R]) -> Callable[P, R]:
        results: OrderedDict[Any, R] = OrderedDict()
        lock = threading.Lock()

        @functools.wraps(function)
        def once(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                key = content((args, sorted(kwargs.items())))
            except NoContentError:
                return function(*args, **kwargs)
            with lock:
                if key in results:
                    results.move_to_end(key)
                    return results[key]
            result = function(*args, **kwargs)
            for part in result if isinstance(result, tuple) else (result,):
                if isinstance(part, np.ndarray):
                    part.flags.writeable = False
            with lock:
                # if another thread was first, its result has been handed out
                result = results.setdefault(key, result)
                results.move_to_end(key)
                while len(results) > capacity:
                    results.popitem(last=False)
            return result

        return once

    return decorator


def content(value: Any) -> bytes:
    """Return a key that is equal for equal content, and for nothing else, in this process.

    Numbers, text, arrays, containers and CasADi functions are compared by value; objects by type
    and attributes, without those computed by a ``cached_property``. An object that depends on less
    returns it from a method ``__content__``. Types and functions of Python are themselves; for
    closures and bound methods the values they hold count as well.

    Args:
        value: Anything.

    Raises:
        NoContentError: If a part of it has no content.
    """
    return _Walk().digest(value).key


def function_digest(function: ca.Function) -> bytes:
    """Return a digest of a CasADi function's instructions.

    Args:
        function: Any function.
    """
    key = function.__hash__()
    found = _digests.get(key)
    if found is None:
        found = function, hashlib.sha256(function.serialize().encode()).digest()
        with _digests_lock:
            # the function is stored too, for the key is its address
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
        arrays: Its arrays, if everything else is immutable; otherwise None.
    """

    key: bytes
    arrays: tuple[np.ndarray, ...] | None


class _Remembered(NamedTuple):
    """A frozen object, its digest, and the bytes of its arrays at that time."""

    value: Any
    digest: _Digest
    contents: list[bytes]

    def holds(self, value: Any) -> bool:
        """Return whether the digest is still valid for the object."""
        arrays = self.digest.arrays or ()
        return self.value is value and [a.tobytes() for a in arrays] == self.contents


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
    """A traversal of a value and all its parts, each object once."""

    def __init__(self) -> None:
        # with the objects, for the keys are their addresses; None for those in progress
        self._known: dict[int, tuple[Any, _Digest | None]] = {}

    def digest(self, value: Any) -> _Digest:
        """Return the digest of a value."""
        atom = _ATOMS.get(type(value))
        if atom is not None:
            return _Digest(atom(value), ())
        known = self._known.get(id(value))
        if known is None:
            self._known[id(value)] = value, None
            found = self._digest_of_object(value)
            self._known[id(value)] = value, found
            return found
        if known[1] is None:
            raise NoContentError(f"{type(value).__name__}: holds itself")
        return known[1]

    def _digest_of_object(self, value: Any) -> _Digest:
        """Return the digest of an object that is new to this traversal, stored if frozen."""
        if not _is_frozen(type(value)):
            return self._new_digest(value)
        before = _remembered.get(id(value))
        if before is not None and before.holds(value):
            return before.digest
        result = self._new_digest(value)
        if result.arrays is not None:
            with _remembered_lock:
                contents = [array.tobytes() for array in result.arrays]
                _remembered[id(value)] = _Remembered(value, result, contents)
                while len(_remembered) > _MOST_REMEMBERED:
                    _remembered.popitem(last=False)
        return result

    def _new_digest(self, value: Any) -> _Digest:
        tag, parts = self._parts(value)
        keys: list[bytes] = []
        arrays: tuple[np.ndarray, ...] | None = ()
        for part in parts:
            # most parts are atoms
            atom = _ATOMS.get(type(part))
            if atom is not None:
                keys.append(atom(part))
                continue
            key, part_arrays = self.digest(part)
            keys.append(key)
            arrays = None if arrays is None or part_arrays is None else arrays + part_arrays
        key = _hash(tag, keys)
        kind = type(value)
        if issubclass(kind, np.ndarray):
            return _Digest(key, (value,))
        if _never_changes(kind):
            return _Digest(key, ())
        # the cells of a closure may change
        open_ended = issubclass(kind, types.FunctionType) and value.__closure__
        return _Digest(key, arrays if _never_holds_else(kind) and not open_ended else None)

    def _type_key(self, thing: Any) -> bytes:
        number = _things.get(thing)
        if number is None:
            with _remembered_lock:
                number = _things.setdefault(thing, len(_things))
        return b"m%d" % number

    def _parts(self, value: Any) -> tuple[bytes, Iterable[Any]]:
        """Return the kind of an object, and its parts."""
        if _is_sequence(type(value)):
            return self._type_key(type(value)), value
        if isinstance(value, ca.Function):
            return b"function", [function_digest(value)]
        if isinstance(value, type | types.BuiltinFunctionType | types.CodeType | np.ufunc):
            return self._type_key(value), []
        if isinstance(value, types.FunctionType):
            cells = tuple(cell.cell_contents for cell in value.__closure__ or ())
            defaults = value.__defaults__, value.__kwdefaults__
            return self._type_key(value.__code__), [value.__module__, cells, *defaults]
        if isinstance(value, types.MethodType):
            return b"method", [value.__self__, value.__func__]
        if isinstance(value, functools.partial):
            return b"partial", [value.func, value.args, value.keywords]
        kind = self._type_key(type(value))
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
        return kind, _pickle_parts(value)


def _short(kind: bytes, value: bytes) -> bytes:
    if len(value) < _SHORT:
        return kind + value
    return kind.upper() + hashlib.sha256(value).digest()


# for values without parts, their digests
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


def _pickle_parts(value: Any) -> list[Any]:
    """Return the parts that pickle would write for an object."""
    try:
        result = value.__reduce_ex__(2)
    except Exception as error:
        raise NoContentError(f"{type(value).__name__}: {error}") from None
    if isinstance(result, str):
        return [result]
    maker, arguments, *rest = result
    state, *items = [*rest, None][: len(rest) or 1]
    parts = state if isinstance(state, tuple) else (state,)
    return [
        maker,
        arguments,
        *(_attributes(type(value), part) for part in parts),
        *(None if part is None else list(part) for part in items[:2]),
    ]


def _once_per_type(test: Callable[[type], bool]) -> Callable[[type], bool]:
    """Return a function of types that is evaluated once for each."""
    results: dict[type, bool] = {}

    def cached(kind: type) -> bool:
        found = results.get(kind)
        if found is None:
            found = results[kind] = test(kind)
        return found

    return cached


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
def _is_cached_property(kind: type, name: str) -> bool:
    return isinstance(getattr(kind, name, None), functools.cached_property)


def _attributes(kind: type, state: Any) -> Any:
    """Return an object's attributes by name, without cached properties."""
    if not isinstance(state, dict):
        return state
    names = [name for name in sorted(state) if not _is_cached_property(kind, name)]
    return tuple((name, state[name]) for name in names)


def _hash(tag: bytes, parts: list[bytes]) -> bytes:
    """Return a key of several parts: the parts themselves if they are short."""
    joined = b"".join([b"%d:%s" % (len(part), part) for part in (tag, *parts)])
    return b"p" + joined if len(joined) < _SHORT else b"h" + hashlib.sha256(joined).digest()
