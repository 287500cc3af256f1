"""A problem with everything free against a small fixed one: the price of the whole language.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_language_speed.py

A rocket ascent (Goddard's, in the units of Betts: free final time, named expressions, three states,
`sense: maximize`) is built as often as Van der Pol, in turn, from a problem already read to a
program that a solver can take: Model, transcription, derivatives. Free times and parameters keep
the exact derivatives cell by cell, so that the limit this project set itself is three times Van der
Pol, at 1 000 cells each.
"""

from __future__ import annotations

from statistics import median

import pytest
from measuring import GUARD, interleaved, median_ratio, show

import quito_cli as quito
from quito_cli.problem.load import load_text
from quito_cli.problem.schema import Problem

STEPS = 1000
ROUNDS = 15
LIMIT = 3.0
VARIANCE = 2.0
GODDARD = """\
title: Goddard rocket
constants: {Dc: 310, hc: 500, c: 0.5, g0: 1}
time: {initial: 0, final: {lower: 0.05, upper: 1, guess: 0.2}}
states:
  h: {initial: 1, lower: 1}
  v: {initial: 0, lower: 0}
  m: {initial: 1, lower: 0.6, upper: 1, final: 0.6}
controls:
  T: {lower: 0, upper: 3.5}
expressions:
  D: Dc*v^2*exp(-hc*(h - 1))
  g: g0/h^2
dynamics:
  h: v
  v: (T - D)/m - g
  m: -T/c
sense: maximize
cost: {mayer: h}
"""


@pytest.fixture(scope="module")
def rocket() -> Problem:
    return load_text(GODDARD, "goddard.yaml")


def _built(problem: Problem) -> tuple[float, float]:
    """Return the seconds of a build, and of a single iteration with its first evaluations."""
    took = quito.solve(problem, steps=STEPS, variance=VARIANCE, max_iterations=1).statistics
    return took.build_seconds, took.solve_seconds


@pytest.mark.benchmark
def test_building_a_rocket_ascent(rocket: Problem, capsys: pytest.CaptureFixture[str]) -> None:
    """Ratio of the build of a rocket ascent to that of Van der Pol, run by run in turn."""
    oscillator = quito.load("van_der_pol")
    pairs = interleaved(lambda: _built(rocket), lambda: _built(oscillator), ROUNDS)
    ratio = median_ratio([(ours[0], theirs[0]) for ours, theirs in pairs])
    first = median_ratio([(sum(ours), sum(theirs)) for ours, theirs in pairs])
    rows = [["", "build ms", "one iteration ms"]]
    for i, name in enumerate(("rocket ascent, free final time", "van_der_pol")):
        rows.append([name, *(f"{1e3 * median(pair[i][j] for pair in pairs):.1f}" for j in (0, 1))])
    title = (
        f"rocket ascent with {STEPS} cells against van_der_pol: build ratio {ratio:.2f} "
        f"(limit {LIMIT:g}); with the first iteration {first:.2f}"
    )
    show(capsys, title, rows)
    assert ratio <= GUARD * LIMIT


@pytest.mark.benchmark
def test_the_rocket_that_is_built_is_one_that_flies(rocket: Problem) -> None:
    """What is timed is the problem meant: it has a solution, and the altitude known for it."""
    solution = quito.solve(rocket, steps=100)
    assert solution.success
    assert solution.cost == pytest.approx(1.01284, abs=2e-4)
