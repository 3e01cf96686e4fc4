"""CasADi functions as machine code: the interpreter's results, bit for bit, ten times faster.

A CasADi function is a list of instructions, which an interpreter executes one by one. Here LLVM
translates the same list into machine code: the same operations in the same order, nothing fused,
nothing reordered, and CasADi's own mathematical library for sines and the like. Only the sign of
a NaN may differ. A function that cannot be translated is left to the interpreter.

LLVM's optimizations are not used: they take seven times as long, for the whole tick of an elastic
arm more than a second, and gain a fifth. Machine code is cached on disk for the next process.
"""

import contextlib
import ctypes
import functools
import hashlib
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.compiled.content import function_digest
from pfsc_drake.compiled.operations import Untranslatable, function_symbols
from pfsc_drake.compiled.translation import translate

__all__ = ["NativeCode", "ObjectStore", "native_code", "user_store", "why_not"]

_DIGEST = hashlib.sha256().digest_size


class ObjectStore:
    """A folder of object files.

    Any number of processes may share it, and everything in it may be lost or damaged at any time:
    then the key is missing. If the folder cannot be written, nothing is stored.

    Args:
        folder: The folder; it need not exist.
        capacity: Capacity of all files together [bytes]; the oldest are deleted.
    """

    def __init__(self, folder: Path, capacity: int = 200_000_000) -> None:
        self._folder, self._capacity = folder, capacity

    def get(self, key: str) -> bytes | None:
        """Return the content under a key, or None.

        Args:
            key: A file name.
        """
        try:
            content = (self._folder / key).read_bytes()
        except OSError:
            return None
        digest, code = content[:_DIGEST], content[_DIGEST:]
        return code if digest == hashlib.sha256(code).digest() else None

    def put(self, key: str, code: bytes) -> None:
        """Store content under a key.

        Args:
            key: A file name.
            code: The content.
        """
        with contextlib.suppress(OSError):
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._delete_oldest(len(code) + _DIGEST)
            # under another name until it is complete: no one reads half a file
            handle, name = tempfile.mkstemp(dir=self._folder, prefix=".")
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(hashlib.sha256(code).digest() + code)
                Path(name).replace(self._folder / key)
            except OSError:
                Path(name).unlink(missing_ok=True)

    def _delete_oldest(self, size: int) -> None:
        files = [(entry.stat(), entry.path) for entry in os.scandir(self._folder)]
        excess = sum(status.st_size for status, _ in files) + size - self._capacity
        for status, path in sorted(files, key=lambda file: file[0].st_mtime):
            if excess <= 0:
                return
            Path(path).unlink(missing_ok=True)
            excess -= status.st_size


def user_store() -> ObjectStore:
    """Return the store in the user's cache folder."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    try:
        base = Path(cache_home) if Path(cache_home).is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # no such user; nothing can be stored below a path that is no folder
        base = Path(os.devnull)
    return ObjectStore(base / "pfsc_drake" / "machine_code")


# holds the GIL: releasing it takes longer than most functions
_PROTOTYPE = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)


class NativeCode:
    """Machine code of one function, for any number of sets of arrays.

    Args:
        code: An object file that defines ``evaluate(table)``, see
            :func:`~pfsc_drake.compiled.translation.translate`.

    Raises:
        ImportError: If llvmlite is not installed.
        RuntimeError: If LLVM has no code generator for this machine, or cannot read the file.
    """

    def __init__(self, code: bytes) -> None:
        llvm = _llvm()
        # the code lives as long as the engine
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._evaluate = _PROTOTYPE(self._engine.get_function_address("evaluate"))

    def bind(
        self, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]
    ) -> Callable[[], None]:
        """Return a callable that computes the results from the arguments.

        The callable keeps code and arrays alive.

        Args:
            arguments: One array for each of the function's arguments: contiguous doubles, as many
                as it has nonzeros. They are not checked.
            results: The same for its results.
        """
        arrays = [*arguments, *results]
        table = (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])
        call = functools.partial(self._evaluate, ctypes.addressof(table))
        vars(call)["keeps_alive"] = (self, table, arrays)
        return call


# the code, or the reason why there is none, most recently used last; bound code lives on without it
_codes: dict[str, NativeCode | str] = {}
# upper limit: many stations in a process may have different functions
_MOST_CODES = 300


def native_code(function: ca.Function) -> NativeCode | None:
    """Return the machine code of a function, or None if it cannot be compiled.

    Functions of the same content are compiled once per process, as long as not too many others are
    compiled in between. The first compilation takes 10 to 20 microseconds per instruction, as long
    as some thousand evaluations in the interpreter; each later process takes a few milliseconds.

    Args:
        function: Any function; functions of scalar (SX) or matrix expressions (MX) are compiled,
            with those that they call.
    """
    code = _code_or_reason(function)
    return None if isinstance(code, str) else code


def why_not(function: ca.Function) -> str | None:
    """Return why a function cannot be compiled, or None if it can.

    Args:
        function: Any function.
    """
    code = _code_or_reason(function)
    return code if isinstance(code, str) else None


def _code_or_reason(function: ca.Function) -> NativeCode | str:
    key = function_digest(function).hex()
    code = _codes.pop(key, None)
    if code is None:
        code = _compile(function, key)
    _codes[key] = code
    while len(_codes) > _MOST_CODES:
        del _codes[next(iter(_codes))]
    return code


def _compile(function: ca.Function, key: str) -> NativeCode | str:
    try:
        return NativeCode(_object_code(function, key))
    except Untranslatable as reason:
        return str(reason)
    except Exception as error:
        # a missing or changed part of llvmlite is no reason to stop a controller
        return f"{type(error).__name__}: {error}"


def _object_code(function: ca.Function, key: str) -> bytes:
    """Return the object file of a function, stored or new."""
    llvm, store = _llvm(), user_store()
    name = hashlib.sha256(f"{_maker()} {key}".encode()).hexdigest()
    code = store.get(name)
    if code is None:
        module = llvm.parse_assembly(translate(function))
        module.verify()
        code = _machine().emit_object(module)
        module.close()
        store.put(name, code)
    return code


@functools.cache
def _maker() -> str:
    """Return a text of everything that object files depend on besides the function."""
    llvm = _llvm()
    sources = sorted(Path(__file__).parent.glob("*.py"))
    program = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    parts = llvm.get_process_triple(), llvm.llvm_version_info, ca.CasadiMeta.version()
    return f"{parts} {sorted(function_symbols())} {program}"


def _machine() -> Any:
    """Return the code generator.

    Its instructions are those of every such processor: fused multiplication and addition would
    round differently.
    """
    return _llvm().Target.from_default_triple().create_target_machine(opt=0, jit=True)


@functools.cache
def _llvm() -> Any:
    """Return llvmlite, ready for this machine."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    for name, address in function_symbols().items():
        llvm.add_symbol(name, address)
    return llvm
