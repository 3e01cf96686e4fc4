"""Truncated Taylor arithmetic.

A :class:`Jet` is the list of Taylor coefficients ``c_k = x^(k) / k!``, ``k = 0..order``, of a
signal ``x(t)`` at the present instant. Coefficients are numbers, numpy arrays of shape ``(3,)`` or
``(3, 3)``, or CasADi ``SX`` scalars, columns and matrices; the arithmetic is the same for all of
them. Operations between jets of different order give the lower order, the highest that is known.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np

Coefficient = Any  # float | np.ndarray | ca.SX


class Jet:
    """Taylor coefficients of a scalar, vector or matrix signal.

    Args:
        coefficients: ``c_0 .. c_order``, all of one shape.

    Raises:
        ValueError: If there is no coefficient.
    """

    __slots__ = ("coefficients",)
    # numpy operands defer to this class instead of broadcasting over it
    __array_ufunc__ = None

    def __init__(self, coefficients: Sequence[Coefficient]) -> None:
        if len(coefficients) == 0:
            raise ValueError("a jet needs at least the coefficient of order 0")
        self.coefficients: tuple[Coefficient, ...] = tuple(coefficients)

    @classmethod
    def from_derivatives(cls, derivatives: Sequence[Coefficient]) -> "Jet":
        """Return a jet from ``x, x', x'', ...``."""
        return cls([d / math.factorial(k) for k, d in enumerate(derivatives)])

    @property
    def order(self) -> int:
        """Order of the highest known coefficient."""
        return len(self.coefficients) - 1

    def derivative(self, k: int) -> Coefficient:
        """Return the k-th time derivative ``x^(k) = k! c_k``."""
        return self.coefficients[k] * math.factorial(k)

    def derivatives(self) -> list[Coefficient]:
        """Return ``x, x', ..., x^(order)``."""
        return [self.derivative(k) for k in range(self.order + 1)]

    def truncate(self, order: int) -> "Jet":
        """Drop all coefficients above ``order``."""
        return Jet(self.coefficients[: order + 1])

    def append(self, coefficient: Coefficient) -> "Jet":
        """Return the jet of the next order with this last coefficient."""
        return Jet((*self.coefficients, coefficient))

    def differentiate(self) -> "Jet":
        """Return the jet of ``dx/dt``; its order is one less."""
        return Jet([k * c for k, c in enumerate(self.coefficients)][1:])

    def integrate(self, initial: Coefficient) -> "Jet":
        """Return the jet of the antiderivative with value ``initial``; its order is one more."""
        return Jet([initial, *(c / (k + 1) for k, c in enumerate(self.coefficients))])

    def map(self, function: Callable[[Coefficient], Coefficient]) -> "Jet":
        """Apply a *linear* function to the signal, i.e. to every coefficient."""
        return Jet([function(c) for c in self.coefficients])

    @property
    def T(self) -> "Jet":
        """Transpose of a matrix signal."""
        return self.map(lambda c: c.T)

    def __getitem__(self, index: Any) -> "Jet":
        return self.map(lambda c: c[index])

    def __iter__(self) -> Iterator["Jet"]:
        raise TypeError("a jet is not iterable; index its components or use .coefficients")

    def __repr__(self) -> str:
        return f"Jet({list(self.coefficients)!r})"

    def __neg__(self) -> "Jet":
        return self.map(lambda c: -c)

    def __add__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return Jet([a + b for a, b in zip(self.coefficients, other.coefficients, strict=False)])
        return Jet((self.coefficients[0] + other, *self.coefficients[1:]))

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Jet":
        return self + (-other)

    def __rsub__(self, other: Any) -> "Jet":
        return (-self) + other

    def __mul__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return bilinear(lambda a, b: a * b, self, other)
        return self.map(lambda c: c * other)

    def __rmul__(self, other: Any) -> "Jet":
        return self.map(lambda c: other * c)

    def __matmul__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return bilinear(lambda a, b: a @ b, self, other)
        return self.map(lambda c: c @ other)

    def __rmatmul__(self, other: Any) -> "Jet":
        return self.map(lambda c: other @ c)

    def __truediv__(self, other: Any) -> "Jet":
        if not isinstance(other, Jet):
            return self.map(lambda c: c / other)
        a, b = self.coefficients, other.coefficients
        quotient: list[Coefficient] = []
        for k in range(min(len(a), len(b))):
            known = sum((b[j] * quotient[k - j] for j in range(1, k + 1)), start=0.0)
            quotient.append((a[k] - known) / b[0])
        return Jet(quotient)

    def __rtruediv__(self, other: Any) -> "Jet":
        return constant(other, self.order) / self

    def __pow__(self, exponent: float) -> "Jet":
        if exponent == 2:
            return _square(self)
        if isinstance(exponent, int) and exponent >= 0:
            power = constant(1.0, self.order)
            for _ in range(exponent):
                power = power * self
            return power
        a = self.coefficients
        p = [a[0] ** exponent]
        for k in range(1, len(a)):
            total = sum((exponent * j - (k - j)) * a[j] * p[k - j] for j in range(1, k + 1))
            p.append(total / (k * a[0]))
        return Jet(p)


