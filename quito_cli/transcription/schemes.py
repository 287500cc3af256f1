"""The integration schemes: one row each, state and Lagrange cost by the same formula.

    euler            explicit, order 1
    rk4              explicit, order 4
    trapezoidal      implicit, order 2, A-stable
    hermite-simpson  implicit, order 4: collocation at both ends and the middle
    radau            implicit, order 5, L-stable: for stiff dynamics

A scheme advances one substep of length h from x₀ at t to x₁ at t+h. It is given as a residual

    r(x₀, x₁, own unknowns, û at t + c_i h)  and a quadrature of the Lagrange cost,

so that explicit and implicit schemes are the same to the transcription. An explicit one has
r = Φ(x₀) − x₁ and no unknowns of its own; hence Φ(x₀) = r(x₀, 0), which is how its substeps are
composed without unknowns in between. An implicit one makes the states between its substeps, and
`own` vectors of the size of the state a substep, unknowns of the cell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from quito_cli.errors import UsageError

Expression = Any
"""A CasADi SX; casadi is not imported for a table."""

RightHandSide = Callable[[Expression, Expression, Expression], tuple[Expression, Expression]]
"""(x, u, t) ↦ (ẋ, L)."""

Residual = Callable[
    [
        RightHandSide,
        Expression,
        Expression,
        Sequence[Expression],
        Sequence[Expression],
        Expression,
        Expression,
    ],
    tuple[Expression, Expression],
]
"""(f, x₀, x₁, own unknowns, û at the offsets, t, h) ↦ (residual, quadrature)."""


@dataclass(frozen=True)
class Scheme:
    """A row of the table."""

    name: str
    title: str
    order: int
    offsets: tuple[float, ...]
    """Stage offsets c_i in a substep, increasing, in [0, 1]."""
    own: int
    """Vectors of the state's size that a substep adds to the unknowns."""
    explicit: bool
    interpolation: Literal["linear", "cubic"]
    """What matches the scheme's order between its points."""
    residual: Residual


def _euler(
    f: RightHandSide,
    x0: Expression,
    x1: Expression,
    own: Sequence[Expression],
    u: Sequence[Expression],
    t: Expression,
    h: Expression,
) -> tuple[Expression, Expression]:
    """x₁ = x₀ + h f(x₀, u₀, t)."""
    k, q = f(x0, u[0], t)
    return x0 + h * k - x1, h * q


def _rk4(
    f: RightHandSide,
    x0: Expression,
    x1: Expression,
    own: Sequence[Expression],
    u: Sequence[Expression],
    t: Expression,
    h: Expression,
) -> tuple[Expression, Expression]:
    """x₁ = x₀ + h (k₁ + 2k₂ + 2k₃ + k₄)/6, Kutta's classical scheme, û at the true stage times."""
    k1, q1 = f(x0, u[0], t)
    k2, q2 = f(x0 + h / 2 * k1, u[1], t + h / 2)
    k3, q3 = f(x0 + h / 2 * k2, u[1], t + h / 2)
    k4, q4 = f(x0 + h * k3, u[2], t + h)
    return x0 + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4) - x1, h / 6 * (q1 + 2 * q2 + 2 * q3 + q4)


def _trapezoidal(
    f: RightHandSide,
    x0: Expression,
    x1: Expression,
    own: Sequence[Expression],
    u: Sequence[Expression],
    t: Expression,
    h: Expression,
) -> tuple[Expression, Expression]:
    """x₁ = x₀ + h (f₀ + f₁)/2, the trapezoidal rule."""
    f0, q0 = f(x0, u[0], t)
    f1, q1 = f(x1, u[1], t + h)
    return x0 + h / 2 * (f0 + f1) - x1, h / 2 * (q0 + q1)


def _hermite_simpson(
    f: RightHandSide,
    x0: Expression,
    x1: Expression,
    own: Sequence[Expression],
    u: Sequence[Expression],
    t: Expression,
    h: Expression,
) -> tuple[Expression, Expression]:
    """x₁ = x₀ + h (f₀ + 4f_m + f₁)/6 with x_m = (x₀ + x₁)/2 + h (f₀ − f₁)/8.

    Simpson's rule on the cubic through both ends and their slopes: Hargraves and Paris, *J.
    Guidance* 10 (1987), in its compressed form, without the state in the middle as an unknown.
    """
    f0, q0 = f(x0, u[0], t)
    f1, q1 = f(x1, u[2], t + h)
    middle = (x0 + x1) / 2 + h / 8 * (f0 - f1)
    fm, qm = f(middle, u[1], t + h / 2)
    return x0 + h / 6 * (f0 + 4 * fm + f1) - x1, h / 6 * (q0 + 4 * qm + q1)


_S6 = math.sqrt(6)
_RADAU_C = ((4 - _S6) / 10, (4 + _S6) / 10, 1.0)
_RADAU_A = (
    ((88 - 7 * _S6) / 360, (296 - 169 * _S6) / 1800, (-2 + 3 * _S6) / 225),
    ((296 + 169 * _S6) / 1800, (88 + 7 * _S6) / 360, (-2 - 3 * _S6) / 225),
    ((16 - _S6) / 36, (16 + _S6) / 36, 1 / 9),
)


def _radau(
    f: RightHandSide,
    x0: Expression,
    x1: Expression,
    own: Sequence[Expression],
    u: Sequence[Expression],
    t: Expression,
    h: Expression,
) -> tuple[Expression, Expression]:
    """X_i = x₀ + h Σ_j a_ij f(X_j, u_j, t + c_j h), x₁ = X₃: Radau IIA with three stages.

    Hairer and Wanner, *Solving Ordinary Differential Equations II*, table IV.5.6. û at the start of
    the step takes no part: it is there for path constraints.
    """
    import casadi as ca

    stages = (*own, x1)
    slopes, costs = zip(
        *(f(x, v, t + c * h) for x, v, c in zip(stages, u[1:], _RADAU_C, strict=True)), strict=True
    )
    residuals = [
        x0 + h * sum(a * k for a, k in zip(row, slopes, strict=True)) - x
        for row, x in zip(_RADAU_A, stages, strict=True)
    ]
    return ca.vertcat(*residuals), h * sum(b * q for b, q in zip(_RADAU_A[-1], costs, strict=True))


SCHEMES: dict[str, Scheme] = {
    row.name: row
    for row in (
        Scheme("euler", "explicit Euler", 1, (0.0,), 0, True, "linear", _euler),
        Scheme("trapezoidal", "trapezoidal rule", 2, (0.0, 1.0), 0, False, "cubic", _trapezoidal),
        Scheme("rk4", "classical Runge-Kutta", 4, (0.0, 0.5, 1.0), 0, True, "cubic", _rk4),
        Scheme(
            *("hermite-simpson", "Hermite and Simpson", 4, (0.0, 0.5, 1.0), 0, False, "cubic"),
            _hermite_simpson,
        ),
        Scheme("radau", "Radau IIA", 5, (0.0, *_RADAU_C), 2, False, "cubic", _radau),
    )
}


def scheme(name: str) -> Scheme:
    """Return the row of that name.

    Raises:
        UsageError: there is none; the message lists them.
    """
    if name not in SCHEMES:
        raise UsageError(f"there is no discretization {name!r}; there are {', '.join(SCHEMES)}")
    return SCHEMES[name]
