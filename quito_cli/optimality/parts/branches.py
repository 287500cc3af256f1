"""Kinks of formulas in a control: where they are, and the formula on either side of one.

A corner is an operation of abs, sign, min, max or a comparison; its argument c is zero there. Where
c = a (u_i − b) with b a number and a without controls, the formula has a branch on either side,

    |c| = ±a (u_i − b),      max(p, q) = p or q,      (c > 0) = 1 or 0,

and a kink at u_i = b if the branches agree there, with the formula itself, and their slopes do not.
If they do not agree the formula jumps.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from quito_cli.problem.language.rebuilding import rebuilt

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.symbols.probes import Probe

SAME = 1e-12
"""Relative distance within which two kinks are one."""
MOST_CORNERS = 16
"""Of a term in a control that are looked into; a table read at a control may have many more."""
MOST_TERMS = 500
"""Terms that a sum is taken apart into."""


class Stretch(NamedTuple):
    """Values of one control, all on the same branches."""

    control: int
    low: float
    high: float

    def above(self, site: float) -> bool | None:
        """Whether it is above a site, or below it; None where the site is inside."""
        room = SAME * (1 + abs(site))
        if site <= self.low + room:
            return True
        return False if site >= self.high - room else None


class Corner(NamedTuple):
    """c = slope (u_i − site)."""

    control: int
    site: float
    slope: ca.SX


@cache
def corner_operations() -> frozenset[int]:
    """Return the operations that have a corner or a jump where their argument is zero."""
    import casadi as ca

    return frozenset((ca.OP_FABS, ca.OP_SIGN, ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE))


def corner(operation: int, arguments: list[ca.SX], u: ca.SX) -> Corner | None:
    """Return the corner that an operation is in a control; None where it is none that is known."""
    import casadi as ca

    if operation not in corner_operations():
        return None
    zero = arguments[0] - (arguments[1] if len(arguments) == 2 else 0)
    if not ca.depends_on(zero, u):
        return None
    slopes = ca.jacobian(zero, u)
    (columns,) = np.nonzero(np.array(ca.DM(slopes.sparsity(), 1)).ravel())
    if len(columns) != 1 or ca.depends_on(slopes, u):
        return None
    i = int(columns[0])
    site = -ca.substitute(zero, u[i], ca.SX(0)) / slopes[0, i]
    if not site.is_constant() or not np.isfinite(float(site)):
        return None
    return Corner(i, float(site), slopes[0, i])


def sites(formula: ca.SX, symbols: list[ca.SX], u: ca.SX) -> dict[int, list[float]]:
    """Return the sites of a formula's corners by control, in order, corners in corners too."""
    found = _plain_sites(formula, symbols, u)
    return {i: _with_inner(formula, symbols, u, i, given) for i, given in found.items()}


def _with_inner(
    formula: ca.SX, symbols: list[ca.SX], u: ca.SX, i: int, given: list[float]
) -> list[float]:
    """Return sites with those of corners that are seen between them."""
    while len(given) < MOST_CORNERS:
        inner: list[float] = []
        for low, high in pairwise([-np.inf, *given, np.inf]):
            own = branch(formula, symbols, u, Stretch(i, low, high))
            inner += [b for b in _plain_sites(own, symbols, u).get(i, ()) if low < b < high]
        more = distinct([*given, *inner])
        if len(more) == len(given):
            break
        given = more
    return given


def _plain_sites(formula: ca.SX, symbols: list[ca.SX], u: ca.SX) -> dict[int, list[float]]:
    """Return the sites of corners whose argument has none, by control, in order."""
    found: dict[int, list[float]] = {}

    def seen(operation: int, arguments: list[ca.SX]) -> None:
        own = corner(operation, arguments, u)
        if own is not None:
            found.setdefault(own.control, []).append(own.site)

    rebuilt(formula, symbols, seen)
    return {i: distinct(values) for i, values in found.items()}


def distinct(values: list[float]) -> list[float]:
    """Return values in order, those that are the same but for rounding once."""
    kept: list[float] = []
    for value in sorted(values):
        if not kept or value - kept[-1] > SAME * (1 + abs(value)):
            kept.append(value)
    return kept


def branch(formula: ca.SX, symbols: list[ca.SX], u: ca.SX, stretch: Stretch) -> ca.SX:
    """Return a formula as it is on a stretch of a control, without the corners at its ends."""
    import casadi as ca

    def replaced(operation: int, arguments: list[ca.SX]) -> ca.SX | None:
        own = corner(operation, arguments, u)
        if own is None or own.control != stretch.control:
            return None
        side = stretch.above(own.site)
        if side is None:
            return None
        sign = ca.sign(own.slope) * (1 if side else -1)  # of c
        first, last = arguments[0], arguments[-1]
        if operation == ca.OP_FABS:
            return sign * first
        if operation == ca.OP_SIGN:
            return sign
        if operation in (ca.OP_LT, ca.OP_LE):  # c = first - last
            return (1 - sign) / 2
        greater = sign if operation == ca.OP_FMAX else -sign
        return (1 + greater) / 2 * first + (1 - greater) / 2 * last

    return rebuilt(formula, symbols, replaced)


def kinks(
    formula: ca.SX, symbols: list[ca.SX], u: ca.SX, i: int, given: list[float], probe: Probe
) -> tuple[list[float], bool]:
    """Return at which of its corners in a control a formula has a kink, and whether it jumps.

    Args:
        formula: scalar.
        symbols: all that it may depend on.
        u: all controls, among `symbols`.
        i: the control.
        given: sites of corners.
        probe: random points.
    """
    import casadi as ca

    found, ends = [], [-np.inf, *given, np.inf]
    for k, site in enumerate(given):
        sides = []
        for low, high in ((ends[k], site), (site, ends[k + 2])):
            own = branch(formula, symbols, u, Stretch(i, low, high))
            sides.append([own, ca.jacobian(own, u[i])])
        apart = [
            ca.substitute(above - below, u[i], ca.SX(site))
            for below, above in zip(*sides, strict=True)
        ]
        at, limit = (ca.substitute(of, u[i], ca.SX(site)) for of in (formula, sides[0][0]))
        if not probe.vanishes(apart[0]) or not probe.vanishes(at - limit):
            return [], True
        if not probe.vanishes(apart[1]):
            found.append(site)
    return found, False


def terms(formula: ca.SX, u: ca.SX) -> Iterator[ca.SX]:
    """Give scalars whose sum is a scalar formula, each without a sum of terms with controls in it.

    The two sides of a choice are one term.
    """
    import casadi as ca

    waiting, count = [(ca.SX(1), formula)], 1
    while waiting:
        factor, own = waiting.pop()
        parts = [own.dep(k) for k in range(own.n_dep())]
        inside = [ca.depends_on(part, u) for part in parts]
        chosen = any(part.is_op(ca.OP_IF_ELSE_ZERO) for part in parts)
        sums = own.is_op(ca.OP_ADD) or own.is_op(ca.OP_SUB)
        if sums and any(inside) and not chosen and count < MOST_TERMS:
            count += 1
            second = -factor if own.is_op(ca.OP_SUB) else factor
            waiting += [(factor, parts[0]), (second, parts[1])]
        elif own.is_op(ca.OP_NEG):
            waiting.append((-factor, parts[0]))
        elif own.is_op(ca.OP_MUL) and sum(inside) == 1:
            inner = inside.index(True)
            waiting.append((factor * parts[1 - inner], parts[inner]))
        elif own.is_op(ca.OP_DIV) and inside == [True, False]:
            waiting.append((factor / parts[1], parts[0]))
        else:
            yield factor * own
