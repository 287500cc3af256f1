"""What a mesh that follows the control is worth.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_mesh.py -s

First a table: adaptive solves with default options, held against the references of the files, and
their time over that of a uniform solve of 100 cells. Then the error of the control of the Van der
Pol oscillator over nodes and over seconds, uniform and adaptive, with LGR collocation beside them;
the figure of the README is drawn of that: adaptive solves of 1 to 8 meshes and their check.
Processor time, the best of three.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.model import Known, Model

Array = NDArray[np.float64]

pytestmark = pytest.mark.benchmark
FIGURE = Path(__file__).parents[2] / "problems" / "mesh.svg"
PROBLEMS = ("van_der_pol", "bressan", "bang_bang", "siri", "catalyst_mixing")
SMOOTH = ("alychan", "brachistochrone", "orbit_transfer", "hanging_chain")
COSTS = ("rayleigh", "van_der_pol_state", "double_integrator_tracking", "inverted_pendulum")
RUNS = 3


def timed(solve: Callable[[], quito.Solution]) -> tuple[quito.Solution, float]:
    """Solve a few times; the least processor time."""
    seconds = []
    for _ in range(RUNS):
        started = time.process_time()
        solution = solve()
        seconds.append(time.process_time() - started)
    return solution, min(seconds)


def errors(model: Model, solution: quito.Solution) -> tuple[float, float]:
    """L² and, outside ±0.1 % of the horizon, uniform error of the controls over their range."""
    assert model.known is not None
    ends = np.unique(np.concatenate([solution.times, model.known.switching_times]))
    h = np.diff(ends)
    points, weights = np.polynomial.legendre.leggauss(6)
    times = (ends[:-1, None] + h[:, None] * (1 + points) / 2).ravel()
    u = Known.sample(model.known.controls, model.controls, times)
    error = np.abs(solution.control(times) - u) / np.ptp(u, axis=0)
    horizon = float(solution.times[-1] - solution.times[0])
    squares = (h[:, None] * weights / 2).ravel()[:, None] * error**2
    far = np.ones(len(times), dtype=bool)
    for switch in model.known.switching_times:
        far &= np.abs(times - switch) > 1e-3 * horizon
    l2 = np.sqrt(squares.sum(axis=0) / horizon).max()
    return float(l2), float(error[far].max())


def test_adaptive_solves() -> None:
    print("\n| problem | cells | solves | L² | sup | switching | variation | estimate | time |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in PROBLEMS + COSTS + SMOOTH:
        problem = quito.load(name)
        model = build(problem)
        known = model.known
        assert known is not None
        _, base = timed(partial(quito.solve, problem, steps=100))
        solution, seconds = timed(partial(quito.solve, problem, mesh="adaptive"))
        refinement = solution.refinement
        assert refinement is not None
        horizon = float(solution.times[-1] - solution.times[0])
        l2 = sup = variation = np.nan
        if known.controls:
            l2, sup = errors(model, solution)
            u = Known.sample(known.controls, model.controls, solution.dense_times)
            exact = np.abs(np.diff(u, axis=0)).sum(axis=0)
            variation = float((np.array(solution.evidence.total_variation) / exact).max())
        missed = [
            min((abs(t - s) for s in solution.switching_times), default=np.inf) / horizon
            for t in known.switching_times
        ]
        estimate = refinement.account.control if refinement.account else np.nan
        print(
            f"| {name} | {len(solution.times) - 1} | {len(refinement.rounds) + 1} | {l2:.1e} | "
            f"{sup:.1e} | {max(missed, default=np.nan):.1e} | {variation:.3f} | {estimate:.1e} | "
            f"{seconds / base:.1f} |"
        )


def test_error_over_nodes_and_seconds() -> None:
    problem = quito.load("van_der_pol")
    model = build(problem)
    rows: dict[str, list[tuple[int, float, float]]] = {}
    for steps in (50, 100, 200, 400, 800, 1600, 3200):
        solution, seconds = timed(partial(quito.solve, problem, steps=steps))
        rows.setdefault("uniform", []).append((steps, seconds, errors(model, solution)[0]))
    for meshes in (1, 2, 3, 4, 5, 6, 8):
        solution, seconds = timed(
            partial(quito.solve, problem, mesh="adaptive", mesh_iterations=meshes)
        )
        cells = len(solution.times) - 1
        rows.setdefault("adaptive", []).append((cells, seconds, errors(model, solution)[0]))
    for intervals in (12, 25, 50, 100, 200, 400):
        solution, seconds = timed(
            partial(quito.solve, problem, discretization="lgr", degree=4, steps=intervals)
        )
        rows.setdefault("LGR, degree 4", []).append(
            (4 * intervals, seconds, errors(model, solution)[0])
        )
    for name, found in rows.items():
        for nodes, seconds, error in found:
            print(f"{name:15} {nodes:5d} nodes  {seconds:7.3f} s  {error:.2e}")
    draw(rows)


def draw(rows: dict[str, list[tuple[int, float, float]]]) -> None:
    """Write the figure of the README."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from quito_cli.plots.figure import write
    from quito_cli.plots.palette import COLOURS

    drawn = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = drawn.subplots(1, 2, sharey=True)
    for (name, found), colour, marker in zip(rows.items(), COLOURS, "os^", strict=False):
        for axes, column in ((left, 0), (right, 1)):
            axes.loglog(
                [row[column] for row in found],
                [row[2] for row in found],
                marker=marker,
                color=colour,
                label=name,
            )
    left.set_xlabel("control cells, or points of a collocation")
    right.set_xlabel("seconds of processor time, imports apart")
    left.set_ylabel("L² error of u over its range")
    for axes in (left, right):
        axes.grid(alpha=0.25, which="both")
    left.legend(frameon=False)
    drawn.suptitle("Van der Pol oscillator with bounded control: bang, bang, singular")
    with rc_context({"svg.fonttype": "none"}):
        write(drawn, FIGURE)
