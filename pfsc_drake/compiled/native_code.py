"""CasADi functions as machine code: the interpreter's results, bit for bit, ten times faster.

A CasADi function is a list of instructions, which an interpreter carries out one by one. Here LLVM
turns the same list into machine code: the same operations in the same order, nothing fused, nothing
reordered, and CasADi's own mathematical library for sines and the like. Only the sign of a NaN may
differ. What cannot be translated is left to the interpreter.

Machine code is made without LLVM's optimizations: they take seven times as long, for the whole tick
of an elastic arm more than a second, and gain a fifth. It is kept for the next process.
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
    then there is nothing under that key. Where nothing can be written, nothing is kept.

    Args:
        folder: The folder; it need not exist.
        capacity: Capacity of all files together [bytes]; the oldest give way.
    """

    def __init__(self, folder: Path, capacity: int = 200_000_000) -> None:
        self._folder, self._capacity = folder, capacity

    def get(self, key: str) -> bytes | None:
        """Return what is kept under a key, or None.

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
        """Keep something under a key.

        Args:
            key: A file name.
            code: What to keep.
        """
        with contextlib.suppress(OSError):
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._make_room(len(code) + _DIGEST)
            # another name until it is whole: no one reads half a file
            handle, name = tempfile.mkstemp(dir=self._folder, prefix=".")
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(hashlib.sha256(code).digest() + code)
                Path(name).replace(self._folder / key)
            except OSError:
                Path(name).unlink(missing_ok=True)

    def _make_room(self, size: int) -> None:
        files = [(entry.stat(), entry.path) for entry in os.scandir(self._folder)]
        excess = sum(status.st_size for status, _ in files) + size - self._capacity
        for status, path in sorted(files, key=lambda file: file[0].st_mtime):
            if excess <= 0:
                return
            Path(path).unlink(missing_ok=True)
            excess -= status.st_size


def user_store() -> ObjectStore:
    """Return the store in the user's folder for what can be made again."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        base = Path(given) if Path(given).is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # there is no such user; nothing can be kept below what is no folder
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
        # the code is gone when the engine is
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._evaluate = _PROTOTYPE(self._engine.get_function_address("evaluate"))

    def bind(
        self, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]
    ) -> Callable[[], None]:
        """Return a callable that calculates the results from the arguments.

        The callable keeps code and arrays alive.

        Args:
            arguments: One array for each of the function's arguments: contiguous doubles, as
                many as it has nonzeros. Nothing is checked here.
            results: The same for its results.
        """
        arrays = [*arguments, *results]
        table = (ctypes.c_void_p * len(arrays))(*[array.ctypes.data for array in arrays])
        call = functools.partial(self._evaluate, ctypes.addressof(table))
        vars(call)["keeps_alive"] = (self, table, arrays)
        return call


# the code, or why there is none, what was asked for last at the end; what is bound lives on without
_compiled: dict[str, NativeCode | str] = {}
# of many stations in a process, those whose functions differ need not all be kept
_MOST_KEPT = 300


def native_code(function: ca.Function) -> NativeCode | None:
    """Return the machine code of a function, or None if there can be none.

    Functions of the same content are made once per process, as long as not too many others are
    made in between. It takes 10 to 20 microseconds per
    instruction the first time, as long as the interpreter takes for some thousand evaluations, and
    a few milliseconds in every process after that.

    Args:
        function: Any function; of scalar expressions (SX) or matrix expressions (MX) that is
            compiled, with those that it calls.
    """
    made = _made(function)
    return None if isinstance(made, str) else made


def why_not(function: ca.Function) -> str | None:
    """Return why there is no machine code of a function, or None if there is.

    Args:
        function: Any function.
    """
    made = _made(function)
    return made if isinstance(made, str) else None


def _made(function: ca.Function) -> NativeCode | str:
    key = function_digest(function).hex()
    made = _compiled.pop(key, None)
    if made is None:
        made = _new(function, key)
    _compiled[key] = made
    while len(_compiled) > _MOST_KEPT:
        del _compiled[next(iter(_compiled))]
    return made


def _new(function: ca.Function, key: str) -> NativeCode | str:
    try:
        return NativeCode(_object_code(function, key))
    except Untranslatable as reason:
        return str(reason)
    except Exception as error:
        # whatever is missing or new in llvmlite: it is no reason to stop a controller
        return f"{type(error).__name__}: {error}"


def _object_code(function: ca.Function, key: str) -> bytes:
    """Return the object file of a function, as it was kept or new."""
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
    """Return what object files depend on besides the function."""
    llvm = _llvm()
    sources = sorted(Path(__file__).parent.glob("*.py"))
    program = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    parts = llvm.get_process_triple(), llvm.llvm_version_info, ca.CasadiMeta.version()
    return f"{parts} {sorted(function_symbols())} {program}"


def _machine() -> Any:
    """Return the code generator.

    It uses no instructions beyond those of every such processor: fused multiplication and addition
    would round differently.
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
