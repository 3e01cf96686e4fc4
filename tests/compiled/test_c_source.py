"""Functions in C: compiled without a warning, and against the interpreter."""

import ctypes
import subprocess

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.c_source import c_source, parameters
from pfsc_drake.compiled.operations import Untranslatable
from tests.compiled import test_computed_indices, test_matrix_instructions, test_translation
from tests.compiled.interpreter import SPECIAL, assert_same_bits
from tests.compiled.test_operations import BINARY, UNARY
from tests.compilers import needs_gcc

WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
X, T = ca.SX.sym("x", 2), ca.SX.sym("t")


def operations():
    """All operations on numbers; what copysign makes of a NaN is left open."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    results = [build(x) for build, _ in UNARY.values()]
    results += [build(x, y) for name, (build, _) in BINARY.items() if name != "copysign"]
    results += [x**e for e in (0.5, 1.5, 2.7, -1.0, 3.0)]
    # a condition as a number, a number as a condition, constants
    results += [2.0 * (x < y), ca.logic_and(x, y < 1.0), x + np.inf, x * -0.1, x / 3e-310]
    return ca.Function("operations", [x, y], [ca.densify(ca.SX(r)) for r in results])


def indices():
    module = test_computed_indices
    grid = ca.DM([-2.0, -1.0, 0.5, 3.0, 5.0, 6.5, 7.0])
    look_ups = [ca.low(grid, module.X, {"lookup_mode": m}) for m in ("linear", "binary", "exact")]
    read = {name: e for name, e in module.READ.items() if name != "rows of columns"}
    results = [*read.values(), *module.WRITTEN.values(), *look_ups]
    return ca.Function("indices", [module.X, module.V, module.K, module.J, module.A], results)


FUNCTIONS = {
    "operations": operations(),
    "indices": indices(),
    "matrices": ca.Function(
        "matrices",
        test_matrix_instructions.SYMBOLS,
        list(test_matrix_instructions.EXPRESSIONS.values()),
    ),
    "calls": ca.Function(
        "calls",
        [test_translation.X, test_translation.Y],
        list(test_translation.EXPRESSIONS.values()),
    ),
}


@pytest.fixture(scope="module", name="compiled")
def fixture_compiled(tmp_path_factory):
    """Return what calls the functions, as compiled together; every warning is an error."""
    folder = tmp_path_factory.mktemp("source")
    for name, text in c_source(FUNCTIONS, "test").items():
        (folder / name).write_text(text)
    sources = sorted(file.name for file in folder.glob("*.c"))
    command = ["gcc", "-std=c99", "-O1", *WARNINGS, "-shared", "-fPIC", "-o", "test.so", *sources]
    done = subprocess.run([*command, "-lm"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:3000]
    return ctypes.CDLL(str(folder / "test.so"))


@pytest.mark.slow(but="calls")
@needs_gcc
@pytest.mark.parametrize("name", FUNCTIONS)
def test_results(name, compiled):
    function, rng = FUNCTIONS[name], np.random.default_rng(0)
    evaluate = getattr(compiled, f"test_{name}")
    evaluate.restype = None
    pointer = ctypes.POINTER(ctypes.c_double)
    for k in range(60):
        passed = []
        for i in range(function.n_in()):
            size = function.nnz_in(i)
            values = [rng.normal(size=size), rng.integers(-2, 8, size).astype(float)][k % 2]
            odd = rng.choice(SPECIAL, size)
            passed.append(np.where(rng.uniform(size=size) < 0.4 * (k % 3), odd, values))
        results = [np.full(function.nnz_out(i), 7.0) for i in range(function.n_out())]
        evaluate(*[a.ctypes.data_as(pointer) for a in [*passed, *results]])
        buffer, interpreted = function.buffer()
        expected = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
        for i, values in enumerate(passed):
            buffer.set_arg(i, values.data)
        for i, values in enumerate(expected):
            buffer.set_res(i, values.data)
        interpreted()
        assert_same_bits(np.concatenate(results), np.concatenate(expected))


def test_indices_that_are_none_do_not_overflow():
    """Unlike in the interpreter, where two of them make a zero."""
    text = c_source({"f": ca.Function("f", [], [ca.MX(1.0)])}, "p")["p_f.c"]
    assert "rounded" not in text
    module = test_computed_indices
    both = ca.Function("f", [module.A, module.K, module.J], [module.READ["rows of columns"]])
    assert "-most" in c_source({"f": both}, "p")["p_f.c"]


def test_header_and_names():
    function = ca.Function(
        "f", [X, T, ca.SX(0, 1)], [X * T, T], ["a.x", "double", "e"], ["a_x", "y"]
    )
    assert parameters(function) == ["a_x", "double_", "e", "a_x_", "y"]
    files = c_source({"step": function}, "robot")
    assert set(files) == {"robot_step.c", "robot.h", "robot_tables.c", "robot_tables.h"}
    assert (
        "void robot_step(const double a_x[2], const double double_[1], const double *e, "
        "double a_x_[2], double y[1]);" in files["robot.h"]
    )


def test_nothing_that_is_not_needed():
    files = c_source({"f": ca.Function("f", [X, T], [X[0] + 1.0])}, "p")
    assert files["p_f.c"].count("static") == 1
    assert "(void)a1;" in files["p_f.c"]
    assert "const" not in files["p_tables.h"] + files["p_tables.c"]


def test_what_has_no_translation():
    with pytest.raises(Untranslatable, match="operation OP_ERFINV"):
        c_source({"f": ca.Function("f", [X], [ca.erfinv(X)])}, "p")
