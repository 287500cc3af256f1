"""What several test files share: problems, solves that are done once, and the reference answers."""

from __future__ import annotations

import gc
import json
import signal
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import run
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Model

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
Quito = Callable[..., tuple[int, str, str]]
Reference = Callable[[str], tuple[dict[str, Any], dict[str, Array]]]

REFERENCE = Path(__file__).parent / "reference"

LQ = """
title: Linear dynamics, quadratic cost
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: 0.5*(x^2 + u^2)}
"""
"""V(t, x) = tanh(1 − t) x²/2, so x = cosh(1−t)/cosh 1, u = −sinh(1−t)/cosh 1, λ = −u."""


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # begun in the background of a script, where Ctrl-C is not heard: the tests press it themselves
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def garbage_is_collected() -> Iterator[None]:
    """A command turns the collector off for good; the tests have more to come."""
    yield
    gc.unfreeze()
    gc.enable()


@pytest.fixture(scope="session")
def lq() -> str:
    """A problem with the answer x = cosh(1−t)/cosh 1, u = −sinh(1−t)/cosh 1, V = tanh(1)/2."""
    return LQ


@pytest.fixture(scope="session")
def solve() -> Solve:
    """Solve a bundled problem by name, or the text of one; the same call is done once."""

    @cache
    def solved(problem: str, options: tuple[tuple[str, Any], ...]) -> quito.Solution:
        given = load_text(problem, "test.yaml") if "\n" in problem else problem
        return quito.solve(given, **dict(options))

    return lambda problem, **options: solved(problem, tuple(sorted(options.items())))


@pytest.fixture
def quito_(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Quito:
    """Run a command in an empty folder; return its exit code and what it printed."""
    monkeypatch.chdir(tmp_path)

    def ran(*arguments: str) -> tuple[int, str, str]:
        capfd.readouterr()
        code = run(list(arguments), monkeypatch)
        printed = capfd.readouterr()
        assert "Traceback" not in printed.err
        return code, printed.out, printed.err

    return ran


@pytest.fixture(scope="session")
def model() -> Callable[[str], Model]:
    """Build the Model of a bundled problem, or of the text of one."""
    return lambda problem: build(
        load_text(problem, "test.yaml") if "\n" in problem else quito.load(problem)
    )


@pytest.fixture(scope="session")
def reference() -> Reference:
    """Return the verified answer of a bundled problem: facts, and t, x, u at 201 uniform points."""

    def read(name: str) -> tuple[dict[str, Any], dict[str, Array]]:
        facts = json.loads((REFERENCE / f"{name}.json").read_text(encoding="utf-8"))
        with np.load(REFERENCE / f"{name}.npz") as samples:
            return facts, {key: samples[key] for key in samples}

    return read
