"""CasADi functions as machine code: the interpreter's results, bit for bit, ten times faster.

A CasADi function of scalars is a list of instructions, which an interpreter carries out one by
one. Here LLVM turns the same list into machine code: the same operations in the same order,
nothing fused, nothing reordered, and CasADi's own mathematical library for sines and the like.
Only the sign of a NaN may differ. llvmlite is optional; what it cannot do is left to the
interpreter.
"""

import ctypes
import functools
import hashlib
import math
import struct
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

__all__ = ["NativeCode", "native_code", "translate"]

# machine code without optimizations keeps every value on the stack
_MOST_INSTRUCTIONS = 50_000

# {v} is the result, {x} and {y} are the operands
_INLINE = {
    ca.OP_ADD: ("{v} = fadd double {x}, {y}",),
    ca.OP_SUB: ("{v} = fsub double {x}, {y}",),
    ca.OP_MUL: ("{v} = fmul double {x}, {y}",),
    ca.OP_DIV: ("{v} = fdiv double {x}, {y}",),
    ca.OP_NEG: ("{v} = fneg double {x}",),
    ca.OP_SQ: ("{v} = fmul double {x}, {x}",),
    ca.OP_TWICE: ("{v} = fmul double 2.0, {x}",),
    ca.OP_INV: ("{v} = fdiv double 1.0, {x}",),
    ca.OP_SQRT: ("{v} = call double @llvm.sqrt.f64(double {x})",),
    ca.OP_FABS: ("{v} = call double @llvm.fabs.f64(double {x})",),
    ca.OP_COPYSIGN: ("{v} = call double @llvm.copysign.f64(double {x}, double {y})",),
    # NaN is not less, not equal, and true
    ca.OP_LT: ("{v}a = fcmp olt double {x}, {y}", "{v} = uitofp i1 {v}a to double"),
    ca.OP_LE: ("{v}a = fcmp ole double {x}, {y}", "{v} = uitofp i1 {v}a to double"),
    ca.OP_EQ: ("{v}a = fcmp oeq double {x}, {y}", "{v} = uitofp i1 {v}a to double"),
    ca.OP_NE: ("{v}a = fcmp une double {x}, {y}", "{v} = uitofp i1 {v}a to double"),
    ca.OP_NOT: ("{v}a = fcmp oeq double {x}, 0.0", "{v} = uitofp i1 {v}a to double"),
    ca.OP_AND: (
        "{v}a = fcmp une double {x}, 0.0",
        "{v}b = fcmp une double {y}, 0.0",
        "{v}c = and i1 {v}a, {v}b",
        "{v} = uitofp i1 {v}c to double",
    ),
    ca.OP_OR: (
        "{v}a = fcmp une double {x}, 0.0",
        "{v}b = fcmp une double {y}, 0.0",
        "{v}c = or i1 {v}a, {v}b",
        "{v} = uitofp i1 {v}c to double",
    ),
    ca.OP_IF_ELSE_ZERO: (
        "{v}a = fcmp oeq double {x}, 0.0",
        "{v} = select i1 {v}a, double 0.0, double {y}",
    ),
    # a number rather than NaN; of 0 and -0, which the standard leaves open, CasADi's is the first
    ca.OP_FMIN: (
        "{v}a = fcmp olt double {y}, {x}",
        "{v}b = fcmp uno double {x}, {x}",
        "{v}c = or i1 {v}a, {v}b",
        "{v} = select i1 {v}c, double {y}, double {x}",
    ),
    ca.OP_FMAX: (
        "{v}a = fcmp ogt double {y}, {x}",
        "{v}b = fcmp uno double {x}, {x}",
        "{v}c = or i1 {v}a, {v}b",
        "{v} = select i1 {v}c, double {y}, double {x}",
    ),
    # of NaN it is NaN, of -0 it is -0
    ca.OP_SIGN: (
        "{v}a = fcmp ogt double {x}, 0.0",
        "{v}b = select i1 {v}a, double 1.0, double {x}",
        "{v}c = fcmp olt double {x}, 0.0",
        "{v} = select i1 {v}c, double -1.0, double {v}b",
    ),
}
_UNARY_CALLS = {
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_ERF: "erf",
    ca.OP_LOG1P: "log1p",
    ca.OP_EXPM1: "expm1",
}
_BINARY_CALLS = {
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_FMOD: "fmod",
    ca.OP_REMAINDER: "remainder",
    ca.OP_ATAN2: "atan2",
    ca.OP_HYPOT: "hypot",
}
_MODULE = """\
declare double @llvm.sqrt.f64(double)
declare double @llvm.fabs.f64(double)
declare double @llvm.copysign.f64(double, double)
define void @evaluate(ptr %table) nounwind {{
{body}
ret void
}}
"""

