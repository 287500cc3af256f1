"""Vaccination against an epidemic: at full rate until t₁, then as the costate says.

With H = A I + u² + p·f the control is u = min(p_S S/2, 0.9), and p(20) = 0. Costates grow by e¹⁵
over the horizon, so the second arc is cut into pieces. Unknown are p(0), t₁ and what the pieces
begin with, against p_S S/2 = 0.9 at t₁, continuity, and p(20) = 0. A collocation of the whole
horizon, with the minimum left in the control law, gives the guess.

Source: S. Lenhart and J. T. Workman, Optimal Control Applied to Biological Models (2007), lab 7.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_bvp

from derivations.truth import Arc, Array, Flow, Law, Truth, integrate, newton, require, sample

B, D, C, E, G, DEADLY, A = 0.525, 0.5, 0.001, 0.5, 0.1, 0.2, 0.1
MOST, END, PIECES = 0.9, 20.0, 4
START = np.array([1000.0, 100.0, 50.0, 1165.0])
SCALES = np.array([1e3, 1e2, 1e2, 1e3, 1e-3, 1e-2, 1e-1, 1e-2])
"""Of (S, E, I, N, p): unknowns and equations are in these units."""


def most(t: float, y: Array) -> Array:
    return np.array([MOST])


def free(t: float, y: Array) -> Array:
    return np.atleast_1d(y[4] * y[0] / 2)


def saturated(t: float, y: Array) -> Array:
    return np.clip(free(t, y), 0, MOST)


def flow(law: Law) -> Flow:
    """Of (S, E, I, N, p, cost), (9,) or (9, n)."""

    def rates(t: float, y: Array) -> Array:
        S, exposed, infectious, N, p_s, p_e, p_i, p_n = y[:8]
        u = law(t, y) if y.ndim > 1 else law(t, y)[0]
        infections = C * S * infectious
        return np.array(
            [
                B * N - D * S - infections - u * S,
                infections - (E + D) * exposed,
                E * exposed - (G + DEADLY + D) * infectious,
                (B - D) * N - DEADLY * infectious,
                p_s * (D + C * infectious + u) - p_e * C * infectious,
                p_e * (E + D) - p_i * E,
                -A + (p_s - p_e) * C * S + p_i * (G + DEADLY + D) + p_n * DEADLY,
                -p_s * B - p_n * (B - D),
                A * infectious + u**2,
            ]
        )

    return rates


def collocated() -> tuple[Array, float]:
    """Return a guess of all unknowns, and the cost, by collocation."""
    t = np.linspace(0, END, 81)
    costates = SCALES[4:, None] * (1 - t / END)
    guess = np.vstack([np.repeat(START[:, None], len(t), axis=1), costates, np.zeros(len(t))])
    found = solve_bvp(
        flow(saturated),
        lambda a, b: np.concatenate([a[:4] - START, [a[8]], b[4:8]]),
        t,
        guess,
        tol=1e-6,
        max_nodes=5000,
    )
    require(found.status == 0, found.message)
    fine = np.linspace(0, END, 20_001)
    t1 = float(fine[np.argmax(free(0, found.sol(fine)) < MOST)])
    cuts = np.linspace(t1, END, PIECES + 1)[1:-1]
    inner = found.sol(cuts)[:8] / SCALES[:, None]
    p0 = found.y[4:8, 0] / SCALES[4:]
    return np.concatenate([p0, [t1], inner.T.ravel()]), float(found.y[8, -1])


def pieces(z: Array) -> tuple[Array, Array, Array]:
    """Return the start, and what the pieces of the second arc begin and end with, (9, PIECES)."""
    start = np.concatenate([START, z[:4] * SCALES[4:], [0.0]])
    junction = integrate(flow(most), 0, z[4], start, 1e-13)
    inner = z[5:].reshape(PIECES - 1, 8).T * SCALES[:, None]
    begin = np.column_stack([junction, np.vstack([inner, np.zeros(PIECES - 1)])])
    duration = (END - z[4]) / PIECES

    def together(t: float, y: Array) -> Array:
        return np.array(duration * flow(free)(t, y.reshape(9, PIECES)).ravel())

    end = integrate(together, 0, 1, begin.ravel(), 1e-13).reshape(9, PIECES)
    return start, begin, end


def residual(z: Array) -> Array:
    _, begin, end = pieces(z)
    gaps = (end[:8, :-1] - begin[:8, 1:]) / SCALES[:, None]
    junction = free(0, begin[:, 0]) - MOST
    return np.concatenate([junction, end[4:8, -1] / SCALES[4:], gaps.T.ravel()])


def derive() -> Truth:
    guess, collocation = collocated()
    z = newton(residual, guess, 1e-9)
    start, begin, end = pieces(z)
    cost = float(end[8].sum())
    require(abs(cost - collocation) < 1e-8, "the collocation has the same cost")
    t1 = float(z[4])
    cuts = np.linspace(t1, END, PIECES + 1)
    arcs = [Arc(0.0, t1, start, flow(most), most)]
    arcs += [Arc(cuts[i], cuts[i + 1], begin[:, i], flow(free), free) for i in range(PIECES)]
    _, first, _ = sample(arcs[:1], 9, 200)
    require(all(free(0, y) > MOST for y in first[:-1]), "more would be wanted until t1")
    times, states, controls = sample(arcs, 4, 200)
    require((controls > -1e-9).all() and (controls <= MOST + 1e-12).all(), "within the bounds")
    return Truth(cost, 1e-11, (t1,), (0.0, END), times, states, controls)
