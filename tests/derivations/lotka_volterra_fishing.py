"""Fishing in a Lotka-Volterra system, relaxed: none, all, then singular to the end.

    Φ = −c₀ x₀ p₀ − c₁ x₁ p₁,   ẋ₀p₀ + x₀ṗ₀ = −2 x₀ (x₀ − 1) − p₁ x₀ x₁,
                                ẋ₁p₁ + x₁ṗ₁ = −2 x₁ (x₁ − 1) + p₀ x₀ x₁,

so Φ' has no control in it, and Φ'' = α + β w gives the singular w = −α/β. Unknown are p(0) and
the two switching times, against Φ(t₁) = 0, Φ(t₂) = Φ'(t₂) = 0 and p(T) = 0, of which one
component is enough, because Φ stays zero on the arc.

Source: S. Sager et al. (2006), and the problem's page on mintoc.de.
"""

from __future__ import annotations

import numpy as np

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

C0, C1, END = 0.4, 0.2, 12.0
GUESS = (-5.84, -1.53, 2.436, 3.98)
START = (0.5, 0.7)


def switching(y: Array) -> float:
    """Φ."""
    x0, x1, p0, p1 = y[:4]
    return float(-C0 * x0 * p0 - C1 * x1 * p1)


def slope(y: Array) -> float:
    """Φ'."""
    x0, x1, p0, p1 = y[:4]
    return float(C0 * (2 * x0 * (x0 - 1) + p1 * x0 * x1) + C1 * (2 * x1 * (x1 - 1) - p0 * x0 * x1))


def curvature(y: Array) -> tuple[float, float]:
    """α and β of Φ'' = α + β w."""
    x0, x1, p0, p1 = y[:4]
    a, b = 2 * (2 * x0 - 1) * x0, 2 * (2 * x1 - 1) * x1
    u, v = p0 * x0 * x1, p1 * x0 * x1
    alpha = C0 * (a * (1 - x1) + x0 * (-2 * x1 * (x1 - 1) + u) + v * (1 - x1)) + C1 * (
        b * (x0 - 1) + x1 * (2 * x0 * (x0 - 1) + v) - u * (x0 - 1)
    )
    beta = -(C0**2) * (a + v) - C1**2 * (b - u)
    return float(alpha), float(beta)


def singular(t: float, y: Array) -> Array:
    alpha, beta = curvature(y)
    return np.array([-alpha / beta])


def constant(value: float) -> Law:
    return lambda t, y: np.array([value])


LAWS: tuple[Law, ...] = (constant(0.0), constant(1.0), singular)


def flow(law: Law) -> Flow:
    """Of (x₀, x₁, p₀, p₁, cost)."""

    def rates(t: float, y: Array) -> Array:
        x0, x1, p0, p1 = y[:4]
        w = law(t, y)[0]
        return np.array(
            [
                x0 - x0 * x1 - C0 * x0 * w,
                -x1 + x0 * x1 - C1 * x1 * w,
                -2 * (x0 - 1) - p0 * (1 - x1 - C0 * w) - p1 * x1,
                -2 * (x1 - 1) + p0 * x0 - p1 * (-1 + x0 - C1 * w),
                (x0 - 1) ** 2 + (x1 - 1) ** 2,
            ]
        )

    return rates


def nodes(z: Array) -> list[Array]:
    """Where arcs meet."""
    y = [np.array([*START, z[0], z[1], 0.0])]
    for law, a, b in zip(LAWS, (0, z[2], z[3]), (z[2], z[3], END), strict=True):
        y.append(integrate(flow(law), a, b, y[-1], 1e-13))
    return y


def residual(z: Array) -> Array:
    _, first, second, last = nodes(z)
    return np.array([switching(first), switching(second), slope(second), last[3]])


def derive() -> Truth:
    z = newton(residual, GUESS)
    y = nodes(z)
    ends = (0.0, float(z[2]), float(z[3]), END)
    require(abs(y[3][2]) < 1e-9, "both costates end at zero")
    arcs = [Arc(ends[i], ends[i + 1], y[i], flow(LAWS[i]), LAWS[i]) for i in range(3)]
    full = [sample([arc], 5, 200) for arc in arcs]
    phi = [np.array([switching(y) for y in states]) for _, states, _ in full]
    require((phi[0][:-1] > 0).all() and (phi[1][1:-1] < 0).all(), "the signs of both bangs")
    require((abs(phi[2]) < 1e-9).all(), "the switching function is zero on the singular arc")
    w = full[2][2]
    require((w > 0).all() and (w < 1).all(), "the singular control is within its bounds")
    require(all(curvature(y)[1] < 0 for y in full[2][1]), "Legendre and Clebsch's condition")
    return Truth(float(y[3][4]), 1e-11, ends[1:3], (0.0, END), *sample(arcs, 2))
