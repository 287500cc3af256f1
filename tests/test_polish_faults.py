"""What speaks against an extremal, and its multipliers of direct adjoining, against closed forms.

Each structure is given and solved as it is: right ones have no fault, wrong ones exactly theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from polish_parts import Guess, phase, setting_of, solved

from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.faults.adjoining import adjoined, atoms
from quito_cli.optimality.polish.faults.dense import Dense
from quito_cli.optimality.polish.faults.fault import OFFSETS, What
from quito_cli.optimality.polish.faults.faults import faults
from quito_cli.optimality.polish.faults.faults_of_curvature import legendre

Array = NDArray[np.float64]

ONE = """\
title: One state
time: {initial: 0, final: 1}
states: {x: {initial: %s}}
controls: {u: {lower: %s, upper: %s}}
dynamics: {x: u}
cost: {lagrange: %s}
%s"""
TWO = """\
title: Two states
time: {initial: 0, final: %s}
states: {x: {%s}, v: {%s}}
controls: {u: {lower: %s, upper: %s}}
dynamics: {x: v, v: u}
cost: {lagrange: %s}
"""
DENHAM = TWO % (1, "initial: 0, final: 0, upper: 1/9", "initial: 1, final: -1", -99, 99, "u^2/2")
REST = TWO % (1, "initial: 0, final: 1", "initial: 0, final: 0", -4, 4, "u^2/2")
FLOOR = ONE % ("0.08, final: 0.08, lower: 0", -9, 9, "u^2/2 + x", "")
CAP = "constraints: {path: {cap: u <= 0.5}}\n"
FREE, TOP, BOTTOM, SINGULAR = (phase(k) for k in ("free", "upper", "lower", "singular"))
HELD = phase("free", held=[(0, True)])
LEAST = phase("free", held=[(0, False)])


def denham(t: Array) -> Array:
    """Return (x, λ) of Bryson and Denham's extremal about, of indirect adjoining."""
    left, right = np.maximum(1 / 3 - t, 0.0), np.maximum(t - 2 / 3, 0.0)
    arc = (t > 1 / 3) & (t < 2 / 3)
    first = np.where(t < 1 / 3, 18.0, -18.0)
    second = 18 * (left + right) - np.where(arc, 18 * (2 / 3 - t), 0.0)
    x = 1 / 9 - 3 * left**3 - 3 * right**3
    return np.column_stack([x, 9 * left**2 - 9 * right**2, first, second])


@cache
def ceiling() -> Dense:
    """Bryson and Denham's extremal for l = 1/9."""
    structure = Structure((FREE, HELD, FREE), (0.0, 0.34, 0.66, 1.0))
    return solved(setting_of(DENHAM), structure, Guess(denham))


@cache
def floor() -> Dense:
    """x' = u over a floor: x = (0.4 − t)²/2 before it, √(2 · 0.08) = 0.4."""

    def near(t: Array) -> Array:
        left, right = np.maximum(0.4 - t, 0.0), np.maximum(t - 0.6, 0.0)
        pulled = np.where((t > 0.4) & (t < 0.6), 0.6 - t, 0.0)
        return np.column_stack([(left**2 + right**2) / 2, left - right + pulled])

    structure = Structure((FREE, LEAST, FREE), (0.0, 0.41, 0.59, 1.0))
    return solved(setting_of(FLOOR), structure, Guess(near))


# Direct adjoining


def test_the_multipliers_of_bryson_and_denham() -> None:
    """λ = (18, …), 0, (−18, …) of direct adjoining: atoms 18 on both sides, nothing between.

    ζ_0 is the atom that is left, ζ_1 = ∫ζ_0; π = (36, 6) where the arc begins.
    """
    dense = ceiling()
    assert dense.times == pytest.approx([0, 1 / 3, 2 / 3, 1], abs=1e-10)
    (own,) = adjoined(dense, 1).values()
    t = dense.known[1].t
    assert own.zeta[..., 0] == pytest.approx(np.full(t.shape, 18.0), abs=1e-8)
    assert own.zeta[..., 1] == pytest.approx(18 * (2 / 3 - t), abs=1e-8)
    assert own.mu == pytest.approx(np.zeros(t.shape), abs=1e-5)
    assert dense.shared("jumps") == pytest.approx([36, 6], abs=1e-8)
    found = list(atoms(dense))
    assert [(a.junction, a.held) for a in found] == [(1, (0, True)), (2, (0, True))]
    assert [a.size for a in found] == pytest.approx([18, 18], abs=1e-7)
    assert [a.rest for a in found] == pytest.approx([0, 0], abs=1e-7)


