"""Straight-line code of one function in any language: named numbers, memory where needed."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import ClassVar, overload

import casadi as ca
import numpy as np

from pfsc_drake.compiled.operations import COMPARISONS, LOGIC, Untranslatable, literal

__all__ = ["Code", "LiteralTable", "Tables", "Value", "Values", "elements"]

Value = str | tuple[str, int]
"""A number: its name, its literal, or pointer and element if it is still in memory.

Memory with a name does not change any more. Names of numbers begin with v, of conditions (1.0 or
0.0) with c, of integers with i.
"""

Values = Sequence[Value]
_ZERO = literal(0.0)


class LiteralTable(Sequence[Value]):
    """Literals, perhaps very many: their text is created on access.

    Args:
        numbers: Their values, shape (n,).

    Attributes:
        content: The values as bytes; there is one kind of NaN.
    """

    def __init__(self, numbers: np.ndarray) -> None:
        numbers = np.asarray(numbers, dtype=float)
        self._numbers = np.where(np.isnan(numbers), np.nan, numbers)
        self.content = self._numbers.tobytes()

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, index: int) -> Value: ...

    @overload
    def __getitem__(self, index: slice) -> Values: ...

    def __getitem__(self, index: int | slice) -> Value | Values:
        if isinstance(index, slice):
            return LiteralTable(self._numbers[index])
        return literal(self._numbers[index])

    def __iter__(self) -> Iterator[Value]:
        return map(literal, self._numbers.tolist())


class Tables:
    """Constants that functions share, each content once.

    Args:
        prefix: Prefix of their names.

    Attributes:
        names: Their pointers by content, the values as bytes.
    """

    def __init__(self, prefix: str = "table") -> None:
        self._prefix = prefix
        self.names: dict[bytes, str] = {}

    def pointer(self, values: Sequence[Value]) -> str:
        """Return the pointer to a table.

        Args:
            values: Literals.
        """
        if not isinstance(values, LiteralTable):
            bits = np.array([int(str(value), 16) for value in values], dtype=np.uint64)
            values = LiteralTable(bits.view(np.float64))
        return self.names.setdefault(values.content, f"{self._prefix}{len(self.names)}")


class Code(ABC):
    """Instructions of one function, one after another.

    Args:
        tables: Store of the constant tables.

    Attributes:
        nowhere: The null pointer, for arrays without elements.
        most_instructions: Largest number of instructions of one function; machine code without
            optimizations keeps every value on the stack.
    """

    nowhere: ClassVar[str]
    most_instructions: ClassVar[int] = 50_000

    def __init__(self, tables: Tables) -> None:
        self._tables = tables
        self._lines: list[str] = []
        self._loaded: dict[Value, str] = {}
        self._names = 0

    def apply(self, code: int, x: Value, y: Value | None = None) -> str:
        """Add an operation on numbers, and return its result.

        Args:
            code: The operation as CasADi counts them.
            x: The first operand.
            y: The second; None for operations of one operand.

        Raises:
            Untranslatable: If the operation is not known, or there are too many instructions.
        """
        if y is None:
            y = x
        if code in LOGIC:
            return self._logic(code, x, y)
        x, y = self.load(x), self.load(y)
        if code in COMPARISONS:
            return self._add("c", self._comparison, code, x, y)
        return self._add("v", self._operation, code, x, y)

    def _logic(self, code: int, x: Value, y: Value) -> str:
        is_true = self._truth(x)
        if code == ca.OP_IF_ELSE_ZERO:
            return self._add("v", self._select, is_true, self.load(y))
        if code == ca.OP_NOT:
            return self._add("c", self._negation, is_true)
        both = self._conjunction if code == ca.OP_AND else self._disjunction
        return self._add("c", both, is_true, self._truth(y))

    def _truth(self, value: Value) -> str:
        if isinstance(value, str) and value[0] == "c":
            return value
        # NaN is true
        return self._add("c", self._comparison, ca.OP_NE, self.load(value), _ZERO)

    def load(self, value: Value) -> str:
        """Return a number's name or literal, after loading it if it is in memory."""
        if isinstance(value, str) and value[0] != "c":
            return value
        if value not in self._loaded:
            if isinstance(value, str):
                self._loaded[value] = self._add("v", self._number, value)
            else:
                self._loaded[value] = self._add("v", self._read, *value)
        return self._loaded[value]

    def store(self, value: Value, pointer: str, index: int) -> None:
        """Write a number into memory."""
        self._emit(self._store(self.load(value), pointer, index))

    def pointer(self, values: Sequence[Value]) -> str:
        """Return a pointer to numbers one behind the other; they must not be overwritten."""
        if not values:
            return self.nowhere
        if isinstance(values, LiteralTable) or all(_is_literal(value) for value in values):
            return self._tables.pointer(values)
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

    def index(self, value: Value) -> str:
        """Return an integer, rounded towards zero; far below zero for NaN and out of range."""
        return self._add("i", self._index, self.load(value))

    def plus(self, i: str, j: int | str) -> str:
        """Return the sum of two integers."""
        return self._add("i", self._sum, i, j)

    def get(self, pointer: str, size: int, index: str) -> str:
        """Return an element at a computed index, NaN where there is none."""
        return self._add("v", self._element_or_nan, pointer, size, index)

    def put(self, pointer: str, size: int, index: str, value: Value) -> None:
        """Write an element at a computed index, if the element exists."""
        self._emit(self._checked_store(pointer, size, index, self.load(value)))

    def low(self, mode: str, grid: str, size: int, value: Value) -> str:
        """Return the index of a number in a grid: ``linear``, ``binary`` or ``exact`` search."""
        return self._add("v", self._look_up, mode, grid, size, self.load(value))

    def call(self, name: str, pointers: Sequence[str]) -> None:
        """Add the call of a function."""
        self._emit(self._function_call(name, pointers))

    def _add(self, kind: str, instruction: Callable[..., str], *operands: object) -> str:
        self._names += 1
        name = f"{kind}{self._names}"
        self._emit(instruction(name, *operands))
        return name

    def _emit(self, line: str) -> None:
        if len(self._lines) >= self.most_instructions:
            raise Untranslatable(f"a function of more than {self.most_instructions} instructions")
        self._lines.append(line)

    @abstractmethod
    def text(self, name: str, parameters: Sequence[str]) -> str:
        """Return the function.

        Args:
            name: Its name.
            parameters: Names of its parameters, all of them pointers.
        """

    @staticmethod
    @abstractmethod
    def loop(
        name: str, parameters: Sequence[str], sizes: Sequence[int], called: str, repetitions: int
    ) -> str:
        """Return a function that calls another for one part of its arrays after the other.

        Args:
            name: Its name.
            parameters: Parameters of both.
            sizes: Number of elements in a part, of each parameter.
            called: The other function.
            repetitions: Number of parts.
        """

    @staticmethod
    @abstractmethod
    def switch(name: str, parameters: Sequence[str], cases: Sequence[str]) -> str:
        """Return a function that calls one of several others, by its first argument.

        Args:
            name: Its name.
            parameters: The index, then the parameters of the others.
            cases: The others; the last one also if the index is out of range.
        """

    @abstractmethod
    def buffer(self, size: int) -> str:
        """Return the pointer to memory that exists as long as the function runs."""

    @abstractmethod
    def element(self, pointer: str, index: int) -> str:
        """Return the pointer to an element."""

    # the instructions in the language; the first argument is the name of the result

    @abstractmethod
    def _operation(self, name: str, code: int, x: str, y: str) -> str: ...

    @abstractmethod
    def _comparison(self, name: str, code: int, x: str, y: str) -> str: ...

    @abstractmethod
    def _negation(self, name: str, condition: str) -> str: ...

    @abstractmethod
    def _conjunction(self, name: str, first: str, second: str) -> str: ...

    @abstractmethod
    def _disjunction(self, name: str, first: str, second: str) -> str: ...

    @abstractmethod
    def _select(self, name: str, condition: str, x: str) -> str: ...

    @abstractmethod
    def _number(self, name: str, condition: str) -> str: ...

    @abstractmethod
    def _read(self, name: str, pointer: str, index: int) -> str: ...

    @abstractmethod
    def _store(self, x: str, pointer: str, index: int) -> str: ...

    @abstractmethod
    def _index(self, name: str, x: str) -> str: ...

    @abstractmethod
    def _sum(self, name: str, i: str, j: int | str) -> str: ...

    @abstractmethod
    def _element_or_nan(self, name: str, pointer: str, size: int, index: str) -> str: ...

    @abstractmethod
    def _checked_store(self, pointer: str, size: int, index: str, x: str) -> str: ...

    @abstractmethod
    def _look_up(self, name: str, mode: str, grid: str, size: int, x: str) -> str: ...

    @abstractmethod
    def _function_call(self, name: str, pointers: Sequence[str]) -> str: ...


def elements(pointer: str, size: int, first: int = 0) -> Values:
    """Return numbers that are in memory one behind the other."""
    return [(pointer, first + i) for i in range(size)]


def _is_literal(value: Value) -> bool:
    return isinstance(value, str) and value.startswith("0x")
