"""CasADi functions in another language: each function, and each that it calls, once."""

import hashlib
import re
from collections.abc import Callable

import casadi as ca
import numpy as np

from pfsc_drake.compiled.code import Code, LiteralTable, Tables, Value, Values, elements
from pfsc_drake.compiled.llvm_assembly import Assembly
from pfsc_drake.compiled.matrix_instructions import look_up, project, translate_instruction
from pfsc_drake.compiled.operations import Untranslatable, literal

__all__ = ["Translation", "translate"]

_LOOK_UP_MODES = {"0": "linear", "1": "exact", "2": "binary"}


def translate(function: ca.Function) -> str:
    """Return a function in LLVM assembly.

    It defines ``void evaluate(double** table)``; the table has the addresses of the arguments'
    nonzeros, then those of the results'.

    Args:
        function: A function of scalar or matrix expressions.

    Raises:
        Untranslatable: If it contains an operation without assembly here.
    """
    translation = Translation(Assembly)
    name = translation.function(function)
    n_parameters = function.n_in() + function.n_out()
    return Assembly.module(translation.texts, translation.tables, name, n_parameters)


class Translation:
    """Functions in another language, each before those that call it.

    Args:
        language: Language of the code.
        tables: Tables of other functions, to be shared; new ones if omitted.

    Attributes:
        texts: The functions.
        tables: Their tables.
    """

    def __init__(self, language: type[Code], tables: Tables | None = None) -> None:
        self._language = language
        self.tables = Tables() if tables is None else tables
        self.texts: list[str] = []
        self._count = 0
        # by address, with the functions; to read a function's content takes long
        self._translated: dict[int, tuple[ca.Function, str]] = {}
        self._digests: dict[int, tuple[ca.Function, bytes]] = {}
        # by name and shape, which functions of the same content share
        self._alike: dict[str, list[tuple[ca.Function, str]]] = {}

    def function(self, function: ca.Function) -> str:
        """Translate a function unless it has been translated, and return its name.

        Its parameters are pointers to the nonzeros of each argument, then of each result.

        Args:
            function: A function of scalar or matrix expressions.

        Raises:
            Untranslatable: If it contains an operation without translation.
        """
        if function.__hash__() in self._translated:
            return self._translated[function.__hash__()][1]
        name = self._name_of_same(function)
        if name is None:
            kinds: dict[str, Callable[[ca.Function, str], str]] = {
                "SXFunction": self._scalars,
                "MXFunction": self._matrices,
                "Map": self._map,
                "Switch": self._switch,
            }
            kind = function.class_name()
            if kind not in kinds:
                raise Untranslatable(f"{function.name()}, a {kind}")
            name = f"f{self._count}"
            self._count += 1
            self._alike.setdefault(str(function), []).append((function, name))
            self.texts.append(kinds[kind](function, name))
        self._translated[function.__hash__()] = function, name
        return name

    def _name_of_same(self, function: ca.Function) -> str | None:
        """Return the name of a function of the same content that has been translated, if any."""
        alike = self._alike.get(str(function), [])
        return next(
            (name for other, name in alike if self._digest(other) == self._digest(function)), None
        )

    def _digest(self, function: ca.Function) -> bytes:
        key = function.__hash__()
        if key not in self._digests:
            content = hashlib.sha256(function.serialize().encode()).digest()
            self._digests[key] = function, content
        return self._digests[key][1]

    def _scalars(self, function: ca.Function, name: str) -> str:
        code = self._language(self.tables)
        arguments, results = _arguments(function), _results(function)
        # the present value in each slot of the interpreter's memory
        slots: dict[int, Value] = {}
        for k in range(function.n_instructions()):
            what = function.instruction_id(k)
            operands, target = function.instruction_input(k), function.instruction_output(k)
            if what == ca.OP_CONST:
                slots[target[0]] = literal(function.instruction_constant(k))
            elif what == ca.OP_INPUT:
                slots[target[0]] = code.load((arguments[operands[0]], operands[1]))
            elif what == ca.OP_OUTPUT:
                code.store(slots[operands[0]], results[target[0]], target[1])
            else:
                slots[target[0]] = code.apply(what, *[slots[i] for i in operands])
        return code.text(name, [*arguments, *results])

    def _matrices(self, function: ca.Function, name: str) -> str:
        code = self._language(self.tables)
        arguments, results = _arguments(function), _results(function)
        look_up_modes = iter(_look_up_modes(function))
        # the present numbers in each slot of the interpreter's memory
        slots: dict[int, Values] = {}
        stores: list[tuple[str, int, Values]] = []
        for k in range(function.n_instructions()):
            what, node = function.instruction_id(k), function.instruction_MX(k)
            values: list[Values]
            if what == ca.OP_INPUT:
                part = node.info()
                values = [elements(arguments[part["ind"]], node.nnz(), part["offset"])]
            else:
                operands = [
                    # missing operands are zero
                    slots[slot] if slot >= 0 else LiteralTable(np.zeros(node.dep(i).nnz()))
                    for i, slot in enumerate(function.instruction_input(k))
                ]
                if what == ca.OP_OUTPUT:
                    part = node.info()
                    stores.append((results[part["ind"]], part["offset"], operands[0]))
                    continue
                if what == ca.OP_CALL:
                    values = self._call(code, node.which_function(), operands)
                elif what == ca.OP_LOW:
                    values = [look_up(code, operands, next(look_up_modes))]
                else:
                    values = translate_instruction(code, what, node, operands)
            slots |= dict(zip(function.instruction_output(k), values, strict=True))
        # an argument may be overwritten, so that everything is read before anything is written
        for _, _, numbers in stores:
            for number in numbers:
                code.load(number)
        for pointer, first, numbers in stores:
            for i, number in enumerate(numbers):
                code.store(number, pointer, first + i)
        return code.text(name, [*arguments, *results])

    def _call(self, code: Code, function: ca.Function, operands: list[Values]) -> list[Values]:
        results = [code.buffer(function.nnz_out(i)) for i in range(function.n_out())]
        pointers = [code.pointer(values) for values in operands]
        code.call(self.function(function), [*pointers, *results])
        return [elements(result, function.nnz_out(i)) for i, result in enumerate(results)]

    def _map(self, function: ca.Function, name: str) -> str:
        """Translate a function that is evaluated for one set of columns after another."""
        once, repetitions = function.info()["f"], function.info()["n"]
        sizes = [once.nnz_in(i) for i in range(once.n_in())]
        sizes += [once.nnz_out(i) for i in range(once.n_out())]
        parameters = [*_arguments(once), *_results(once)]
        called = self.function(once)
        return self._language.loop(name, parameters, sizes, called, repetitions)

    def _switch(self, function: ca.Function, name: str) -> str:
        """Translate a function whose first argument selects one of several."""
        cases = [*function.info()["f"], function.info()["f_def"]]
        names = [self._case(function, case) for case in cases]
        parameters = [*_arguments(function), *_results(function)]
        return self._language.switch(name, parameters, names)

    def _case(self, function: ca.Function, case: ca.Function) -> str:
        """Return the name of a case of a switch, with the switch's patterns of nonzeros."""
        inner = self.function(case)
        switch_in = [function.sparsity_in(i + 1) for i in range(case.n_in())]
        switch_out = [function.sparsity_out(i) for i in range(case.n_out())]
        case_in = [case.sparsity_in(i) for i in range(case.n_in())]
        case_out = [case.sparsity_out(i) for i in range(case.n_out())]
        if switch_in == case_in and switch_out == case_out:
            return inner
        code = self._language(self.tables)
        operands = [
            project(elements(pointer, source.nnz()), source, target)
            for pointer, source, target in zip(_arguments(case), switch_in, case_in, strict=True)
        ]
        values = self._call(code, case, operands)
        for result, numbers, source, target in zip(
            _results(case), values, case_out, switch_out, strict=True
        ):
            for i, number in enumerate(project(numbers, source, target)):
                code.store(number, result, i)
        name = f"case{len(self.texts)}"
        self.texts.append(code.text(name, [*_arguments(case), *_results(case)]))
        return name


def _look_up_modes(function: ca.Function) -> list[str]:
    """Return the search mode of each table look-up in a matrix function, in their order.

    Only the C code contains it.
    """
    instructions = range(function.n_instructions())
    if all(function.instruction_id(k) != ca.OP_LOW for k in instructions):
        return []
    generator = ca.CodeGenerator("modes")
    generator.add(function)
    source = generator.dump()
    exported = re.search(r"\n}\n\nCASADI_SYMBOL_EXPORT int \w+\(const casadi_real\*\* arg", source)
    assert exported is not None
    body = source[source.rindex("\nstatic int casadi_f", 0, exported.start()) : exported.start()]
    return [_LOOK_UP_MODES[mode] for mode in re.findall(r"= casadi_low\(.*, (\d)\);", body)]


def _arguments(function: ca.Function) -> list[str]:
    return [f"a{i}" for i in range(function.n_in())]


def _results(function: ca.Function) -> list[str]:
    return [f"r{i}" for i in range(function.n_out())]
