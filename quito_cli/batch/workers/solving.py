"""One case solved, in a worker: its figures, what was expected of them, its result file."""

from __future__ import annotations

import os
import re
import time
from collections import OrderedDict
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from quito_cli.batch.judging.checks import check_all
from quito_cli.batch.judging.figures import figures
from quito_cli.batch.suite.case import Case, Ending, Finished
from quito_cli.errors import QuitoError

if TYPE_CHECKING:
    from quito_cli.problem.schema import Problem
    from quito_cli.solution.solution import Solution
    from quito_cli.solvers.outcome import Progress

Keep = Literal["all", "failed", "none"]
"""Whose result files stay: of all cases, of those that did not pass, of none."""
BEGUN: Final = "begun"
"""What a case says when its modules are loaded and its clock starts."""
_ODD = re.compile(r"[^\w.=+-]+")
_AT_MOST = 0.1
"""Seconds between two words of progress, at least."""
_LONGEST = 150
"""Characters of the name of a file."""


def file_stem(name: str) -> str:
    """Return what the files of a case are called: `a[mu=0.1,steps=50]` is `a-mu=0.1-steps=50`."""
    return _ODD.sub("-", name).strip("-.")[:_LONGEST]


def result_path(folder: Path, name: str) -> Path:
    """Return where the result of a case is saved."""
    return folder / f"{file_stem(name)}.h5"


def solve_case(
    case: Case,
    guess: Path | None,
    folder: Path,
    keep: Keep,
    record: Collection[str],
    watched: bool,
    tell: Callable[[Any], None],
) -> Finished:
    """Solve a case, whatever becomes of it.

    Args:
        case: what to solve.
        guess: a result to start from.
        folder: where its result goes.
        keep: whether that is saved.
        record: figures to be found beside those that are expected.
        watched: whether somebody looks at the progress.
        tell: told `BEGUN`, and then the solver's Progress now and then.
    """

    tell(BEGUN)
    started, used = time.perf_counter(), processor_seconds()
    wanted = {expected.figure for expected in case.expectations}.union(record)
    path = result_path(folder, case.name)
    try:
        problem, solution = _solved(case, guess, _seldom(tell) if watched else None)
        found = figures(solution, problem, processor_seconds() - used, wanted)
        checks = check_all(case.expectations, found)
        ending = _ending(case, solution, all(one.passed for one in checks))
        kept = keep == "all" or (keep == "failed" and ending is not Ending.PASSED)
        if kept:
            solution.save(path)
        else:
            path.unlink(missing_ok=True)  # of an earlier run
    except QuitoError as error:
        seconds = time.perf_counter() - started
        return Finished(case, Ending.REFUSED, str(error), {}, (), seconds, None)
    seconds = time.perf_counter() - started
    said = " ".join([solution.status.value, *solution.evidence.diagnosis])
    return Finished(case, ending, said, found, checks, seconds, path if kept else None)


def processor_seconds() -> float:
    """Return what this process, and those that it has waited for, have used of processors.

    Unlike the time on the clock it does not depend on what else the machine does.
    """
    children = os.times()
    return time.process_time() + children.children_user + children.children_system


def _solved(
    case: Case, guess: Path | None, listener: Callable[[Progress], None] | None
) -> tuple[Problem, Solution]:
    from quito_cli.solve import solve

    problem, options = _problem(case), dict(case.options)
    if guess is not None:
        options["guess"] = guess
    return problem, solve(problem, listener=listener, **options)


_loaded: OrderedDict[tuple[str, str, str], Problem] = OrderedDict()


def _problem(case: Case) -> Problem:
    """Return the problem of a case: the same object for the same text, so that its formulas are
    derived once for many cases of a worker."""
    from quito_cli.problem.build import KEPT
    from quito_cli.problem.load import find, load_text, text_of

    if case.text is None:
        path = find(case.problem)
        text, name = text_of(path), str(path)
    else:
        text, name = case.text, Path(case.problem).name
    key = text, name, repr(dict(case.constants))  # 1, 1.0 and True are told apart
    if key not in _loaded:
        if len(_loaded) == KEPT:
            _loaded.popitem(last=False)
        _loaded[key] = load_text(text, name, dict(case.constants))
    return _loaded[key]


def _ending(case: Case, solution: Solution, passed: bool) -> Ending:
    """Return how it ended; one that is expected not to converge is not to be blamed for that."""
    if solution.interrupted:
        return Ending.INTERRUPTED
    foreseen = {one.figure for one in case.expectations} & {"status", "success"}
    if not solution.success and not (foreseen and passed):
        return Ending.UNSOLVED
    return Ending.PASSED if passed else Ending.OUTSIDE


def _seldom(tell: Callable[[Any], None]) -> Callable[[Progress], None]:
    """Return a listener that passes on what a person can follow."""
    last = 0.0

    def listen(progress: Progress) -> None:
        nonlocal last
        now = time.perf_counter()
        if now - last >= _AT_MOST:
            last = now
            tell(progress)

    return listen
