"""Phases of many kinds with Pontryagin's conditions written by hand: f, H + ηᵀC, z = (u, η)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from polish_parts import phase, setting_of

from quito_cli.optimality.polish.equations.law import Law
from quito_cli.optimality.polish.equations.structure import Phase

Array = NDArray[np.float64]

HEAD = """\
title: A law
time: {initial: 0, final: 1}
states: {x: {initial: 0%s}, v: {initial: 1}}
parameters: {p: {lower: -5, upper: 5}}
dynamics: {x: v, v: %s}
cost: {lagrange: %s}
controls: {u: {lower: %s, upper: 9}%s}
constraints:
  integral: {budget: %s <= 1}
"""


@dataclass(frozen=True, eq=False)
class Case:
    """A phase of a problem with x' = v, v' = `force`, one parameter and one integral constraint.

    Functions are of x, v, λ₁, λ₂, t, p, ν and the entries of z.
    """

    text: str
    phase: Phase
    z: Callable[..., list[float]]
    """Theory: of all but z."""
    force: Callable[..., float]
    adjoined: Callable[..., float]
    """L + ν q + ηᵀC, which with λᵀf is H + ηᵀC."""
    integrand: Callable[..., float]
    guess: tuple[float, ...]

    @cached_property
    def law(self) -> Law:
        """Its law."""
        return setting_of(self.text).law(self.phase)

    def hamiltonian(self, v: Array, z: Array) -> float:
        """Return H + ηᵀC."""
        return float(v[2] * v[1] + v[3] * self.force(*v, *z) + self.adjoined(*v, *z))

    def rates(self, v: Array) -> Array:
        """Return x', λ', q and (H + ηᵀC)_p, differences at fixed z of what was written by hand."""
        z, h = np.array(self.z(*v)), 1e-5

        def slope(entry: int) -> float:
            step = np.eye(len(v))[entry] * h
            return (self.hamiltonian(v + step, z) - self.hamiltonian(v - step, z)) / (2 * h)

        return np.array(
            [v[1], self.force(*v, *z), -slope(0), -slope(1), self.integrand(*v, *z), slope(5)]
        )


REGULAR = Case(
    HEAD % ("", "u + p*x", "u^2/2*(1 + x^2) + t*v*u", -9, "", "x*u"),
    phase("free"),
    lambda x, v, a, b, t, p, n: [-(b + t * v + n * x) / (1 + x**2)],
    lambda x, v, a, b, t, p, n, u: u + p * x,
    lambda x, v, a, b, t, p, n, u: u**2 / 2 * (1 + x**2) + t * v * u + n * x * u,
    lambda x, v, a, b, t, p, n, u: x * u,
    (0.1,),
)
MIXED = Case(
    HEAD % ("", "u + p*x", "u^2/2", -9, "", "v^2") + "  path: {cap: u*(2 + v) + u^3 + x*t <= p}\n",
    phase("free", held=[(0, True)]),
    lambda x, v, a, b, t, p, n: _capped(x, v, b, t, p),
    lambda x, v, a, b, t, p, n, u, e: u + p * x,
    lambda x, v, a, b, t, p, n, u, e: u**2 / 2 + n * v**2 + e * (u * (2 + v) + u**3 + x * t - p),
    lambda x, v, a, b, t, p, n, u, e: v**2,
    (0.1, 0.0),
)
ORDER_TWO = Case(
    HEAD % (", upper: 0.4", "u - p*sin(x)*v", "u^2/2 + x*u", -9, "", "x^2"),
    phase("free", held=[(0, True)]),
    lambda x, v, a, b, t, p, n: [p * np.sin(x) * v, -(p * np.sin(x) * v + x + b)],
    lambda x, v, a, b, t, p, n, u, e: u - p * np.sin(x) * v,
    lambda x, v, a, b, t, p, n, u, e: u**2 / 2 + x * u + n * x**2 + e * (u - p * np.sin(x) * v),
    lambda x, v, a, b, t, p, n, u, e: x**2,
    (0.1, 0.0),
)
SINGULAR = Case(
    # σ = λ₂, σ' = −v − λ₁, σ'' = −(u + p) + x + t + ν, for λ₁' = −x − t − ν.
    HEAD % ("", "u + p", "(x^2 + v^2)/2 + t*x", -9, "", "x"),
    phase("singular"),
    lambda x, v, a, b, t, p, n: [x + t + n - p],
    lambda x, v, a, b, t, p, n, u: u + p,
    lambda x, v, a, b, t, p, n, u: (x**2 + v**2) / 2 + t * x + n * x,
    lambda x, v, a, b, t, p, n, u: x,
    (0.0,),
)
SINGULAR_HELD = Case(
    # w follows from the row, w = p − v − u; η from H_w = 0; u as above, with v' = w and σ of both:
    # L + ηᵀC has (u + w + v − p) η, η = −(w + λ₂), and H is affine in u where L has only x of it.
    HEAD % ("", "w", "(x^2 + v^2)/2 + x*u", -9, ", w: {lower: -9, upper: 9}", "v")
    + "  path: {sum: x*u + w + v == p}\n",
    phase("singular", "free", held=[(0, False)]),
    lambda x, v, a, b, t, p, n: _shared(x, v, a, b, p, n),
    lambda x, v, a, b, t, p, n, u, w, e: w,
    lambda x, v, a, b, t, p, n, u, w, e: (
        (x**2 + v**2) / 2 + x * u + n * v + e * (x * u + w + v - p)
    ),
    lambda x, v, a, b, t, p, n, u, w, e: v,
    (0.0, 0.0, 0.0),
)
TWO = Case(
    HEAD % ("", "u + w*x + p", "u^2/2 + u*w/2 + w^2*(1 + v^2)", -9, ", w: {}", "u*w"),
    phase("free", "free"),
    lambda x, v, a, b, t, p, n: list(
        -np.linalg.solve([[1.0, 0.5 + n], [0.5 + n, 2 * (1 + v**2)]], [b, b * x])
    ),
    lambda x, v, a, b, t, p, n, u, w: u + w * x + p,
    lambda x, v, a, b, t, p, n, u, w: u**2 / 2 + (0.5 + n) * u * w + w**2 * (1 + v**2),
    lambda x, v, a, b, t, p, n, u, w: u * w,
    (0.0, 0.0),
)


def _capped(x: float, v: float, b: float, t: float, p: float) -> list[float]:
    """The one real root of u³ + (2 + v) u + x t − p by Cardano's formula, v > −2, and η."""
    q, r = (2 + v) / 3, (p - x * t) / 2
    root = np.sqrt(q**3 + r**2)
    u = float(np.cbrt(r + root) + np.cbrt(r - root))
    return [u, -(u + b) / (2 + v + 3 * u**2)]


def _shared(x: float, v: float, a: float, b: float, p: float, n: float) -> list[float]:
    """H_w = 0 gives η = −λ₂, the row w = p − v − x u, and σ'' = 0 the singular u.

    σ = x (1 − λ₂), σ' = v (1 − λ₂) − x λ₂', σ'' = w (1 − λ₂) − 2 v λ₂' − x λ₂'', with
    λ₂' = λ₂ − v − λ₁ − ν and λ₂'' = λ₂' − w + x + u (1 − λ₂): as w is, of the form A u + B.
    """
    rate = b - v - a - n
    offset = (p - v) * (1 - b) - 2 * v * rate - x * (rate - (p - v) + x)
    slope = -x * (1 - b) - x * (x + 1 - b)
    u = -offset / slope
    return [u, p - v - x * u, -b]


CASES = {
    "regular": REGULAR,
    "held mixed row": MIXED,
    "held state row of order two": ORDER_TWO,
    "singular": SINGULAR,
    "singular with a held row": SINGULAR_HELD,
    "two controls": TWO,
}
