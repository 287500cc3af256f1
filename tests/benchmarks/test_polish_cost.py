"""What a polish costs beside the adaptive solve before it.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_polish_cost.py -s

The solve is all meshes with their checks, build, solve and certificate; the polish is all that
follows: derivation, Newton steps, the evidence and the certificate of what was found. It may take
as long.
"""

from __future__ import annotations

import time
from statistics import median

import pytest
from measuring import GUARD, show

import quito_cli as quito
from quito_cli.solvers.outcome import Progress
from quito_cli.solving.on_answer import STAGE

PROBLEMS = (
    *("van_der_pol", "bressan", "catalyst_mixing", "bang_bang", "rayleigh", "siri"),
    *("inverted_pendulum", "double_integrator_tracking", "rayleigh_mixed"),
    *("van_der_pol_state", "bryson_denham"),
)
ROUNDS = 3
LIMIT = 1.0
COLUMNS = ("problem", "solve s", "polish s", "ratio", "Newton", "segments", "residual")


def _once(name: str) -> tuple[float, float, quito.Solution]:
    """Return the seconds of the solve and of its polish, and the answer."""
    began = 0.0

    def told(progress: Progress) -> None:
        nonlocal began
        if progress.stage == STAGE:
            began = time.perf_counter()

    started = time.perf_counter()
    solution = quito.solve(name, polish=True, listener=told)
    return began - started, time.perf_counter() - began, solution


@pytest.mark.benchmark
def test_a_polish_costs_no_more_than_the_solve_before_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _once("bressan")  # imports
    rows, ratios = [list(COLUMNS)], {}
    for name in PROBLEMS:
        runs = [_once(name) for _ in range(ROUNDS)]
        direct, own = median(run[0] for run in runs), median(run[1] for run in runs)
        ratios[name] = median(own / direct for direct, own, _ in runs)
        how = runs[0][2].polishing
        assert how is not None
        figures = f"{direct:.2f}", f"{own:.3f}", f"{ratios[name]:.2f}"
        counts = str(how.newton_steps), str(how.segments), f"{how.residual:.0e}"
        rows.append([name, *figures, *counts] if how.polished else [name, *figures, "not polished"])
    rows = [row + [""] * (len(COLUMNS) - len(row)) for row in rows]
    show(capsys, f"polish over solve, limit {LIMIT}", rows)
    assert max(ratios.values()) <= GUARD * LIMIT, ratios