def test_the_multiplier_of_a_touch_is_its_jump() -> None:
    """x = t + a t² + b t³ to the touch at 1/2 of l = 0.2, where x' = 0: b = 4 − 16 l.

    λ₁ = u' = 6 b before it and, by symmetry, −6 b after it (λ₂ = −u, λ₂' = −λ₁).
    """
    setting = setting_of(DENHAM.replace("1/9", "0.2"))
    dense = solved(setting, Structure((FREE, FREE), (0, 0.5, 1), ((1, (0, True)),)))
    (atom,) = atoms(dense)
    assert atom.junction == 1
    assert atom.size == pytest.approx(12 * (4 - 16 * 0.2), abs=1e-8)
    assert faults(dense) == []


def test_the_multiplier_of_a_floor_is_what_the_cost_pulls_with() -> None:
    """λ = 0 on the arc and λ' = −1 − μ: μ = −1, and no atom, as u is continuous (order one)."""
    dense = floor()
    assert dense.times == pytest.approx([0, 0.4, 0.6, 1], abs=1e-10)
    (own,) = adjoined(dense, 1).values()
    assert own.mu == pytest.approx(np.full(own.mu.shape, -1.0), abs=1e-8)
    assert own.zeta[..., 0] == pytest.approx(dense.known[1].t - 0.6, abs=1e-9)
    assert [a.size for a in atoms(dense)] == pytest.approx([0, 0], abs=1e-9)


# Faults


@pytest.mark.parametrize("right", [ceiling, floor], ids=["ceiling", "floor"])
def test_nothing_speaks_against_what_is_right(right: object) -> None:
    assert callable(right)
    assert faults(right()) == []


@dataclass(frozen=True)
class Wrong:
    """A structure that is solved, with an inequality that does not hold."""

    text: str
    structure: Structure
    expected: tuple[tuple[What, float, float, float], ...]
    """What, from when to when, by how much of its size; the worst first."""
    more: tuple[tuple[str, object], ...] = ()
    """Of the worst."""


def whole(given: object) -> Structure:
    return Structure((given,), (0.0, 1.0))  # type: ignore[arg-type]


