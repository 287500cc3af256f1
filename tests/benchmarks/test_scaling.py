"""Van der Pol from 1 000 to 20 000 cells: time a node, iterations, and peak memory.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_scaling.py

Every size is solved in a process of its own, so that its peak memory is its own. The limits are
those this project set itself: time a node grows by a factor of two at most, and memory stays under
1.5 GB. Time an iteration is shown too: it is what the linear algebra costs, whereas the number of
iterations belongs to the problem.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest
from measuring import GUARD, process_output, show

SIZES = (1000, 2000, 5000, 10_000, 20_000)
GROWTH = 2.0
"""Of time a node, at most."""
MEMORY = 1.5e9
"""Bytes at most."""
MICRO = 1e6
REPEATED_UNDER = 5000
"""Sizes below are solved several times, the fastest of which counts: they are too quick for one."""

SOLVE = """
import json, resource, sys, time
from pathlib import Path
import quito_cli as quito

steps, times = int(sys.argv[1]), int(sys.argv[2])
problem = quito.load("van_der_pol")
quito.solve(problem, steps=20, variance=2)  # loads the libraries
wholes, sums = [], []
for _ in range(times):
    started = time.perf_counter()
    solution = quito.solve(problem, steps=steps, variance=2)
    wholes.append(time.perf_counter() - started)
    took = solution.statistics
    sums.append(took.build_seconds + took.solve_seconds)
status = Path("/proc/self/status")
if status.exists():  # getrusage of a child counts the parent's memory at the fork too
    peak = next(int(l.split()[1]) for l in status.open() if l.startswith("VmHWM")) * 1024
else:
    unit = 1 if sys.platform == "darwin" else 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
print(json.dumps({"seconds": min(sums), "whole": min(wholes), "peak": peak,
                  "iterations": took.iterations, "success": solution.success}))
"""


@dataclass(frozen=True)
class Figures:
    """Of one size."""

    steps: int
    seconds: float
    """Build and solve."""
    whole: float
    """The whole call, evidence and all."""
    iterations: int
    peak: int
    """Bytes of memory."""
    success: bool


def _measured(steps: int) -> Figures:
    times = 3 if steps < REPEATED_UNDER else 1
    return Figures(steps=steps, **json.loads(process_output("-c", SOLVE, str(steps), str(times))))


def _rows(figures: list[Figures]) -> list[list[str]]:
    rows = [["cells", "µs/node", "whole call", "iterations", "µs/node/iteration", "peak MB"]]
    for f in figures:
        node = MICRO * f.seconds / f.steps
        whole = MICRO * f.whole / f.steps
        rows.append(
            [
                str(f.steps),
                f"{node:.0f}",
                f"{whole:.0f}",
                str(f.iterations),
                f"{node / f.iterations:.1f}",
                f"{f.peak / 1e6:.0f}",
            ]
        )
    return rows


def _growth(times: list[float], figures: list[Figures]) -> float:
    """Return the largest time a node over the smallest: one slow run cannot hide growth."""
    by_node = [t / f.steps for t, f in zip(times, figures, strict=True)]
    return max(by_node) / min(by_node)


@pytest.mark.benchmark
def test_van_der_pol_to_twenty_thousand_cells(capsys: pytest.CaptureFixture[str]) -> None:
    """Largest over smallest time a node, from 1 000 cells on, and the largest peak memory."""
    figures = [_measured(steps) for steps in SIZES]
    growth = _growth([f.seconds for f in figures], figures)
    whole = _growth([f.whole for f in figures], figures)
    by_iteration = _growth([f.seconds / f.iterations for f in figures], figures)
    title = (
        f"van_der_pol: time a node grows by {growth:.2f} (limit {GROWTH}), "
        f"of the whole call by {whole:.2f}, of an iteration by {by_iteration:.2f}"
    )
    show(capsys, title, _rows(figures))
    assert all(f.success for f in figures)
    assert growth <= GUARD * GROWTH
    assert max(f.peak for f in figures) < MEMORY
