"""Look-up in tables, and elements at indices that are calculated, in LLVM assembly."""

import re
from collections.abc import Sequence

import casadi as ca
import numpy as np

from pfsc_drake.compiled.assembly import Code, Values, elements
from pfsc_drake.compiled.operations import Untranslatable, literal

__all__ = ["get_computed", "helpers", "indices", "look_up", "set_computed"]

_HELPERS = """\
define internal i64 @index(double %x) nounwind alwaysinline {
; what does not fit, and NaN, is the smallest number, as from the processor's conversion
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


def helpers(text: str) -> str:
    """Return the functions that instructions call, as far as assembly needs them.

    Args:
        text: The assembly.
    """
    functions = re.findall(r"define internal \w+ (@\w+)\(.*?\n}\n", _HELPERS, re.DOTALL)
    texts = re.findall(r"define internal .*?\n}\n", _HELPERS, re.DOTALL)
    needed = [body for name, body in zip(functions, texts, strict=True) if f"{name}(" in text]
    # one of them calls the first
    return "".join(dict.fromkeys([texts[0], *needed]) if needed else [])


def look_up(code: Code, operands: Sequence[Values], mode: str) -> Values:
    """Add a look-up in a table, and return the places.

    Args:
        code: Where it goes.
        operands: The grid and what is looked for.
        mode: ``linear``, ``binary`` or ``exact``.
    """
    grid, sought = operands
    table = code.pointer(grid)
    return [
        code.new(f"call double @low_{mode}(double {code.load(x)}, ptr {table}, i64 {len(grid)})")
        for x in sought
    ]


def get_computed(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    """Add instructions that read elements at computed indices; beyond the end there is NaN."""
    source, *places = operands
    given = [[code.new(f"call i64 @index(double {code.load(x)})") for x in p] for p in places]
    part = node.info()
    if "inner" in part:
        sums = [(i, str(j)) for i in given[0] for j in indices(part["inner"])]
    elif "outer" in part:
        sums = [(i, str(j)) for j in indices(part["outer"]) for i in given[0]]
    elif len(given) == 2:
        sums = [(i, j) for j in given[1] for i in given[0]]
    else:
        sums = [(i, "0") for i in given[0]]
    if not source:
        return [literal(np.nan)] * len(sums)
    array, size = code.pointer(source), len(source)
    result: Values = []
    for i, j in sums:
        place = i if j == "0" else code.new(f"add i64 {i}, {j}")
        result.append(code.new(f"call double @element(ptr {array}, i64 {size}, i64 {place})"))
    return result


def set_computed(code: Code, node: ca.MX, operands: Sequence[Values]) -> Values:
    """Add instructions that replace or raise elements at computed indices, if there are such."""
    # of other kinds the node does not say the slice
    if len(operands) != 3 or "ParamVector" not in node.class_name():
        raise Untranslatable("assignment at several computed indices")
    old, new, places = operands
    if not old:
        return old
    array, size = code.copy(old), len(old)
    for value, x in zip(new, places, strict=True):
        index = code.new(f"call i64 @index(double {code.load(x)})")
        if node.op() == ca.OP_ADDNONZEROS_PARAM:
            before = code.new(f"call double @element(ptr {array}, i64 {size}, i64 {index})")
            value = code.apply(ca.OP_ADD, before, value)
        code.add(f"call void @put(ptr {array}, i64 {size}, i64 {index}, double {code.load(value)})")
    # behind the changes, as memory that does not change any more
    return elements(code.new(f"getelementptr double, ptr {array}, i64 0"), size)


def indices(part: dict[str, int]) -> range:
    """Return the indices of a slice, as CasADi describes it."""
    return range(part["start"], part["stop"], part["step"])