OFF = float(np.sqrt(1 - 4 / 9))
TOUCHES = Structure((FREE,) * 3, (0, 1 / 3, 2 / 3, 1), ((1, (0, True)), (2, (0, True))))
FULLER = TWO % (2, "initial: -0.5", "initial: 1", -1, 1, "x^2/2")
"""The parabola of u = −1 that comes to the origin at t = 1."""
WRONG = {
    # H_u = 1 everywhere.
    "sign": Wrong(
        ONE % (0, -1, 1, "u", ""), whole(TOP), (("sign", 0, 1, 1.0),),
        (("control", 0), ("upper", True)),
    ),
    # H_u = t − 0.3, of size 0.7.
    "sign on a part": Wrong(
        ONE % (0, -1, 1, "(t - 0.3)*u", ""), whole(BOTTOM), (("sign", 0, 0.3, 3 / 7),),
        (("control", 0), ("upper", False)),
    ),
    # From rest to rest u = 6 − 12 t, beyond ±4 by 2 of 8 at either end.
    "beyond": Wrong(
        REST, whole(FREE), (("beyond", 0, 1 / 6, 0.25), ("beyond", 5 / 6, 1, 0.25)),
    ),
    # x = t (1 − t) up to 1/4, over its range 1/4.
    "violated": Wrong(
        DENHAM, whole(FREE), (("violated", (1 - OFF) / 2, (1 + OFF) / 2, (1 / 4 - 1 / 9) * 4),),
        (("held", (0, True)), ("upper", True)),
    ),
    "rest": Wrong(
        DENHAM, TOUCHES, (("violated", 1 / 3, 2 / 3, 1.0),), (("held", (0, True)), ("phase", 1)),
    ),
    # H_u = 1/2 − t, which presses u against 1/2 once it is negative: η = t − 1/2.
    "pull": Wrong(
        ONE % (0, -1, 1, "(0.5 - t)*u", CAP), whole(HELD), (("pull", 0, 0.5, 1.0),),
        (("held", (0, True)),),
    ),
    # Away from the floor, by the cost: μ = 1 where it is to be negative.
    "pull of a state row": Wrong(
        ONE % ("0, lower: 0", -9, 9, "u^2/2 - x", ""), whole(LEAST), (("pull", 0, 1, 1.0),),
        (("held", (0, False)),),
    ),
    # σ'' = u + …: x'' = −x, which is zero for ends at zero.
    "clebsch": Wrong(
        TWO % (1, "initial: 0", "initial: 0", -1, 1, "-(x^2 + v^2)/2"), whole(SINGULAR),
        (("curvature", 0, 1, 1.0),),
    ),
    # x(1) = 1, and no more than 1/2 allowed; H_u = −1 is what it is to be.
    "end": Wrong(ONE % ("0, final: {upper: 0.5}", -1, 1, "-u", ""), whole(TOP),
                 (("end", 0, 0, 0.5),)),
    # H_u = t + 0.3 has its zero before the start.
    "vanished": Wrong(
        ONE % (0, -1, 1, "(t + 0.3)*u", ""), Structure((TOP, BOTTOM), (0, 0.1, 1)),
        (("vanished", 0, 0, 0.3),), (("phase", 0),),
    ),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_wrong_extremal_has_exactly_its_fault(wrong: Wrong) -> None:
    found = faults(solved(setting_of(wrong.text), wrong.structure))
    assert [f.what for f in found] == [what for what, *_ in wrong.expected]
    found.sort(key=lambda f: f.start)
    for given, (_, start, end, amount) in zip(found, wrong.expected, strict=True):
        # To the points that it is looked at, 24 to each of three segments of each phase.
        assert (given.start, given.end) == pytest.approx((start, end), abs=1 / 72)
        assert given.amount == pytest.approx(amount, rel=2e-3)
        assert given.sentence
    for name, value in wrong.more:
        assert getattr(found[0], name) == value


@pytest.mark.parametrize(("off", "says"), [(-20.0, "wrong sign"), (20.0, "")])
def test_an_atom_of_the_wrong_sign(off: float, says: str) -> None:
    """π_0 less than ζ_0 = 18 is an atom less than none."""
    dense = ceiling()
    place = dense.system.layout.place("jumps").start
    shared = dense.at.shared.copy()
    shared[place] += off
    found = faults(Dense(dense.system, replace(dense.at, shared=shared)))
    assert [f.what for f in found] == ["pull"] * bool(says)
    assert all(says in f.sentence for f in found)


def test_a_costate_that_jumps_by_more_than_its_row_explains() -> None:
    """π_1 other than ζ_1: an impulse of S', for which there is no multiplier."""
    dense = ceiling()
    place = dense.system.layout.place("jumps").start + 1
    shared = dense.at.shared.copy()
    shared[place] += 1.0
    found = faults(Dense(dense.system, replace(dense.at, shared=shared)))
    assert [f.what for f in found] == ["curvature"]
    assert found[0].amount == pytest.approx(1 / 36, rel=1e-3)


@pytest.mark.parametrize("sign", [-1, 1])
def test_legendre(sign: int) -> None:
    """H_uu = ±1."""
    dense = solved(setting_of(ONE % (0, -9, 9, f"{sign}*u^2/2", "")), whole(FREE))
    found = list(legendre(dense, dense.sampled(OFFSETS)))
    assert [(f.what, f.start, f.end) for f in found] == [("curvature", 0.0, 1.0)] * (sign < 0)
    assert all(f in faults(dense) for f in found)


def test_fullers_control_would_chatter() -> None:
    """Its singular arc x = v = 0 is of order two: no jump of u leads to it."""
    dense = solved(setting_of(FULLER), Structure((BOTTOM, SINGULAR), (0.0, 1.01, 2.0)))
    assert dense.times[1] == pytest.approx(1.0, abs=1e-9)
    found = [f for f in faults(dense) if f.what == "curvature"]
    assert len(found) == 1
    assert "chatter" in found[0].sentence
    assert found[0].start == pytest.approx(1.0, abs=1e-9)


def test_an_arc_of_order_one_is_jumped_to() -> None:
    """The same with v² in the cost: u = x, of order one, and u jumps to it."""
    text = FULLER.replace("x^2/2", "(x^2 + v^2)/2")
    dense = solved(setting_of(text), Structure((BOTTOM, SINGULAR), (0.0, 0.9, 2.0)))
    assert [f for f in faults(dense) if f.what == "curvature"] == []
