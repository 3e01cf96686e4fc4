"""Straight code of one function in LLVM assembly: values by name, memory only where it must be."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from pfsc_drake.compiled.operations import COMPARISONS, LOGIC, literal, operation

__all__ = ["Code", "Constants", "Value", "Values", "elements", "literals"]

Value = str | tuple[str, int]
"""A number: its name, its literal, or pointer and element where it still is in memory.

Memory that is named so does not change any more. Names that begin with ``%c`` are of conditions,
which stand for 1.0 and 0.0.
"""

Values = list[Value]

# A block's constants are kept for it as a whole: long ones are translated twice as slowly, into
# code that takes half as long again.
_BLOCK = 200
_CONNECTIVES = {ca.OP_AND: "and", ca.OP_OR: "or"}


class Table(list[Value]):
    """Literals, perhaps very many."""


class Constants:
    """Tables of numbers that functions share, each content once."""

    def __init__(self) -> None:
        self._names: dict[tuple[Value, ...], str] = {}
        # to look at 100,000 numbers again takes long
        self._seen: dict[int, tuple[Table, str]] = {}

    def pointer(self, values: Sequence[Value]) -> str:
        """Return the pointer to a table.

        Args:
            values: Literals.
        """
        if id(values) in self._seen:
            return self._seen[id(values)][1]
        key = tuple(values)
        if key not in self._names:
            self._names[key] = f"@table{len(self._names)}"
        if isinstance(values, Table):
            self._seen[id(values)] = values, self._names[key]
        return self._names[key]

    def text(self) -> str:
        """Return the assembly that defines the tables."""
        return "\n".join(
            f"{name} = internal constant [{len(values)} x double] "
            f"[{', '.join(f'double {value}' for value in values)}], align 8"
            for values, name in self._names.items()
        )


class Code:
    """Instructions of one function, one after another.

    Args:
        constants: Where constant tables go.
    """

    def __init__(self, constants: Constants) -> None:
        self._constants = constants
        self._buffers: list[str] = []
        self._lines: list[str] = []
        self._loaded: dict[Value, str] = {}
        self._names = 0
        self._block_end = _BLOCK

    def __len__(self) -> int:
        return len(self._lines)

    def text(self, name: str, parameters: Sequence[str]) -> str:
        """Return the function.

        Args:
            name: Its name.
            parameters: Names of its parameters, all of them pointers.
        """
        return "\n".join(
            [
                f"define internal void {name}({', '.join(f'ptr {p}' for p in parameters)}) "
                "nounwind noinline {",
                *self._buffers,
                *self._lines,
                "ret void",
                "}",
            ]
        )

    def new(self, instruction: str) -> str:
        """Add an instruction that has a result, and return the result's name."""
        self._names += 1
        self._lines.append(f"%v{self._names} = {instruction}")
        return f"%v{self._names}"

    def add(self, instruction: str) -> None:
        """Add an instruction without result."""
        self._lines.append(instruction)

    def apply(self, code: int, x: Value, y: Value | None = None) -> str:
        """Add an operation on numbers, and return its result.

        Args:
            code: The operation as CasADi counts them.
            x: The first operand.
            y: The second; nothing for operations of one.
        """
        self._begin_block()
        if y is None:
            y = x
        if code in LOGIC:
            return self._logic(code, x, y)
        x, y = self.load(x), self.load(y)
        if code in COMPARISONS:
            return self._condition(f"fcmp {COMPARISONS[code]} double {x}, {y}")
        self._names += 1
        self._lines.append(operation(code).format(v=f"%v{self._names}", x=x, y=y))
        return f"%v{self._names}"

    def _logic(self, code: int, x: Value, y: Value) -> str:
        is_true = self._truth(x)
        if code == ca.OP_IF_ELSE_ZERO:
            mask = self.new(f"sext i1 {is_true} to i64")
            bits = self.new(f"bitcast double {self.load(y)} to i64")
            return self.new(f"bitcast i64 {self.new(f'and i64 {mask}, {bits}')} to double")
        if code == ca.OP_NOT:
            return self._condition(f"xor i1 {is_true}, true")
        return self._condition(f"{_CONNECTIVES[code]} i1 {is_true}, {self._truth(y)}")

    def _truth(self, value: Value) -> str:
        if isinstance(value, str) and value.startswith("%c"):
            return value
        return self._condition(f"fcmp une double {self.load(value)}, 0.0")

    def _condition(self, instruction: str) -> str:
        self._names += 1
        self._lines.append(f"%c{self._names} = {instruction}")
        return f"%c{self._names}"

    def _begin_block(self) -> None:
        if len(self._lines) > self._block_end:
            self._block_end = len(self._lines) + _BLOCK
            self._lines += [f"br label %b{self._names}", f"b{self._names}:"]

    def load(self, value: Value) -> str:
        """Return a number's name or literal, after loading it where it is in memory."""
        if isinstance(value, str) and not value.startswith("%c"):
            return value
        if value not in self._loaded:
            if isinstance(value, str):
                self._loaded[value] = self.new(f"uitofp i1 {value} to double")
            else:
                self._loaded[value] = self.new(f"load double, ptr {self.element(*value)}")
        return self._loaded[value]

    def store(self, value: Value, pointer: str, index: int) -> None:
        """Write a number into memory."""
        self._begin_block()
        value = self.load(value)
        self._lines.append(f"store double {value}, ptr {self.element(pointer, index)}")

    def element(self, pointer: str, index: int) -> str:
        """Return the pointer to an element."""
        return self.new(f"getelementptr double, ptr {pointer}, i64 {index}") if index else pointer

    def buffer(self, size: int) -> str:
        """Return the pointer to memory that exists as long as the function runs."""
        self._names += 1
        self._buffers.append(f"%v{self._names} = alloca [{max(size, 1)} x double], align 8")
        return f"%v{self._names}"

    def pointer(self, values: Sequence[Value]) -> str:
        """Return a pointer to numbers one behind the other; they are not to be overwritten."""
        if not values:
            return "null"
        if isinstance(values, Table) or all(_is_literal(value) for value in values):
            return self._constants.pointer(values)
        start = values[0]
        if isinstance(start, tuple):
            pointer, first = start
            if all(value == (pointer, first + i) for i, value in enumerate(values)):
                return self.element(pointer, first)
        return self.copy(values)

    def copy(self, values: Sequence[Value]) -> str:
        """Return a pointer to a copy of numbers, which may be overwritten."""
        buffer = self.buffer(len(values))
        for i, value in enumerate(values):
            self.store(value, buffer, i)
        return buffer

    def call(self, name: str, pointers: Sequence[str]) -> None:
        """Add the call of a function."""
        self._lines.append(f"call void {name}({', '.join(f'ptr {p}' for p in pointers)})")


def literals(values: np.ndarray) -> Table:
    """Return constants, shape (n,)."""
    return Table(map(literal, values.tolist()))


def elements(pointer: str, size: int, first: int = 0) -> Values:
    """Return numbers that are in memory one behind the other."""
    return [(pointer, first + i) for i in range(size)]


def _is_literal(value: Value) -> bool:
    return isinstance(value, str) and value.startswith("0x")
