"""What each option is worth on the library: discretizations and generating functions.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_choices.py

Every bundled problem but `auv_fleet` (which alone takes longer than all others), with its own
options but for those compared and N = 100. Errors of the cost are relative, those of the control
are root mean squares over the horizon relative to its range, both against the references in the
files and in tests/reference; medians over the problems that have one. A smeared jump dominates the
control's error, as it should: it is what a user sees. Tables are printed as Markdown.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import casadi as ca
import numpy as np
import pytest

import quito_cli as quito
from quito_cli.problem.library import bundled
from quito_cli.transcription.generating import QUASI_INTERPOLANTS
from quito_cli.transcription.schemes import SCHEMES

REFERENCE = Path(__file__).parents[1] / "reference"
PROBLEMS = tuple(name for name in bundled() if name != "auv_fleet")
STEPS = 100
MOST_ITERATIONS = 400


@dataclass(frozen=True)
class Run:
    """One solve."""

    success: bool
    iterations: int | None
    seconds: float
    cost_error: float | None
    control_error: float | None


def run(name: str, **options: Any) -> Run:
    """Solve a bundled problem and hold it against what is known of it."""
    problem = quito.load(name)
    started = time.process_time()
    solution = quito.solve(problem, steps=STEPS, max_iterations=MOST_ITERATIONS, **options)
    seconds = time.process_time() - started
    known = solution.reference
    cost = None if known is None or known.cost is None else known.cost
    return Run(
        solution.success,
        solution.statistics.iterations,
        seconds,
        None if cost is None else abs(solution.cost - cost) / max(1.0, abs(cost)),
        _control_error(name, solution),
    )


def _control_error(name: str, solution: quito.Solution) -> float | None:
    """Return the largest root mean square among the controls, over the control's range."""
    known, times = solution.reference, solution.dense_times
    if known is not None and np.isfinite(known.controls).all():
        exact = known.controls
    elif (REFERENCE / f"{name}.npz").is_file():
        with np.load(REFERENCE / f"{name}.npz") as samples:
            times, exact = samples["t"], samples["u"].reshape(len(samples["t"]), -1)
    else:
        return None
    error = np.sqrt(np.mean((solution.control(times) - exact) ** 2, axis=0))
    return float((error / np.maximum(np.ptp(exact, axis=0), 1e-12)).max())


def summary(label: str, runs: Sequence[Run], against: float) -> list[str]:
    """Return a row of a table: medians over the problems that were solved."""
    good = [r for r in runs if r.success]

    def middle(values: Iterable[float | None], form: str) -> str:
        known = [v for v in values if v is not None]
        return format(median(known), form) if known else "-"

    return [
        label,
        f"{len(good)}/{len(runs)}",
        middle((r.iterations for r in good), ".0f"),
        f"{sum(r.seconds for r in runs) / against:.2f}",
        middle((r.cost_error for r in good), ".1e"),
        middle((r.control_error for r in good), ".1e"),
    ]


HEADINGS = ["", "solved", "iterations", "time", "cost error", "control error"]


def markdown(capsys: pytest.CaptureFixture[str], title: str, rows: list[list[str]]) -> None:
    """Print a table that a Markdown page can take as it is."""
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    with capsys.disabled():
        print(f"\n\n{title} (quito {quito.__version__}, CasADi {ca.CasadiMeta.version()})\n")
        print("\n".join(f"| {' | '.join(line)} |" for line in lines))


@pytest.mark.benchmark
@pytest.mark.filterwarnings("ignore")
def test_discretizations_and_generating_functions(capsys: pytest.CaptureFixture[str]) -> None:
    """A row for each pair, times relative to rk4 with the gaussian."""
    pairs = [(scheme, function) for scheme in SCHEMES for function in QUASI_INTERPOLANTS]
    runs = {
        (scheme, function): [
            run(name, discretization=scheme, generating_function=function, variance=2.5)
            for name in PROBLEMS
        ]
        for scheme, function in pairs
    }
    against = sum(r.seconds for r in runs["rk4", "gaussian"])
    rows = [summary(f"{s}, {f}", runs[s, f], against) for s, f in pairs]
    markdown(capsys, f"{len(PROBLEMS)} problems, N = {STEPS}, variance 2.5", [HEADINGS, *rows])
    assert all(r.success for r in runs["rk4", "gaussian"])


@pytest.mark.benchmark
@pytest.mark.filterwarnings("ignore")
def test_substeps_and_controls(capsys: pytest.CaptureFixture[str]) -> None:
    """What further substeps buy, and what the classical controls give."""
    choices: dict[str, dict[str, Any]] = {
        f"rk4, {n} substeps": {"substeps": n, "variance": 2.0} for n in (1, 2, 4)
    }
    choices |= {f"variance {d:g}": {"variance": d} for d in (0.7, 1.0, 2.0, 4.0)}
    classical = ("piecewise-constant", "piecewise-linear")
    choices |= {control: {"control": control} for control in classical}
    runs = {
        label: [run(name, **options) for name in PROBLEMS] for label, options in choices.items()
    }
    against = sum(r.seconds for r in runs["rk4, 2 substeps"])
    rows = [summary(label, found, against) for label, found in runs.items()]
    markdown(capsys, f"{len(PROBLEMS)} problems, N = {STEPS}", [HEADINGS, *rows])
