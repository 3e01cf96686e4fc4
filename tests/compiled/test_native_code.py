"""Machine code of whole functions: stored, loaded, bound, and refused with a reason."""

import gc
import sys

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import native_code as module
from pfsc_drake.compiled.native_code import native_code, why_not
from tests.compiled.interpreter import assert_same_bits, both, compiled

X = ca.SX.sym("x", 2)
FUNCTION = ca.Function("f", [X], [ca.sin(X)])


@pytest.fixture(name="afresh")
def fixture_afresh(monkeypatch, tmp_path):
    """Forget what has been compiled, here and on disk; return the folder for the latter."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "_codes", {})
    return tmp_path / "pfsc_drake" / "machine_code"


def test_sparse_and_several_results():
    x = ca.SX.sym("x", ca.Sparsity.lower(3))
    function = ca.Function("f", [x, ca.SX.sym("unused", 2)], [x @ x, 3.5, ca.SX(0, 1), ca.sin(x)])
    assert_same_bits(*both(function, np.arange(6.0), [1.0, 2.0]))


def test_result_may_be_the_argument():
    x = ca.SX.sym("x", 3)
    code = compiled(ca.Function("f", [x], [2.0 * x + 1.0]))
    block = np.array([1.0, 2.0, 3.0])
    evaluate = code.bind([block], [block])
    evaluate()
    evaluate()
    np.testing.assert_array_equal(block, [7.0, 11.0, 15.0])


def test_same_content_is_compiled_once():
    def build(factor):
        x = ca.SX.sym("x")
        return ca.Function("f", [x], [ca.sin(factor * x)])

    assert compiled(build(3.0)) is compiled(build(3.0))
    assert compiled(build(3.0)) is not compiled(build(4.0))


def test_callable_keeps_code_and_arrays_alive(afresh):
    x = ca.SX.sym("x", 50_000)
    result = np.zeros(1)
    evaluate = native_code(ca.Function("f", [x[:2]], [x[0] + x[1]])).bind([np.ones(2)], [result])
    module._codes.clear()
    gc.collect(1)  # of all that a process has it takes seconds
    trash = [np.full(2, np.nan) for _ in range(100)]
    evaluate()
    assert result[0] == 2.0
    assert len(trash) == 100


def test_unknown_operation_is_left_to_the_interpreter():
    function = ca.Function("f", [X], [ca.erfinv(X)])
    assert native_code(function) is None
    assert why_not(function) == "operation OP_ERFINV"
    assert why_not(FUNCTION) is None


@pytest.mark.parametrize("symbol", [ca.SX, ca.MX])
def test_huge_functions_are_left_to_the_interpreter(monkeypatch, afresh, symbol):
    monkeypatch.setattr("pfsc_drake.compiled.code.Code.most_instructions", 1000)
    x = symbol.sym("x", 20, 20)
    reason = why_not(ca.Function("f", [x], [x @ x]))
    assert reason == "a function of more than 1000 instructions"
    assert native_code(ca.Function("f", [x], [x[:4, :4] @ x[:4, :4]])) is not None


def test_without_llvmlite(monkeypatch, afresh):
    module._llvm.cache_clear()
    for name in ("llvmlite", "llvmlite.binding"):
        monkeypatch.setitem(sys.modules, name, None)
    assert native_code(FUNCTION) is None
    assert "llvmlite" in why_not(FUNCTION)


def test_failure_of_the_compiler_is_not_an_error(monkeypatch, afresh):
    def fail(*_):
        raise AttributeError("create_mcjit_compiler")

    monkeypatch.setattr(module, "NativeCode", fail)
    assert native_code(FUNCTION) is None
    assert why_not(FUNCTION) == "AttributeError: create_mcjit_compiler"


class Counter:
    """Stands for the translation, and counts."""

    def __init__(self, monkeypatch):
        self.count = 0
        translate = module.translate

        def counted(function):
            self.count += 1
            return translate(function)

        monkeypatch.setattr(module, "translate", counted)


def test_the_next_process_reads_it_from_disk(monkeypatch, afresh):
    translations = Counter(monkeypatch)
    for _ in range(3):
        assert_same_bits(*both(FUNCTION, [0.3, -2.0]))
        module._codes.clear()
    assert translations.count == 1
    assert len(list(afresh.iterdir())) == 1


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_a_damaged_file_is_compiled_again(monkeypatch, afresh, damage):
    translations = Counter(monkeypatch)
    native_code(FUNCTION)
    (file,) = afresh.iterdir()
    content = file.read_bytes()
    file.write_bytes(content[:-9] + b"?" + content[-8:] if damage is None else damage)
    module._codes.clear()
    assert_same_bits(*both(FUNCTION, [0.3, -2.0]))
    assert translations.count == 2
    assert file.read_bytes() == content


def test_another_maker_makes_it_again(monkeypatch, afresh):
    translations = Counter(monkeypatch)
    native_code(FUNCTION)
    module._codes.clear()
    monkeypatch.setattr(module, "_maker", lambda: "llvmlite of tomorrow")
    native_code(FUNCTION)
    assert translations.count == 2


def test_nothing_on_disk_is_needed(monkeypatch, afresh):
    afresh.parent.mkdir()
    afresh.write_text("a file where the folder should be")
    assert_same_bits(*both(FUNCTION, [0.3, -2.0]))


def test_bound_code_outlives_the_store(monkeypatch):
    """The last ones of many functions are stored; code in use stays."""
    monkeypatch.setattr("pfsc_drake.compiled.native_code._MOST_CODES", 3)
    x = ca.SX.sym("x")
    functions = [ca.Function("f", [x], [(k + 0.5) * x]) for k in range(6)]
    results = [np.zeros(1) for _ in functions]
    calls = [
        native_code(f).bind([np.ones(1)], [y]) for f, y in zip(functions, results, strict=True)
    ]
    assert native_code(functions[5]) is native_code(functions[5])
    gc.collect(1)  # of all that a process has it takes seconds
    for call in calls:
        call()
    np.testing.assert_array_equal(np.ravel(results), np.arange(6) + 0.5)
