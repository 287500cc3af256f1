"""What a batch costs beyond its solves, and whether a thousand cases come out as they should.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_batch_cost.py -s

200 small cases on two workers may take 1.15 times half of what the same solves take one after
another in one process, and the start of an interpreter for each worker; with all result files
written, as is the default, and without. Where the machine has other work, the clock says nothing,
and the processor time of all processes is held to the same. Of 1000 cases, one in a hundred
crashes, hangs or has no solution, and exactly those are reported; memory does not grow.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from quito_cli.batch.suite.case import Case, Ending, Finished
from quito_cli.batch.suite.limits import Limits
from quito_cli.batch.workers.memory import resident
from quito_cli.batch.workers.run import Setting, run
from quito_cli.batch.workers.solving import BEGUN, solve_case

pytestmark = pytest.mark.benchmark

PROBLEMS = ("van_der_pol", "bang_bang", "bressan", "bryson_denham", "rayleigh")
CASES = tuple(
    Case(f"{problem}[steps={steps}]", problem, {"steps": steps})
    for problem in PROBLEMS
    for steps in range(20, 60)
)
FACTOR = 1.15
JOBS = 2

IN_PROCESS = """
import time, quito_cli as quito
quito.solve("van_der_pol", steps=20)
wall, cpu = time.perf_counter(), time.process_time()
for problem in {problems}:
    for steps in range(20, 60):
        quito.solve(problem, steps=steps)
print(time.perf_counter() - wall, time.process_time() - cpu)
"""


def interpreter() -> tuple[float, float]:
    """Return the seconds that an interpreter takes until it can solve, and those of the
    processor."""
    started, used = time.perf_counter(), processor()
    code = "import casadi, quito_cli.solving.on_mesh, quito_cli.optimality.certificate.certificate"
    subprocess.run([sys.executable, "-c", code], check=True)
    return time.perf_counter() - started, processor() - used


def processor() -> float:
    """Return the processor time of this process and of its children that have ended."""
    own, children = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def test_two_hundred_small_cases(tmp_path: Path) -> None:
    assert len(CASES) == 200
    code = IN_PROCESS.format(problems=PROBLEMS)
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    alone, alone_cpu = map(float, ran.split())
    start, start_cpu = interpreter()
    quiet = os.getloadavg()[0] < 1.5
    print(f"\n200 solves in one process: {alone:.1f} s, of the processor {alone_cpu:.1f} s")
    print(f"an interpreter that can solve: {start:.2f} s, of the processor {start_cpu:.2f} s")
    allowed = FACTOR * alone / JOBS + start
    allowed_cpu = FACTOR * alone_cpu + JOBS * start_cpu
    for keep in ("all", "none"):
        began, began_cpu = time.perf_counter(), processor()
        finished = list(run(CASES, Setting(JOBS, tmp_path, keep)))
        assert [one.ending for one in finished] == [Ending.PASSED] * len(CASES)
        spent, spent_cpu = time.perf_counter() - began, processor() - began_cpu
        print(
            f"on {JOBS} workers, keep {keep}: {spent:.1f} s of {allowed:.1f} s allowed; "
            f"of the processors {spent_cpu:.1f} s of {allowed_cpu:.1f} s"
        )
        assert spent_cpu <= allowed_cpu
        assert spent <= allowed or not quiet


EVIL = {17: "crash", 42: "hang", 71: "infeasible"}
"""By the number of a case modulo 100."""
TOO_FAR = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 5}}
controls: {u: {lower: -3, upper: 3}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""
"""With |u| <= 3, x ends at 3 at most."""


def evil(case: Case, *given: Any) -> Finished:
    """Solve a case as ever, unless it is one of those that crash or hang."""
    tell: Callable[[Any], None] = given[-1]
    kind = case.axes["kind"]
    if kind == "crash":
        tell(BEGUN)
        os.abort()
    if kind == "hang":
        tell(BEGUN)
        time.sleep(1000)
    return solve_case(case, *given)


def test_a_thousand_cases_some_of_them_evil(tmp_path: Path) -> None:
    cases = []
    for i in range(1000):
        kind = EVIL.get(i % 100, "good")
        text = TOO_FAR if kind == "infeasible" else None
        problem = "infeasible.yaml" if text else PROBLEMS[i % len(PROBLEMS)]
        cases.append(Case(f"{i}", problem, {"steps": 20}, axes={"kind": kind}, text=text))
    limits = {case.name: Limits(2.0, 2 * 10**9) for case in cases}
    began, endings, held = time.perf_counter(), {}, []
    for one in run(cases, Setting(JOBS, tmp_path, "none", limits, job=evil)):
        endings[one.case.name] = one.ending
        held.append(resident(os.getpid()))
    print(f"\n1000 cases in {time.perf_counter() - began:.0f} s")
    of_kind = {
        "good": Ending.PASSED,
        "crash": Ending.CRASHED,
        "hang": Ending.TIMED_OUT,
        "infeasible": Ending.UNSOLVED,
    }
    assert endings == {case.name: of_kind[str(case.axes["kind"])] for case in cases}
    early, late = max(held[100:300]), max(held[800:])
    print(f"memory of all processes: {early / 1e6:.0f} MB early, {late / 1e6:.0f} MB late")
    assert late < early + 50_000_000
