"""The parts of the polish: its collocation, its least squares, its structures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.gauss import gauss
from quito_cli.optimality.polish.equations.structure import Phase, Structure
from quito_cli.optimality.polish.solving.chain import Chain, Links, Rows, solved

Array = NDArray[np.float64]


@pytest.mark.parametrize("stages", [1, 2, 3, 5, 10])
def test_gauss_integrates_polynomials_to_their_degrees(stages: int) -> None:
    """Weights to degree 2s − 1, rows of the matrix to degree s − 1 (Butcher 1964)."""
    method = gauss(stages)
    for k in range(2 * stages):
        assert method.weights @ method.points**k == pytest.approx(1 / (k + 1), abs=1e-14)
    for k in range(stages):
        whole = method.points ** (k + 1) / (k + 1)
        np.testing.assert_allclose(method.matrix @ method.points**k, whole, atol=1e-14)


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_gauss_has_twice_its_stages_as_order(stages: int) -> None:
    """On y' = i y, whose solution has size one."""
    method, errors = gauss(stages), []
    for steps in (4, 8):
        h = 1 / steps
        inner = np.linalg.solve(np.eye(stages) - 1j * h * method.matrix, np.ones(stages))
        errors.append(abs((1 + 1j * h * method.weights @ inner) ** steps - np.exp(1j)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * stages, abs=0.2)


def dense(chain: Chain) -> tuple[Array, Array]:
    """The whole matrix of a chain and its right-hand side."""
    links = chain.links
    count, n, m = links.shared.shape
    blocks, right = [], []
    for a in range(count + 1):
        own = np.zeros((len(chain.own[a].right), (count + 1) * n + m))
        own[:, a * n : (a + 1) * n] = chain.own[a].here
        own[:, (count + 1) * n :] = chain.own[a].shared
        blocks.append(own)
        right.append(chain.own[a].right)
    for a in range(count):
        link = np.zeros((n, (count + 1) * n + m))
        link[:, a * n : (a + 1) * n] = -links.matrix[a]
        link[:, (a + 1) * n : (a + 2) * n] = np.eye(n)
        link[:, (count + 1) * n :] = -links.shared[a]
        blocks.append(link)
        right.append(links.right[a])
    return np.vstack(blocks), np.concatenate(right)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 3), st.integers(1, 3))
def test_a_chain_is_solved_in_the_least_squares_sense(
    seed: int, count: int, n: int, m: int
) -> None:
    """More rows than unknowns, and none of them met: as the dense solution has it."""
    random = np.random.default_rng(seed)
    own = [
        Rows(
            random.normal(size=(n + m, n)),
            random.normal(size=(n + m, m)),
            random.normal(size=n + m),
        )
        for _ in range(count + 1)
    ]
    links = Links(*(random.normal(size=(count, n, *s)) for s in ((n,), (m,), ())))
    chain = Chain(own, links)
    found = solved(chain)
    expected = np.linalg.lstsq(*dense(chain), rcond=None)[0]
    whole = np.concatenate([found.nodes.ravel(), found.shared])
    np.testing.assert_allclose(whole, expected, atol=1e-8, rtol=1e-8)


def test_modes_that_grow_and_decay_do_no_harm() -> None:
    """A boundary value problem with e^30 and e^-30 in it: each mode known at its quiet end."""
    step = np.diag([np.exp(1.0), np.exp(-1.0)])
    links = Links(np.tile(step, (30, 1, 1)), np.zeros((30, 2, 1)), np.zeros((30, 2)))
    nothing = Rows(np.zeros((0, 2)), np.zeros((0, 1)), np.zeros(0))
    first = Rows(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([1.0, 3.0]))
    last = Rows(np.array([[1.0, 0.0]]), np.zeros((1, 1)), np.array([1.0]))
    found = solved(Chain([first, *[nothing] * 29, last], links))
    t = np.arange(31.0)
    np.testing.assert_allclose(found.nodes[:, 0], np.exp(t - 30), rtol=1e-10)
    np.testing.assert_allclose(found.nodes[:, 1], np.exp(-t), rtol=1e-10)
    assert found.shared == pytest.approx([3.0])


def test_what_no_row_determines_has_no_singular_value() -> None:
    links = Links(np.eye(1)[None], np.zeros((1, 1, 1)), np.zeros((1, 1)))
    nothing = Rows(np.zeros((0, 1)), np.zeros((0, 1)), np.zeros(0))
    first = Rows(np.eye(1), np.zeros((1, 1)), np.ones(1))
    found = solved(Chain([first, nothing], links))
    assert found.singular_values[-1] == 0
    assert abs(found.weakest[0]) == pytest.approx(1)
    assert found.nodes.ravel() == pytest.approx([1, 1])


LOW, HIGH = Phase(("lower",), frozenset()), Phase(("upper",), frozenset())
HELD = (0, True)
TIMES = st.floats(0.01, 0.99).filter(lambda t: t != 0.5)


@given(TIMES)
def test_what_is_cut_merges_to_what_it_was(time: float) -> None:
    whole = Structure((LOW, HIGH), (0.0, 0.5, 1.0), ((1, HELD),))
    cut, k = whole.cut(time)
    assert cut.times[k] == time
    assert cut.times == tuple(sorted(cut.times))
    assert [cut.times[at] for at, _ in cut.touches] == [0.5]
    assert cut.merged() == whole


@given(TIMES, TIMES)
def test_a_change_is_where_it_was_asked_for(one: float, other: float) -> None:
    start, end = sorted((one, other))
    if end - start < 1e-12:  # the middle may be one of them
        return
    changed = Structure((LOW,), (0.0, 1.0)).changed(start, end, lambda _: HIGH)
    assert changed.phase_at((start + end) / 2) == 1
    assert changed.phases == (LOW, HIGH, LOW)
    assert changed.times == (0.0, start, end, 1.0)


def test_a_touch_keeps_equal_phases_apart() -> None:
    touched = Structure((LOW,), (0.0, 1.0)).touched(0.3, HELD)
    assert touched.merged() == touched
    assert touched.without(1, (LOW,)) == Structure((LOW,), (0.0, 1.0))