# holds the GIL: releasing it takes longer than most functions
_PROTOTYPE = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)


class NativeCode:
    """Machine code of one function, for any number of sets of arrays.

    Args:
        source: LLVM assembly that defines ``evaluate(table)``, see :func:`translate`.

    Raises:
        ImportError: If llvmlite is not installed.
        RuntimeError: If LLVM has no code generator for this machine.
    """

    def __init__(self, source: str) -> None:
        llvm = _llvm()
        module = llvm.parse_assembly(source)
        module.verify()
        # Without optimization the code takes 3 microseconds where the best takes 2, and is made in
        # a tenth of the time. No instructions beyond those of every such processor: fused
        # multiplication and addition would round differently.
        machine = llvm.Target.from_default_triple().create_target_machine(opt=0, jit=True)
        # the code is gone when the engine is, but needs four times less memory than its source
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()
        address = self._engine.get_function_address("evaluate")
        self._engine.remove_module(module)
        module.close()
        self._evaluate = _PROTOTYPE(address)

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


_compiled: dict[bytes, NativeCode | None] = {}


def native_code(function: ca.Function) -> NativeCode | None:
    """Return the machine code of a function, or None if there can be none.

    Functions of the same content are compiled once per process. It takes 10 microseconds per
    instruction, as long as the interpreter takes for 2000 evaluations.

    Args:
        function: Any function; only functions of scalar expressions (SX) are compiled.
    """
    if not function.is_a("SXFunction") or function.n_instructions() > _MOST_INSTRUCTIONS:
        return None
    key = hashlib.sha256(function.serialize().encode()).digest()
    if key not in _compiled:
        _compiled[key] = _compile(function)
    return _compiled[key]


def _compile(function: ca.Function) -> NativeCode | None:
    try:
        # without it there is no need to translate
        _llvm()
        source = translate(function)
        return None if source is None else NativeCode(source)
    except Exception:
        # whatever is missing or new in llvmlite: it is no reason to stop a controller
        return None


def translate(function: ca.Function) -> str | None:
    """Return a function in LLVM assembly, or None if it contains an unknown operation.

    It defines ``void evaluate(double** table)``; the table has the addresses of the arguments'
    nonzeros, then those of the results'.

    Args:
        function: A function of scalar expressions.
    """
    lines = []
    for i in range(function.n_in() + function.n_out()):
        lines.append(f"%t{i} = getelementptr ptr, ptr %table, i64 {i}")
        lines.append(f"%a{i} = load ptr, ptr %t{i}")
    # name or literal of the value that each place of the interpreter's memory has at present
    values: dict[int, str] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        operands, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            values[target[0]] = _literal(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            lines.append(f"%p{k} = getelementptr double, ptr %a{operands[0]}, i64 {operands[1]}")
            lines.append(f"%v{k} = load double, ptr %p{k}")
            values[target[0]] = f"%v{k}"
        elif operation == ca.OP_OUTPUT:
            array = function.n_in() + target[0]
            lines.append(f"%p{k} = getelementptr double, ptr %a{array}, i64 {target[1]}")
            lines.append(f"store double {values[operands[0]]}, ptr %p{k}")
        else:
            template = _template(operation)
            if template is None:
                return None
            x, y = values[operands[0]], values[operands[-1]]
            lines.append(template.format(v=f"%v{k}", x=x, y=y))
            values[target[0]] = f"%v{k}"
    return _MODULE.format(body="\n".join(lines))


@functools.cache
def _template(operation: int) -> str | None:
    """Return the assembly of an operation."""
    if operation in _INLINE:
        return "\n".join(_INLINE[operation])
    if operation in _UNARY_CALLS:
        address, operands = _address(_UNARY_CALLS[operation]), "double {x}"
    elif operation in _BINARY_CALLS:
        address, operands = _address(_BINARY_CALLS[operation]), "double {x}, double {y}"
    else:
        return None
    if address is None:
        return None
    # LLVM cannot know what is behind an address, and so cannot put something else there
    return f"{{v}} = call double inttoptr (i64 {address} to ptr)({operands})"


def _address(name: str) -> int | None:
    """Return where a mathematical function is that CasADi uses, too."""
    try:
        library = ctypes.CDLL(ca._casadi.__file__)
        return ctypes.cast(getattr(library, name), ctypes.c_void_p).value
    except (AttributeError, OSError):
        return None


def _literal(value: float) -> str:
    """Return a constant with all its bits; LLVM wants decimals to be exact."""
    if math.isnan(value):
        return "0x7FF8000000000000"
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


@functools.cache
def _llvm() -> Any:
    """Return llvmlite, ready for this machine."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm
