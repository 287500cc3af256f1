"""The equations of the polish about a point: derivatives against differences, Newton's steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.optimality.hamiltonian import pontryagin
from quito_cli.optimality.looking.look import Look
from quito_cli.optimality.polish.equations.gauss import gauss
from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.system import System
from quito_cli.optimality.polish.equations.unknowns import Unknowns
from quito_cli.optimality.polish.reading.direct import Direct
from quito_cli.optimality.polish.reading.ends_held import ends_held
from quito_cli.optimality.polish.reading.shown import shown
from quito_cli.optimality.polish.solving.assembly import assembled
from quito_cli.optimality.polish.solving.newton import iterate
from quito_cli.optimality.polish.solving.start import started
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text

SLIDE = """\
title: A parameter, a free end, a budget, a gate and an end condition
time: {initial: 0, final: {lower: 0.5, upper: 9, guess: 2}}
states: {x: {initial: 0}, v: {initial: 0}}
controls: {u: {}}
parameters: {p: {lower: -5, upper: 5}}
dynamics: {x: v + p, v: u - 0.1*x^2}
cost: {lagrange: 1 + u^2/2, mayer: p^2/2}
constraints:
  boundary: {there: final(x) + final(v)^2 >= 1.5}
  integral: {budget: v^2 <= 0.9}
  point: {gate: {at: 0.5, holds: x*(1 + t) >= 0.7}}
"""


@pytest.fixture(scope="module")
def problem() -> tuple[System, Direct]:
    given = load_text(SLIDE, "slide.yaml")
    solution = quito.solve(given, steps=30)
    setting = Setting(pontryagin(build(given)))
    direct = Direct(setting, solution, Look.at(setting.system, solution))
    structure = shown(setting, solution, direct.impulses, None, tied=False)
    return System(setting, structure, ends_held(direct, structure), gauss(4)), direct


def test_rows_have_the_derivatives_that_differences_have(problem: tuple[System, Direct]) -> None:
    """In all that is shared: times, parameter, multipliers, jumps, energies."""
    system, direct = problem
    at, h = started(direct, system), 1e-6

    def residuals(point: Unknowns) -> list[NDArray[np.float64]]:
        return [-rows.right for rows in assembled(system, point).chain.own]

    rows = assembled(system, at).chain.own
    for entry in range(system.layout.count):
        step = np.zeros(system.layout.count)
        step[entry] = h
        ahead, back = (residuals(replace(at, shared=at.shared + s)) for s in (step, -step))
        for own, after, before in zip(rows, ahead, back, strict=True):
            slope = (after - before) / (2 * h)
            np.testing.assert_allclose(own.shared[:, entry], slope, atol=1e-6, rtol=1e-6)


def test_newton_ends_quadratically(problem: tuple[System, Direct]) -> None:
    system, direct = problem
    found = iterate(system, started(direct, system), direct.scales(system.layout))
    assert found.converged
    assert len(found.residuals) <= 8
    assert found.residuals[-1] <= 1e-10
