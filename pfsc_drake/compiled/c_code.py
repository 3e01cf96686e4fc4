"""Functions in C99: numbers, arrays on the stack, and the mathematical library."""

import functools
import math
import re
import struct
from collections.abc import Sequence

import casadi as ca

from pfsc_drake.compiled.code import Code, Tables
from pfsc_drake.compiled.operations import function_name

__all__ = ["CCode", "helpers", "table_head", "table_text"]

_EXPRESSIONS = {
    ca.OP_ADD: "{x} + {y}",
    ca.OP_SUB: "{x} - {y}",
    ca.OP_MUL: "{x} * {y}",
    ca.OP_DIV: "{x} / {y}",
    ca.OP_NEG: "-{x}",
    ca.OP_SQ: "{x} * {x}",
    ca.OP_TWICE: "2.0 * {x}",
    ca.OP_INV: "1.0 / {x}",
    ca.OP_SQRT: "sqrt({x})",
    ca.OP_FABS: "fabs({x})",
    ca.OP_COPYSIGN: "copysign({x}, {y})",
    # a number rather than NaN; of 0 and -0, which the standard leaves open, CasADi takes the first
    ca.OP_FMIN: "smaller({x}, {y})",
    ca.OP_FMAX: "larger({x}, {y})",
    ca.OP_SIGN: "sign({x})",
}
_RELATIONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}

# each helper may call those before it
_HELPERS = """\
static double smaller(double x, double y)
{
    return y < x || x != x ? y : x;
}

static double larger(double x, double y)
{
    return y > x || x != x ? y : x;
}

static double sign(double x)
{
    return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x;
}

/* rounded towards zero; far below zero if NaN or out of the range of integers; sums of two do not
   overflow */
static long long rounded(double x)
{
    const long long most = 4611686018427387904LL;
    if (!(x >= -9223372036854775808.0 && x < 9223372036854775808.0)) {
        return -most;
    }
    return x > (double)most ? most : x < -(double)most ? -most : (long long)x;
}

static double element(const double *x, long long n, long long i)
{
    return i >= 0 && i < n ? x[i] : NAN;
}

static void put(double *x, long long n, long long i, double value)
{
    if (i >= 0 && i < n) {
        x[i] = value;
    }
}

static double low_linear(double x, const double *grid, long long n)
{
    long long i = 0;
    while (i < n - 2 && !(x < grid[i + 1])) {
        ++i;
    }
    return (double)i;
}

static double low_binary(double x, const double *grid, long long n)
{
    long long low = 0, high = n - 1;
    if (n < 2 || x < grid[1]) {
        return 0.0;
    }
    if (x > grid[n - 1]) {
        return (double)(n - 2);
    }
    for (;;) {
        const long long middle = (low + high) / 2;
        if (x < grid[middle]) {
            if (middle == high) {
                return (double)middle;
            }
            high = middle;
        } else {
            if (middle == low) {
                return (double)middle;
            }
            low = middle;
        }
    }
}

static double low_exact(double x, const double *grid, long long n)
{
    const double width = grid[n - 1] - grid[0];
    const long long i = rounded((x - grid[0]) * (double)(n - 1) / width);
    return (double)(i < 0 ? 0 : i > n - 2 ? n - 2 : i);
}
"""


