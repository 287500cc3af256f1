"""Build plus solve against a hand-written CasADi script, and against the way of QuITO 1.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_speed.py

Ours is the library on a problem already read: model, transcription, `nlpsol` and solve, as
`solution.statistics` has them, with the options of the problem file. The whole call, with options
checked, residuals judged, the control re-simulated and all evidence gathered, is shown beside it.
The baselines and their sources are in `baselines`; a script has no file to read and gathers no
evidence. The limits are those this project set itself: at most 1.2 times the script on Aly–Chan
with 100 cells, no slower on Van der Pol with 300, and 100 times faster than QuITO 1's way. That
way takes a minute and a half and 2.5 GB for its one run with 300 cells.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from statistics import median

import pytest
from baselines import ALY_CHAN, VAN_DER_POL, Case, Run, original, script
from measuring import GUARD, interleaved, median_ratio, show
from pytest_benchmark.fixture import BenchmarkFixture

import quito_cli as quito

VARIANCE = 2.0
ROUNDS = 15
SIZES = [
    pytest.param(ALY_CHAN, 100, 1.2, id="alychan-100"),
    pytest.param(VAN_DER_POL, 300, 1.0, id="van_der_pol-300"),
]
ORIGINALS = [
    pytest.param(ALY_CHAN, 100, 3, id="alychan-100"),
    pytest.param(VAN_DER_POL, 300, 1, id="van_der_pol-300"),
]
FASTER_THAN_ORIGINAL = 100.0
"""At least so many times."""


def _ours(case: Case, steps: int) -> Callable[[], tuple[Run, float]]:
    """Return a call that solves `case`; it gives what that took, and the whole call's seconds."""
    problem = quito.load(case.name)

    def run() -> tuple[Run, float]:
        started = time.perf_counter()
        solution = quito.solve(problem, steps=steps, variance=VARIANCE)
        whole = time.perf_counter() - started
        took = solution.statistics
        iterations = took.iterations or 0
        return (
            Run(
                took.build_seconds, took.solve_seconds, solution.cost, iterations, solution.success
            ),
            whole,
        )

    return run


def _row(name: str, runs: list[Run]) -> list[str]:
    """Return medians in milliseconds, and the last answer's iterations and cost."""
    seconds = [[r.build_seconds for r in runs], [r.solve_seconds for r in runs]]
    seconds.append([r.seconds for r in runs])
    milliseconds = [f"{1e3 * median(values):.1f}" for values in seconds]
    return [name, *milliseconds, str(runs[-1].iterations), f"{runs[-1].cost:.7g}"]


def _table(ours: list[tuple[Run, float]], name: str, theirs: list[Run]) -> Iterator[list[str]]:
    yield ["", "build ms", "solve ms", "sum ms", "iterations", "cost"]
    yield _row("quito", [run for run, _ in ours])
    yield _row(name, theirs)
    whole = f"{1e3 * median(seconds for _, seconds in ours):.1f}"
    yield ["quito, whole call with evidence", "", "", whole, "", ""]


@pytest.mark.benchmark
@pytest.mark.parametrize(("case", "steps", "limit"), SIZES)
def test_against_a_hand_written_script(
    case: Case, steps: int, limit: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ratio of build plus solve, ours over the script's, in one process, run by run in turn."""
    pairs = interleaved(_ours(case, steps), lambda: script(case, steps), ROUNDS)
    ratio = median_ratio([(run.seconds, theirs.seconds) for (run, _), theirs in pairs])
    whole = median_ratio([(seconds, theirs.seconds) for (_, seconds), theirs in pairs])
    title = (
        f"{case.name}, {steps} cells, against a hand-written script: ratio {ratio:.2f} "
        f"(limit {limit}); whole call {whole:.2f}"
    )
    show(capsys, title, list(_table([p[0] for p in pairs], "script", [p[1] for p in pairs])))
    assert all(run.solved and theirs.solved for (run, _), theirs in pairs)
    assert ratio <= GUARD * limit


@pytest.mark.benchmark
@pytest.mark.parametrize(("case", "steps", "rounds"), ORIGINALS)
def test_against_the_way_of_quito_1(
    case: Case, steps: int, rounds: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ratio of build plus solve, QuITO 1's way over ours, in one process, run by run in turn."""
    ours = _ours(case, steps)
    ours()  # the baseline takes so long that it needs no run for warmth
    pairs = [(original(case, steps, VARIANCE), ours()) for _ in range(rounds)]
    ratio = median_ratio([(theirs.seconds, run.seconds) for theirs, (run, _) in pairs])
    title = (
        f"{case.name}, {steps} cells, against the way of QuITO 1: {ratio:.0f} times faster "
        f"(at least {FASTER_THAN_ORIGINAL:.0f})"
    )
    show(capsys, title, list(_table([p[1] for p in pairs], "QuITO 1", [p[0] for p in pairs])))
    assert ratio >= FASTER_THAN_ORIGINAL / GUARD


@pytest.mark.benchmark
@pytest.mark.parametrize(("case", "steps", "limit"), SIZES)
def test_whole_call(case: Case, steps: int, limit: float, benchmark: BenchmarkFixture) -> None:
    """Time of `quito.solve` on a problem already read, evidence and all; for comparing commits."""
    benchmark.extra_info["limit against a script"] = limit
    problem = quito.load(case.name)
    solution = benchmark.pedantic(  # type: ignore[no-untyped-call]
        quito.solve,
        args=(problem,),
        kwargs={"steps": steps, "variance": VARIANCE},
        rounds=ROUNDS,
        warmup_rounds=1,
    )
    assert solution.success
