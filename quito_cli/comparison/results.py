"""`compare_results`: saved answers held against one truth.

That is the reference of their file, where they all state the same problem and the file knows the
control, or else the first of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from quito_cli.comparison.comparison import Comparison
from quito_cli.comparison.measure import SAMPLES, ZONE, Setting, check_setting, measured
from quito_cli.comparison.methods import control_points
from quito_cli.comparison.statement import differing
from quito_cli.comparison.truth import from_reference, from_solution
from quito_cli.errors import UsageError
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text, refuse_problem
from quito_cli.problem.schema import Problem
from quito_cli.solution.solution import Solution


def compare_results(
    results: Sequence[str | Path], *, samples: int | None = None, zone: float = ZONE
) -> Comparison:
    """Hold saved answers against the reference of their problem, or against the first of them.

    Args:
        results: result files, two at least; a row is named after its file.
        samples: n of the sampled norms; four for each cell of the first by default.
        zone: half the width of the jump zones, as a fraction of the horizon.

    Raises:
        UsageError: fewer than two, or answers whose states or controls are not the same.
        ResultFileError: a file is missing, damaged, or no result.
    """
    check_setting(samples, zone)
    if len(results) < 2:
        raise UsageError(
            "name two results or more; one alone is compared by quito compare PROBLEM --result "
            "RESULT.h5"
        )
    solutions = [loaded(path) for path in results]
    first = solutions[0]
    for path, solution in zip(results, solutions, strict=True):
        _refuse_other_names(solution, first, path, results[0])
    problems = [restated(solution) for solution in solutions]
    differs = [differing(problems[0], problem) for problem in problems]
    names = _row_names(results)
    notes = [
        f"another problem is answered by {name}: its `{section}` differs"
        for name, section in zip(names, differs, strict=True)
        if section
    ]
    model = build(problems[0])
    truth = from_reference(model) if not notes else None
    if truth is None:
        title = f"the first result, {names[0]}"
        truth = from_solution(first, title, None if notes else model.known)
        truth = replace(truth, first_row=True)
    known = {solution.reference is not None for solution in solutions}
    if len(known) > 1:
        notes.append("no ringing: some of the results have it relative to a reference, others not")
    setting = Setting(samples or SAMPLES * control_points(first.options), zone)
    published = () if notes else problems[0].published
    answers = list(zip(names, solutions, strict=True))
    return measured(answers, truth, setting, published, notes, ringing=len(known) == 1)


def loaded(result: str | Path) -> Solution:
    """Read a result file.

    Raises:
        UsageError: it is a problem.
        ResultFileError: it is missing, damaged, or no result.
    """
    refuse_problem(result, "compare")
    return Solution.load(result)


def restated(solution: Solution) -> Problem:
    """Return the problem that was solved, from the text kept with its answer."""
    origin = solution.origin
    return load_text(origin.text, f"{origin.name}.yaml", dict(origin.changes))


def _refuse_other_names(
    solution: Solution, first: Solution, path: str | Path, first_path: str | Path
) -> None:
    for kind in ("states", "controls"):
        names = [q.name for q in getattr(solution.origin, kind)]
        wanted = [q.name for q in getattr(first.origin, kind)]
        if names != wanted:
            raise UsageError(
                f"{path} cannot be compared with {first_path}: its {kind} are "
                f"{', '.join(names) or 'none'}, not {', '.join(wanted) or 'none'}"
            )


def _row_names(results: Sequence[str | Path]) -> list[str]:
    """Return the stems of files, or their paths where stems are the same."""
    stems = [Path(result).stem for result in results]
    alike = len(set(stems)) < len(stems)
    return [str(result) for result in results] if alike else stems