class CCode(Code):
    """Instructions of one function in C.

    Args:
        tables: Store of the constant tables.
    """

    nowhere = "NULL"
    most_instructions = 1_000_000

    def __init__(self, tables: Tables) -> None:
        super().__init__(tables)
        self._buffers: dict[str, int] = {}

    def text(self, name: str, parameters: Sequence[str]) -> str:
        """Return the text of the function."""
        lines, live = _needed(self._lines)
        buffers = [f"double {b}[{size}];" for b, size in self._buffers.items() if b in live]
        return _function(name, parameters, [*buffers, *lines])

    @staticmethod
    def loop(
        name: str, parameters: Sequence[str], sizes: Sequence[int], called: str, repetitions: int
    ) -> str:
        """Return a function that calls another for one part of its arrays after the other."""
        passed = ", ".join(f"{p} + {size} * i" for p, size in zip(parameters, sizes, strict=True))
        return _function(
            name,
            parameters,
            [f"for (int i = 0; i < {repetitions}; ++i) {{", f"    {called}({passed});", "}"],
        )

    @staticmethod
    def switch(name: str, parameters: Sequence[str], cases: Sequence[str]) -> str:
        """Return a function that calls one of several others, by its first argument."""
        index, *others = parameters
        passed = ", ".join(others)
        lines = [f"switch (rounded(*{index})) {{"]
        for i, case in enumerate(cases):
            label = "default" if i == len(cases) - 1 else f"case {i}"
            lines += [f"{label}:", f"    {case}({passed});", "    break;"]
        return _function(name, parameters, [*lines, "}"])

    def buffer(self, size: int) -> str:
        """Return the pointer to memory that exists as long as the function runs."""
        self._names += 1
        self._buffers[f"b{self._names}"] = max(size, 1)
        return f"b{self._names}"

    def element(self, pointer: str, index: int) -> str:
        """Return the pointer to an element."""
        return f"{pointer} + {index}" if index else pointer

    def _operation(self, name: str, code: int, x: str, y: str) -> str:
        operands = {"x": _operand(x), "y": _operand(y)}
        if code in _EXPRESSIONS:
            return f"const double {name} = {_EXPRESSIONS[code].format(**operands)};"
        function, count = function_name(code)
        passed = ", ".join([*operands.values()][:count])
        return f"const double {name} = {function}({passed});"

    def _comparison(self, name: str, code: int, x: str, y: str) -> str:
        return f"const int {name} = {_operand(x)} {_RELATIONS[code]} {_operand(y)};"

    def _negation(self, name: str, condition: str) -> str:
        return f"const int {name} = !{condition};"

    def _conjunction(self, name: str, first: str, second: str) -> str:
        return f"const int {name} = {first} && {second};"

    def _disjunction(self, name: str, first: str, second: str) -> str:
        return f"const int {name} = {first} || {second};"

    def _select(self, name: str, condition: str, x: str) -> str:
        return f"const double {name} = {condition} ? {_operand(x)} : 0.0;"

    def _number(self, name: str, condition: str) -> str:
        return f"const double {name} = (double){condition};"

    def _read(self, name: str, pointer: str, index: int) -> str:
        return f"const double {name} = {pointer}[{index}];"

    def _store(self, x: str, pointer: str, index: int) -> str:
        return f"{pointer}[{index}] = {_operand(x)};"

    def _index(self, name: str, x: str) -> str:
        return f"const long long {name} = rounded({_operand(x)});"

    def _sum(self, name: str, i: str, j: int | str) -> str:
        return f"const long long {name} = {i} + {j};"

    def _element_or_nan(self, name: str, pointer: str, size: int, index: str) -> str:
        return f"const double {name} = element({pointer}, {size}, {index});"

    def _checked_store(self, pointer: str, size: int, index: str, x: str) -> str:
        return f"put({pointer}, {size}, {index}, {_operand(x)});"

    def _look_up(self, name: str, mode: str, grid: str, size: int, x: str) -> str:
        return f"const double {name} = low_{mode}({_operand(x)}, {grid}, {size});"

    def _function_call(self, name: str, pointers: Sequence[str]) -> str:
        return f"{name}({', '.join(pointers)});"


def helpers(text: str) -> str:
    """Return the helper functions that a text needs.

    Args:
        text: The functions that may call them.
    """
    needed: list[str] = []
    for body in reversed(re.findall(r"(?:/\*[^/]*\*/\n)?static .*?\n}\n", _HELPERS, re.DOTALL)):
        name = re.search(r"(\w+)\(", body[body.index("static ") :])
        assert name is not None
        if re.search(rf"\b{name[1]}\(", "\n".join([text, *needed])):
            needed.insert(0, body)
    return "\n".join(needed)


def table_text(name: str, values: Sequence[str]) -> str:
    """Return the definition of a table.

    Args:
        name: Its name.
        values: Its literals.
    """
    numbers = [f"{_number(value)}," for value in values]
    lines = [" ".join(numbers[i : i + 6]) for i in range(0, len(numbers), 6)]
    rows = "".join(f"    {line}\n" for line in lines)
    return f"{table_head(name, len(values))} = {{\n{rows}}};\n"


def table_head(name: str, size: int) -> str:
    """Return the declaration of a table.

    Args:
        name: Its name.
        size: Number of its values.
    """
    return f"const double {name}[{size}]"


def _function(name: str, parameters: Sequence[str], lines: Sequence[str]) -> str:
    body = "\n".join(f"    {line}" for line in lines)
    used = set(re.findall(r"\b[ar]\d+\b", body))
    unused = [f"    (void){p};" for p in parameters if p not in used]
    declared = [f"{'const ' if p.startswith('a') else ''}double *{p}" for p in parameters]
    head = f"static void {name}({', '.join(declared) or 'void'})"
    return "\n".join([head, "{", *unused, body, "}", ""])


def _needed(lines: Sequence[str]) -> tuple[list[str], set[str]]:
    """Return the lines whose results are used, and all names in them."""
    live: set[str] = set()
    live_lines = []
    for line in reversed(lines):
        # the target: a number, or a buffer
        target = re.match(r"const (?:double|int|long long) (\w+) = |put\((b\d+),|(b\d+)\[", line)
        if target is None or (target[1] or target[2] or target[3]) in live:
            live.update(re.findall(r"\b[vcib]\d+\b", line))
            live_lines.append(line)
    return live_lines[::-1], live


def _operand(value: str) -> str:
    """Return a name or literal in C."""
    if not value.startswith("0x"):
        return value
    number = _number(value)
    return f"({number})" if number.startswith("-") else number


@functools.lru_cache(maxsize=100_000)
def _number(literal: str) -> str:
    """Return a literal in C; Python's decimals are read back to the same bits."""
    (value,) = struct.unpack(">d", bytes.fromhex(literal[2:]))
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(value)
