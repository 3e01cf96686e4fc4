"""Functions in LLVM assembly."""

import re
from collections.abc import Sequence

import numpy as np

from pfsc_drake.compiled.code import Code, Tables
from pfsc_drake.compiled.operations import COMPARISONS, declarations, operation

__all__ = ["Assembly"]

# A block's constants are handled together: long blocks are translated twice as slowly, into
# code that takes half as long again.
_BLOCK = 200

_BYTES = np.array([f"\\{byte:02X}" for byte in range(256)], dtype="S3")

_HELPERS = """\
define internal i64 @index(double %x) nounwind alwaysinline {
; NaN and numbers out of range become the smallest integer, as in the processor's conversion
%a = fcmp oge double %x, 0xC3E0000000000000
%b = fcmp olt double %x, 0x43E0000000000000
%c = and i1 %a, %b
%i = fptosi double %x to i64
%r = select i1 %c, i64 %i, i64 -9223372036854775808
ret i64 %r
}
define internal double @element(ptr %x, i64 %n, i64 %i) nounwind alwaysinline {
%inside = icmp ult i64 %i, %n
%j = select i1 %inside, i64 %i, i64 0
%p = getelementptr double, ptr %x, i64 %j
%e = load double, ptr %p
%r = select i1 %inside, double %e, double 0x7FF8000000000000
ret double %r
}
define internal void @put(ptr %x, i64 %n, i64 %i, double %value) nounwind {
%inside = icmp ult i64 %i, %n
br i1 %inside, label %yes, label %no
yes:
%p = getelementptr double, ptr %x, i64 %i
store double %value, ptr %p
br label %no
no:
ret void
}
define internal double @low_linear(double %x, ptr %grid, i64 %n) nounwind {
start:
%last = sub i64 %n, 2
br label %next
next:
%i = phi i64 [0, %start], [%following, %compare]
%more = icmp slt i64 %i, %last
br i1 %more, label %compare, label %found
compare:
%following = add i64 %i, 1
%p = getelementptr double, ptr %grid, i64 %following
%g = load double, ptr %p
%below = fcmp olt double %x, %g
br i1 %below, label %found, label %next
found:
%r = sitofp i64 %i to double
ret double %r
}
define internal double @low_binary(double %x, ptr %grid, i64 %n) nounwind {
start:
%short = icmp slt i64 %n, 2
br i1 %short, label %first, label %below
below:
%p1 = getelementptr double, ptr %grid, i64 1
%g1 = load double, ptr %p1
%in_first = fcmp olt double %x, %g1
br i1 %in_first, label %first, label %above
first:
ret double 0.0
above:
%end = sub i64 %n, 1
%last = sub i64 %n, 2
%pe = getelementptr double, ptr %grid, i64 %end
%ge = load double, ptr %pe
%beyond = fcmp ogt double %x, %ge
br i1 %beyond, label %found, label %halve
halve:
%low = phi i64 [0, %above], [%low, %left], [%middle, %right]
%high = phi i64 [%end, %above], [%middle, %left], [%high, %right]
%sum = add i64 %low, %high
%middle = sdiv i64 %sum, 2
%p = getelementptr double, ptr %grid, i64 %middle
%g = load double, ptr %p
%is_left = fcmp olt double %x, %g
br i1 %is_left, label %left, label %right
left:
%done_left = icmp eq i64 %middle, %high
br i1 %done_left, label %found, label %halve
right:
%done_right = icmp eq i64 %middle, %low
br i1 %done_right, label %found, label %halve
found:
%i = phi i64 [%last, %above], [%middle, %left], [%middle, %right]
%r = sitofp i64 %i to double
ret double %r
}
define internal double @low_exact(double %x, ptr %grid, i64 %n) nounwind {
%end = sub i64 %n, 1
%last = sub i64 %n, 2
%pe = getelementptr double, ptr %grid, i64 %end
%g0 = load double, ptr %grid
%ge = load double, ptr %pe
%width = fsub double %ge, %g0
%from = fsub double %x, %g0
%intervals = sitofp i64 %end to double
%scaled = fmul double %from, %intervals
%place = fdiv double %scaled, %width
%i = call i64 @index(double %place)
%low = icmp slt i64 %i, 0
%i0 = select i1 %low, i64 0, i64 %i
%high = icmp sgt i64 %i0, %last
%i1 = select i1 %high, i64 %last, i64 %i0
%r = sitofp i64 %i1 to double
ret double %r
}
"""


