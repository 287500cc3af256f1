"""What a certificate costs beside the solve that it certifies, with 300 cells.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_certificate_cost.py

The solve is build and solve, as `solution.statistics` has them; the certificate is all of
`certify`, derivation included, from a Model on which nothing has been derived before. It may take
half as long.
"""

from __future__ import annotations

import time
from statistics import median

import pytest
from measuring import GUARD, show

import quito_cli as quito
from quito_cli.optimality.certificate.certificate import certify
from quito_cli.problem.build import build

ROUNDS = 9
LIMIT = 0.5


def _once(name: str) -> tuple[float, float]:
    """Return the seconds of a solve and of its certificate."""
    problem = quito.load(name)
    statistics = (solution := quito.solve(problem, steps=300)).statistics
    model = build(quito.load(name))
    started = time.perf_counter()
    certify(model, solution)
    return statistics.build_seconds + statistics.solve_seconds, time.perf_counter() - started


@pytest.mark.benchmark
@pytest.mark.parametrize("name", ["van_der_pol", "siri", "rayleigh"])
def test_a_certificate_costs_half_of_the_solve(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _once(name)
    pairs = [_once(name) for _ in range(ROUNDS)]
    ratio = median(own / solve for solve, own in pairs)
    rows = [["solve ms", "certificate ms"]]
    rows.append([f"{1e3 * median(column):.1f}" for column in zip(*pairs, strict=True)])
    show(capsys, f"{name}, 300 cells: ratio {ratio:.2f} (limit {LIMIT})", rows)
    assert ratio <= GUARD * LIMIT
