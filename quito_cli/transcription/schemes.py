"""The integration schemes: one row each, state and Lagrange cost by the same formula.

A scheme advances one substep of length h from x₀ at t to x₁ at t+h. It is given as a residual

    r(x₀, x₁, own unknowns, û at t + c_i h)  and a quadrature of the Lagrange cost,

so that explicit and implicit schemes are the same to the transcription. An explicit one has
r = Φ(x₀) − x₁ and no unknowns of its own; hence Φ(x₀) = r(x₀, 0), which is how its substeps are
composed without unknowns in between. An implicit one makes the states between its substeps, and
`own` vectors of the size of the state a substep, unknowns of the cell.
"""

from __future__ import annotations

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


SCHEMES: dict[str, Scheme] = {
    row.name: row
    for row in (
        Scheme("euler", "explicit Euler", 1, (0.0,), 0, True, "linear", _euler),
        Scheme("rk4", "classical Runge-Kutta", 4, (0.0, 0.5, 1.0), 0, True, "cubic", _rk4),
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
