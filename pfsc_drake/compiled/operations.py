"""Operations on one or two numbers in LLVM assembly, with the interpreter's results."""

import contextlib
import ctypes
import functools
import math
import struct

import casadi as ca

__all__ = [
    "COMPARISONS",
    "LOGIC",
    "Untranslatable",
    "declarations",
    "function_name",
    "function_symbols",
    "is_known",
    "literal",
    "operation",
    "operation_name",
]

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
    # a number rather than NaN; of 0 and -0, which the standard leaves open, CasADi takes the first
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
# NaN is not less, not equal, and true
COMPARISONS = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}
LOGIC = {ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO}
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
_INTRINSIC = [
    "llvm.sqrt.f64(double)",
    "llvm.fabs.f64(double)",
    "llvm.copysign.f64(double, double)",
]
# under names that LLVM does not know: it would replace some calls otherwise
_PREFIX = "pfsc_"


class Untranslatable(Exception):
    """Error for an operation without assembly; the message names it."""


@functools.cache
def operation(code: int) -> str:
    """Return an operation's assembly, with fields {v} for its result, {x} and {y} for its operands.

    Args:
        code: The operation as CasADi counts them; no comparison or logic.

    Raises:
        Untranslatable: If the operation is not known.
    """
    if code in _INLINE:
        return "\n".join(_INLINE[code])
    name, count = function_name(code)
    if _PREFIX + name not in function_symbols():
        raise Untranslatable(f"operation {operation_name(code)}")
    operands = "double {x}" if count == 1 else "double {x}, double {y}"
    return f"{{v}} = call double @{_PREFIX}{name}({operands})"


def function_name(code: int) -> tuple[str, int]:
    """Return the mathematical function of an operation, and its number of operands.

    Args:
        code: The operation as CasADi counts them.

    Raises:
        Untranslatable: If it is not such a function.
    """
    name = _UNARY_CALLS.get(code) or _BINARY_CALLS.get(code)
    if name is None:
        raise Untranslatable(f"operation {operation_name(code)}")
    return name, 1 if code in _UNARY_CALLS else 2


def is_known(code: int) -> bool:
    """Return whether an operation on numbers has assembly."""
    return any(
        code in known for known in (_INLINE, COMPARISONS, LOGIC, _UNARY_CALLS, _BINARY_CALLS)
    )


def declarations(text: str) -> str:
    """Return the declarations of the functions that operations call, as far as they are needed.

    Args:
        text: The assembly.
    """
    unary = [f"{_PREFIX}{name}(double)" for name in _UNARY_CALLS.values()]
    binary = sorted({f"{_PREFIX}{name}(double, double)" for name in _BINARY_CALLS.values()})
    return "\n".join(
        f"declare double @{function} nounwind"
        for function in [*_INTRINSIC, *unary, *binary]
        if f"@{function.partition('(')[0]}(" in text
    )


@functools.cache
def function_symbols() -> dict[str, int]:
    """Return the addresses of the mathematical functions that CasADi uses, by their names here."""
    library = ctypes.CDLL(ca._casadi.__file__)
    found = {}
    for name in {*_UNARY_CALLS.values(), *_BINARY_CALLS.values()}:
        with contextlib.suppress(AttributeError):
            address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
            if address is not None:
                found[_PREFIX + name] = address
    return found


def operation_name(code: int) -> str:
    """Return CasADi's name of an operation."""
    names = [name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == code]
    return names[0] if names else str(code)


def literal(value: float) -> str:
    """Return a constant with all its bits; LLVM requires decimals to be exact."""
    if math.isnan(value):
        return "0x7FF8000000000000"
    return f"0x{struct.pack('>d', value).hex()}"