class Assembly(Code):
    """Instructions of one function in LLVM assembly.

    Args:
        tables: Store of the constant tables.
    """

    nowhere = "null"

    def __init__(self, tables: Tables) -> None:
        super().__init__(tables)
        self._buffers: list[str] = []
        self._block_end = _BLOCK

    @staticmethod
    def module(texts: Sequence[str], tables: Tables, name: str, n_parameters: int) -> str:
        """Return the assembly of functions, with an entry that takes a table of pointers.

        Args:
            texts: The functions.
            tables: Their tables.
            name: The function that the entry calls.
            n_parameters: Number of its parameters.
        """
        entry = []
        for i in range(n_parameters):
            entry += [
                f"%t{i} = getelementptr ptr, ptr %table, i64 {i}",
                f"%p{i} = load ptr, ptr %t{i}",
            ]
        parameters = ", ".join(f"ptr %p{i}" for i in range(n_parameters))
        entry.append(f"call void @{name}({parameters})")
        text = "\n".join(
            [*texts, "define void @evaluate(ptr %table) nounwind {", *entry, "ret void", "}"]
        )
        constants = [
            f"@{table} = internal constant [{len(content)} x i8] "
            f'c"{_written_out(content)}", align 8'
            for content, table in tables.names.items()
        ]
        return "\n".join([declarations(text), *constants, _helpers(text), text])

    def text(self, name: str, parameters: Sequence[str]) -> str:
        """Return the text of the function."""
        return _function(name, parameters, [*self._buffers, *self._lines])

    @staticmethod
    def loop(
        name: str, parameters: Sequence[str], sizes: Sequence[int], called: str, repetitions: int
    ) -> str:
        """Return a function that calls another for one part of its arrays after the other."""
        lines = ["br label %next", "next:", "%i = phi i64 [0, %0], [%following, %next]"]
        for k, (parameter, size) in enumerate(zip(parameters, sizes, strict=True)):
            lines.append(f"%o{k} = mul i64 %i, {size}")
            lines.append(f"%p{k} = getelementptr double, ptr %{parameter}, i64 %o{k}")
        passed = ", ".join(f"ptr %p{k}" for k in range(len(parameters)))
        lines += [
            f"call void @{called}({passed})",
            "%following = add i64 %i, 1",
            f"%done = icmp sge i64 %following, {repetitions}",
            "br i1 %done, label %end, label %next",
            "end:",
        ]
        return _function(name, parameters, lines)

    @staticmethod
    def switch(name: str, parameters: Sequence[str], cases: Sequence[str]) -> str:
        """Return a function that calls one of several others, by its first argument."""
        index, *others = parameters
        passed, last = ", ".join(f"ptr %{p}" for p in others), len(cases) - 1
        choices = " ".join(f"i64 {i}, label %case{i}" for i in range(last))
        lines = [
            f"%x = load double, ptr %{index}",
            "%chosen = call i64 @index(double %x)",
            f"switch i64 %chosen, label %case{last} [{choices}]",
        ]
        for i, case in enumerate(cases):
            lines += [f"case{i}:", f"call void @{case}({passed})", "br label %end"]
        return _function(name, parameters, [*lines, "end:"])

    def buffer(self, size: int) -> str:
        """Return the pointer to memory that exists as long as the function runs."""
        self._names += 1
        self._buffers.append(f"%b{self._names} = alloca [{max(size, 1)} x double], align 8")
        return f"b{self._names}"

    def element(self, pointer: str, index: int) -> str:
        """Return the pointer to an element."""
        if not index:
            return pointer
        self._names += 1
        self._emit(f"%p{self._names} = {_element_pointer(pointer, index)}")
        return f"p{self._names}"

    def _emit(self, line: str) -> None:
        if len(self._lines) > self._block_end:
            self._block_end = len(self._lines) + _BLOCK
            self._lines += [f"br label %next{self._block_end}", f"next{self._block_end}:"]
        super()._emit(line)

    def _operation(self, name: str, code: int, x: str, y: str) -> str:
        return operation(code).format(v=f"%{name}", x=_operand(x), y=_operand(y))

    def _comparison(self, name: str, code: int, x: str, y: str) -> str:
        return f"%{name} = fcmp {COMPARISONS[code]} double {_operand(x)}, {_operand(y)}"

    def _negation(self, name: str, condition: str) -> str:
        return f"%{name} = xor i1 %{condition}, true"

    def _conjunction(self, name: str, first: str, second: str) -> str:
        return f"%{name} = and i1 %{first}, %{second}"

    def _disjunction(self, name: str, first: str, second: str) -> str:
        return f"%{name} = or i1 %{first}, %{second}"

    def _select(self, name: str, condition: str, x: str) -> str:
        # without a branch
        return (
            f"%{name}m = sext i1 %{condition} to i64\n"
            f"%{name}x = bitcast double {_operand(x)} to i64\n"
            f"%{name}b = and i64 %{name}m, %{name}x\n"
            f"%{name} = bitcast i64 %{name}b to double"
        )

    def _number(self, name: str, condition: str) -> str:
        return f"%{name} = uitofp i1 %{condition} to double"

    def _read(self, name: str, pointer: str, index: int) -> str:
        if not index:
            return f"%{name} = load double, ptr {_operand(pointer)}"
        return f"%{name}p = {_element_pointer(pointer, index)}\n%{name} = load double, ptr %{name}p"

    def _store(self, x: str, pointer: str, index: int) -> str:
        return f"store double {_operand(x)}, ptr {_operand(self.element(pointer, index))}"

    def _index(self, name: str, x: str) -> str:
        return f"%{name} = call i64 @index(double {_operand(x)})"

    def _sum(self, name: str, i: str, j: int | str) -> str:
        return f"%{name} = add i64 %{i}, {j if isinstance(j, int) else '%' + j}"

    def _element_or_nan(self, name: str, pointer: str, size: int, index: str) -> str:
        element = f"ptr {_operand(pointer)}, i64 {size}, i64 %{index}"
        return f"%{name} = call double @element({element})"

    def _checked_store(self, pointer: str, size: int, index: str, x: str) -> str:
        element = f"ptr {_operand(pointer)}, i64 {size}, i64 %{index}"
        return f"call void @put({element}, double {_operand(x)})"

    def _look_up(self, name: str, mode: str, grid: str, size: int, x: str) -> str:
        table = f"ptr {_operand(grid)}, i64 {size}"
        return f"%{name} = call double @low_{mode}(double {_operand(x)}, {table})"

    def _function_call(self, name: str, pointers: Sequence[str]) -> str:
        return f"call void @{name}({', '.join(f'ptr {_operand(p)}' for p in pointers)})"