def constant(value: Coefficient, order: int) -> Jet:
    """Return the jet of a signal that does not change."""
    return Jet([value] + [value * 0.0] * order)


def bilinear(product: Callable[[Coefficient, Coefficient], Coefficient], x: Jet, y: Jet) -> Jet:
    """Return the jet of a bilinear product of two signals (Cauchy product)."""
    a, b = x.coefficients, y.coefficients
    result = []
    for k in range(min(len(a), len(b))):
        total = product(a[0], b[k])
        for j in range(1, k + 1):
            total = total + product(a[j], b[k - j])
        result.append(total)
    return Jet(result)


def _square(x: Jet) -> Jet:
    """Return the square of a scalar signal; every mixed product is computed once."""
    a = x.coefficients
    result = []
    for k in range(len(a)):
        mixed = sum((a[j] * a[k - j] for j in range((k + 1) // 2)), start=0.0)
        result.append(2 * mixed + (a[k // 2] * a[k // 2] if k % 2 == 0 else 0.0))
    return Jet(result)


def _is_symbolic(*values: Coefficient) -> bool:
    return any(isinstance(v, ca.SX) for v in values)


def dot(x: Jet | Coefficient, y: Jet | Coefficient) -> Jet:
    """Return the scalar product of two vector signals, at least one of them a jet."""

    def product(a: Coefficient, b: Coefficient) -> Coefficient:
        return ca.dot(a, b) if _is_symbolic(a, b) else np.dot(a, b)

    return _apply(product, x, y)


def cross(x: Jet | Coefficient, y: Jet | Coefficient) -> Jet:
    """Return the cross product of two 3-vector signals, at least one of them a jet."""

    def product(a: Coefficient, b: Coefficient) -> Coefficient:
        return ca.cross(a, b) if _is_symbolic(a, b) else np.cross(a, b)

    return _apply(product, x, y)


def _apply(
    product: Callable[[Coefficient, Coefficient], Coefficient],
    x: Jet | Coefficient,
    y: Jet | Coefficient,
) -> Jet:
    if not isinstance(x, Jet):
        return y.map(lambda c: product(x, c))
    if not isinstance(y, Jet):
        return x.map(lambda c: product(c, y))
    return bilinear(product, x, y)


def sqrt(x: Jet) -> Jet:
    """Return the square root of a positive scalar signal."""
    a = x.coefficients
    root = [ca.sqrt(a[0]) if _is_symbolic(a[0]) else np.sqrt(a[0])]
    for k in range(1, len(a)):
        known = sum((root[j] * root[k - j] for j in range(1, k)), start=0.0)
        root.append((a[k] - known) / (2 * root[0]))
    return Jet(root)


def sin_cos(x: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine of a scalar signal; they share one recurrence."""
    a = x.coefficients
    library = ca if _is_symbolic(a[0]) else np
    s, c = [library.sin(a[0])], [library.cos(a[0])]
    for k in range(1, len(a)):
        s.append(sum(j * a[j] * c[k - j] for j in range(1, k + 1)) / k)
        c.append(-sum(j * a[j] * s[k - j] for j in range(1, k + 1)) / k)
    return Jet(s), Jet(c)


def sin(x: Jet) -> Jet:
    """Return the sine of a scalar signal."""
    return sin_cos(x)[0]


def cos(x: Jet) -> Jet:
    """Return the cosine of a scalar signal."""
    return sin_cos(x)[1]


def atan2(y: Jet, x: Jet) -> Jet:
    """Return the angle of the point ``(x, y)``, which must not be the origin."""
    y0, x0 = y.coefficients[0], x.coefficients[0]
    angle = ca.atan2(y0, x0) if _is_symbolic(y0, x0) else np.arctan2(y0, x0)
    if min(x.order, y.order) == 0:
        return Jet([angle])
    rate = (x * y.differentiate() - y * x.differentiate()) / (x**2 + y**2)
    return rate.integrate(angle)


def compose(derivatives: Sequence[Coefficient], inner: Jet) -> Jet:
    """Return the jet of ``f(g(t))``.

    Args:
        derivatives: ``f, f', f'', ...`` at ``g(0)``, each a scalar, vector or
            matrix; as many as the result needs, that is ``inner.order + 1``.
        inner: Jet of the scalar signal ``g``.

    Returns:
        Jet of the lower of the two orders.
    """
    order = min(len(derivatives) - 1, inner.order)
    increment = Jet([inner.coefficients[0] * 0.0, *inner.coefficients[1 : order + 1]])
    powers = [increment]
    for _ in range(order - 1):
        powers.append(powers[-1] * increment)
    result = [derivatives[0]]
    for k in range(1, order + 1):
        # the m-th power of the increment starts at order m
        result.append(
            sum(
                derivatives[m] * (powers[m - 1].coefficients[k] / math.factorial(m))
                for m in range(1, k + 1)
            )
        )
    return Jet(result)


def compose_pair(partials: Sequence[Coefficient], first: Jet, second: Jet) -> Jet:
    """Return the jet of ``f(g(t), h(t))``.

    Args:
        partials: Partial derivatives of f at ``(g(0), h(0))`` by total order, and inside one from
            the first variable to the second: ``f, f_g, f_h, f_gg, f_gh, f_hh, ...``.
        first: Jet of the scalar signal ``g``.
        second: Jet of the scalar signal ``h``.

    Returns:
        Jet of the lowest of the orders of both jets and of the partial derivatives.
    """
    order = min((math.isqrt(8 * len(partials) + 1) - 3) // 2, first.order, second.order)
    powers = [_scaled_powers(inner.truncate(order)) for inner in (first, second)]
    result = [partials[0]]
    for k in range(1, order + 1):
        # the linear terms last: the sum before them does not depend on their coefficients
        terms = [(n - j, j) for n in range(k, 0, -1) for j in range(n + 1)]
        products = [(powers[0][i] * powers[1][j]).coefficients[k] for i, j in terms]
        factors = [partials[(i + j) * (i + j + 1) // 2 + j] for i, j in terms]
        result.append(sum(f * p for f, p in zip(factors, products, strict=True)))
    return Jet(result)


def _scaled_powers(x: Jet) -> list[Jet]:
    """Return ``(x - x(0))^n / n!`` of a scalar signal for n up to its order."""
    increment = Jet([x.coefficients[0] * 0.0, *x.coefficients[1:]])
    powers = [constant(x.coefficients[0] * 0.0 + 1.0, x.order), increment, increment**2 * 0.5]
    for n in range(3, x.order + 1):
        powers.append(powers[-1] * increment * (1.0 / n))
    return powers


def vector(components: Sequence[Jet]) -> Jet:
    """Return the vector signal of scalar signals."""
    order = min(c.order for c in components)
    columns = []
    for k in range(order + 1):
        entries = [c.coefficients[k] for c in components]
        columns.append(ca.vertcat(*entries) if _is_symbolic(*entries) else np.array(entries))
    return Jet(columns)


def solve_ode(right_hand_side: Callable[[Jet], Jet], initial: Coefficient, order: int) -> Jet:
    """Return the Taylor solution of ``x' = f(x)`` up to ``order``.

    Args:
        right_hand_side: Maps the jet of ``x`` of some order to the jet of ``x'`` of at least the
            same order; it contains everything else that ``x'`` depends on.
        initial: Value of ``x`` at the present instant.
        order: Order of the result.
    """
    solution = Jet([initial])
    for k in range(order):
        rate = right_hand_side(solution)
        solution = solution.append(rate.coefficients[k] / (k + 1))
    return solution
