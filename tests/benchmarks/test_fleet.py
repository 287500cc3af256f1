"""A large cell: the price of the second substep of `auv_fleet`, 18 states and 18 controls.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_fleet.py

The local Hessian of a cell of two substeps is what costs: 126 inputs, coupled through the states
inside the cell. The limit is four times the build with one substep.
"""

from __future__ import annotations

from statistics import median

import pytest
from measuring import GUARD, interleaved, median_ratio, show

import quito_cli as quito

ROUNDS = 5
LIMIT = 4.0


def _built(substeps: int) -> float:
    """Return the seconds of a build."""
    solved = quito.solve("auv_fleet", substeps=substeps, max_iterations=0)
    return solved.statistics.build_seconds


@pytest.mark.benchmark
def test_building_a_fleet(capsys: pytest.CaptureFixture[str]) -> None:
    """Ratio of the build with two substeps a cell to that with one, run by run in turn."""
    pairs = interleaved(lambda: _built(2), lambda: _built(1), ROUNDS)
    ratio = median_ratio(pairs)
    rows = [["substeps", "build s"]]
    rows += [[str(2 - i), f"{median(pair[i] for pair in pairs):.2f}"] for i in (0, 1)]
    show(capsys, f"auv_fleet: build ratio {ratio:.2f} (limit {LIMIT:g})", rows)
    assert ratio <= GUARD * LIMIT