def _written_out(content: bytes) -> str:
    # single numbers take LLVM ten times as long
    return _BYTES[np.frombuffer(content, np.uint8)].tobytes().decode()


def _function(name: str, parameters: Sequence[str], lines: Sequence[str]) -> str:
    head = f"define internal void @{name}({', '.join(f'ptr %{p}' for p in parameters)})"
    return "\n".join([f"{head} nounwind noinline {{", *lines, "ret void", "}"])


def _operand(name: str) -> str:
    """Return a name or literal in assembly."""
    if name.startswith("0x") or name == Assembly.nowhere:
        return name
    return f"@{name}" if name.startswith("table") else f"%{name}"


def _element_pointer(pointer: str, index: int) -> str:
    return f"getelementptr double, ptr {_operand(pointer)}, i64 {index}"


def _helpers(text: str) -> str:
    """Return the helper functions that a text needs."""
    functions = re.findall(r"define internal \w+ (@\w+)\(.*?\n}\n", _HELPERS, re.DOTALL)
    texts = re.findall(r"define internal .*?\n}\n", _HELPERS, re.DOTALL)
    needed = [body for name, body in zip(functions, texts, strict=True) if f"{name}(" in text]
    # one of them calls the first
    return "".join(dict.fromkeys([texts[0], *needed]) if needed else [])
