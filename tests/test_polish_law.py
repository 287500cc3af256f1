"""The law of a phase and its collocation: what theory has, what differences and DOP853 have."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from polish_cases import CASES, HEAD, REGULAR, Case
from polish_parts import ends_of, phase, setting_of
from scipy.integrate import solve_ivp

from quito_cli.optimality.polish.equations.gauss import gauss
from quito_cli.optimality.polish.equations.structure import Structure
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Segments
from quito_cli.optimality.polish.solving.flow import Linearised, linearised

Array = NDArray[np.float64]

everywhere = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


def points(case: Case, count: int = 12) -> tuple[Array, Array]:
    """Random (x, v, λ₁, λ₂, t, p, ν), and a guess of z."""
    v = np.random.default_rng(7).uniform(0.2, 0.9, (count, 7))
    return v, np.tile(case.guess, (count, 1))


def differences(value: Callable[[Array], Array], v: Array, h: float = 1e-5) -> Array:
    """Central differences in each column of (n, columns); (n, size, columns)."""
    steps = np.eye(v.shape[1]) * h
    return np.stack([(value(v + s) - value(v - s)) / (2 * h) for s in steps], axis=2)


@everywhere
def test_controls_and_multipliers_are_those_of_theory(case: Case) -> None:
    v, guess = points(case)
    expected = [case.z(*one) for one in v]
    np.testing.assert_allclose(case.law.settled(v, guess).z, expected, atol=1e-10, rtol=1e-10)


@everywhere
def test_their_derivatives_are_those_of_theory_by_differences(case: Case) -> None:
    v, guess = points(case)

    def theory(at: Array) -> Array:
        return np.array([case.z(*one) for one in at])

    slopes = differences(theory, v)
    np.testing.assert_allclose(case.law.settled(v, guess).by_v, slopes, atol=1e-6, rtol=1e-6)


@everywhere
def test_the_flow_is_that_of_theory_with_its_derivatives(case: Case) -> None:
    """x' = f, λ' = −(H + ηᵀC)_x at fixed u and η, q and (H + ηᵀC)_p; then z moves with all."""
    v, guess = points(case)
    found = case.law.values(v, guess)
    np.testing.assert_allclose(found.rates, [case.rates(one) for one in v], atol=1e-8, rtol=1e-8)

    def rates(at: Array) -> Array:
        return case.law.values(at, guess).rates

    np.testing.assert_allclose(found.slopes, differences(rates, v), atol=1e-6, rtol=1e-6)


def test_what_has_no_value_is_said() -> None:
    """η of u³ = x has none where x is zero: the row says nothing of u there."""
    text = HEAD % ("", "u", "u", -9, "", "v") + "  path: {cube: u^3 == x}\n"
    law = setting_of(text).law(phase("free", held=[(0, False)]))
    v, guess = points(REGULAR)
    v[:, 0] = 0.0
    assert np.isnan(law.settled(v, np.tile([0.1, 0.0], (len(guess), 1))).z).all()


@pytest.mark.parametrize("sign", [1, -1])
def test_clebsch_has_the_sign_of_theory(sign: int) -> None:
    """σ = λ₂, σ'' = ∓u + … where the squares are added to the cost or taken from it: −A = ±1."""
    text = HEAD % ("", "u + p", f"{sign}*(x^2 + v^2)/2", -9, "", "x")
    law = setting_of(text).law(phase("singular"))
    assert law.clebsch is not None
    given = np.ones(2), np.ones(2), [0.5], [0.0], 0.0, np.zeros(0), [0.0]
    assert float(law.clebsch(*given)) == pytest.approx(sign)


# A segment


@cache
def system_of(case: Case) -> System:
    """Its phase over the whole horizon, from 0.1 to 0.9."""
    setting = setting_of(case.text)
    structure = Structure((case.phase,), (0.1, 0.9))
    return System(setting, structure, ends_of(setting), gauss(8))


FRACTIONS = np.array([0.0, 0.4, 1.0])
START = np.array([0.6, 0.3, 0.7, 0.4])
SHARED: dict[str, float] = {"start": 0.1, "end": 0.9, "p": 0.5, "nu": 0.3}


def eliminated(case: Case) -> Linearised:
    """Two segments, both from `START`, with stages iterated until their equations are met."""
    system = system_of(case)
    layout, method = system.layout, system.method
    g = np.zeros(layout.count)
    g[layout.place("times")] = SHARED["start"], SHARED["end"]
    g[layout.place("parameters")], g[layout.place("integral")] = SHARED["p"], SHARED["nu"]
    nodes = np.zeros((3, layout.size))
    nodes[:, :4] = START
    inner = np.tile(case.guess, (2, len(method.points), 1))
    ends = np.array(case.guess)
    stages = np.tile(START, (2, len(method.points), 1))
    for _ in range(12):
        segments = Segments(FRACTIONS, nodes, stages, inner, ends, ends)
        found = linearised(case.law, segments, g, layout, 0, method)
        stages = stages + found.stage_steps.reshape(stages.shape)
    assert np.abs(found.residuals).max() < 1e-13
    return found


def integrated(case: Case, k: int, start: Array, shared: Array) -> Array:
    """Segment k by DOP853 of what was written by hand; shared as `SHARED`."""
    first, last, p, nu = shared
    times = first + FRACTIONS[k : k + 2] * (last - first)

    def rates(t: float, y: Array) -> Array:
        return case.rates(np.array([*y[:4], t, p, nu]))

    y = np.concatenate([start, np.zeros(2)])
    return np.asarray(solve_ivp(rates, times, y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1])


@everywhere
def test_a_segment_ends_where_another_integrator_does(case: Case) -> None:
    found, shared = eliminated(case), np.array(list(SHARED.values()))
    for k in range(2):
        expected = integrated(case, k, START, shared)
        np.testing.assert_allclose(found.ends[k], expected, atol=1e-8, rtol=1e-8)


@everywhere
def test_its_end_moves_as_differences_of_another_integrator_do(case: Case) -> None:
    """By where it starts, by both times of its phase, by the parameter and the multiplier."""
    found, shared = eliminated(case), np.array(list(SHARED.values()))
    layout = system_of(case).layout
    times, p, nu = (layout.entries(part) for part in ("times", "parameters", "integral"))
    local = np.concatenate([times, p, nu])
    for k in range(2):

        def end(v: Array, k: int = k) -> Array:
            return np.array([integrated(case, k, one[:4], one[4:]) for one in v])

        slopes = differences(end, np.concatenate([START, shared])[None], 1e-4)[0]
        assert found.by_start[k, :, :4] == pytest.approx(slopes[:, :4], abs=3e-6, rel=3e-6)
        assert found.by_shared[k][:, local] == pytest.approx(slopes[:, 4:], abs=3e-6, rel=3e-6)
        np.testing.assert_array_equal(found.by_start[k, :, 4:], np.eye(6)[:, 4:])
