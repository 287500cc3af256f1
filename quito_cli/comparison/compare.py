"""`compare`: one problem solved by several methods, and all answers held against one truth.

The truth is the reference of the file, where it knows the control, or else a finer solve of the
problem by our own method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from quito_cli.comparison.comparison import Comparison, Truth
from quito_cli.comparison.measure import SAMPLES, ZONE, Setting, check_setting, measured
from quito_cli.comparison.methods import (
    SELF,
    Method,
    again,
    control_points,
    name_of,
    parse,
)
from quito_cli.comparison.results import loaded, restated
from quito_cli.comparison.statement import differing
from quito_cli.comparison.truth import from_reference, from_solution
from quito_cli.errors import UsageError
from quito_cli.options import Options
from quito_cli.problem.build import build
from quito_cli.problem.load import changed, load
from quito_cli.problem.model import Model
from quito_cli.problem.schema import Problem
from quito_cli.problem.text.complaints import ProblemError
from quito_cli.solution.solution import Solution
from quito_cli.solve import solve
from quito_cli.solvers.outcome import Progress

Listener = Callable[[str, Progress], None]
"""Told of every iteration, and of which method it is."""

Found = TypeVar("Found")

FINER: Final = 4
"""Cells of the solve that is the truth, for each of ours."""
OF_OUR_ROW: Final = (
    *("steps", "variance", "generating_function", "normalised", "control"),
    *("discretization", "substeps", "degree", "mesh", "polish", "guess", "warm_start"),
)
"""Options that a saved result has settled."""


def compare(
    problem: str | Path | Problem,
    against: Iterable[str] | str = (),
    *,
    result: str | Path | Solution | None = None,
    samples: int | None = None,
    zone: float = ZONE,
    constants: Mapping[str, str | float] | None = None,
    listener: Listener | None = None,
    **options: Any,
) -> Comparison:
    """Solve a problem, by other methods too, and hold the answers against the truth.

    Args:
        problem: a path, the name of a bundled problem, or a Problem.
        against: methods, as `quito_cli.comparison.methods` has them, and "self" for a finer solve
            as the truth even where the file has a reference.
        result: a saved answer of this very problem, in the place of our solve.
        samples: n of the sampled norms; four for each cell of ours by default.
        zone: half the width of the jump zones around the truth's switching times, as a fraction of
            the horizon.
        constants: constants to set, by name, or other values by dotted path.
        listener: told of every iteration of every solve.
        **options: of our solve, fields of `Options`; tolerance, solver, their like, and the number
            of cells hold for the other methods too.

    Raises:
        UsageError: an unknown method, one that cannot do the problem, a wrong option, or a result
            of another problem.
        ProblemError: mistakes in the problem file, all of them told.
    """
    methods, against_self = parse([against] if isinstance(against, str) else against)
    check_setting(samples, zone)
    if isinstance(problem, str | Path):
        problem = load(problem)
    problem = changed(problem, constants or {})
    model = build(problem)
    saved = _saved(result, problem, options) if result is not None else None
    ours = _settled(problem, saved, options)
    others = _others(problem, methods, ours)
    name = name_of(ours)
    solution = saved or solve(problem, listener=_told(listener, name), **options)
    answers = [(name, solution), *_solved(problem, others, solution, listener)]
    asked = saved is not None or options.get("steps") is not None
    finer = partial(_finer, problem, ours, asked, listener)
    truth, notes, interrupted = _truth(model, answers[-1][1], finer, against_self)
    notes += [_unpolished(method, solution) for method, solution in answers if _lacks(solution)]
    if interrupted:
        notes.append("interrupted: what was to follow was not solved")
    setting = Setting(samples or SAMPLES * control_points(ours), zone)
    found = measured(answers, truth, setting, problem.published, notes)
    return replace(found, interrupted=interrupted)


def _settled(
    problem: Problem, saved: Solution | None, options: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the options that our row is solved with, or was; and what was asked for beside it."""
    given = {k: v for k, v in options.items() if k != "guess" and v is not None}
    resolved = asdict(Options.resolve(problem.options, given))
    return resolved if saved is None else {**saved.options, **{k: resolved[k] for k in given}}


def _told(listener: Listener | None, method: str) -> Callable[[Progress], None] | None:
    return None if listener is None else partial(listener, method)


def _others(
    problem: Problem, methods: tuple[Method, ...], ours: Mapping[str, Any]
) -> list[tuple[Method, dict[str, Any]]]:
    """Return the methods that are not ours, with their options, all of them looked at.

    Raises:
        UsageError: options of one make no sense; it is named.
    """
    others = []
    for method in methods:
        wanted = method.options(ours)
        resolved = _named(method.name, partial(Options.resolve, problem.options, wanted))
        if name_of(asdict(resolved)) != name_of(ours):
            others.append((method, wanted))
    return others


def _named(method: str, act: Callable[[], Found]) -> Found:
    """Return what `act` does; what a method cannot do is said of it by name."""
    try:
        return act()
    except ProblemError:  # a mistake in the file is nobody's
        raise
    except UsageError as error:
        raise type(error)(f"{method}: {error}") from None


def _solved(
    problem: Problem,
    others: list[tuple[Method, dict[str, Any]]],
    solution: Solution,
    listener: Listener | None,
) -> list[tuple[str, Solution]]:
    """Solve by all other methods, up to an interruption."""
    found: list[tuple[str, Solution]] = []
    for method, options in others:
        if solution.interrupted:
            break
        told = _told(listener, method.name)
        solution = _named(method.name, partial(solve, problem, listener=told, **options))
        found.append((method.name, solution))
    return found


def _lacks(solution: Solution) -> bool:
    """Whether an answer was to be polished, and is not."""
    return solution.polishing is not None and not solution.polished


def _unpolished(method: str, solution: Solution) -> str:
    """Return what the row of such an answer is."""
    assert solution.polishing is not None
    return f"{method} is the direct answer: {solution.polishing.outcome}"


def _truth(
    model: Model, last: Solution, finer: Callable[[], Solution], wanted: bool
) -> tuple[Truth | None, list[str], bool]:
    """Return the truth, what is to be said of it, and whether the user has stopped.

    Args:
        model: the problem.
        last: the answer found last; where it was interrupted, nothing more is solved.
        finer: solves for the truth where the file has none.
        wanted: whether a finer solve is asked for by name.
    """
    truth = None if wanted else from_reference(model)
    if truth is not None or last.interrupted:
        return truth, [], last.interrupted
    solved = finer()
    return *_as_truth(solved, model, wanted), solved.interrupted


def _finer(
    problem: Problem, ours: Mapping[str, Any], asked: bool, listener: Listener | None
) -> Solution:
    """Solve as ours was solved, on more cells; `asked` is whether ours was asked for by name."""
    options = again(ours)
    cells = FINER * int(options.pop("steps"))
    if asked:
        options["steps"] = cells
    else:  # as if the file asked: it cannot ask for more than a machine has by way of this
        finer = problem.options.model_copy(update={"steps": cells})
        problem = problem.model_copy(update={"options": finer})
    told = _told(listener, f"the truth, {cells} cells")
    return _named(SELF, partial(solve, problem, listener=told, **options))


def _as_truth(finer: Solution, model: Model, wanted: bool) -> tuple[Truth | None, list[str]]:
    """Return a finer solve as the truth, and what is to be said of it; `wanted` is by name."""
    notes, known = [], model.known
    if not wanted:
        lacks = "no reference" if known is None else "no reference of its control"
        notes.append(f"the problem has {lacks}: held against a finer solve of itself")
    if not finer.success:
        said = finer.status.value.removesuffix(".")
        notes.append(f"that did not converge, so no errors are known: {said}")
        return None, notes
    if _lacks(finer):
        notes.append(_unpolished("what it is held against", finer))
    cells, word = len(finer.times) - 1, "segments, polished" if finer.polished else "cells"
    truth = from_solution(finer, f"a solve on {cells} {word}", known)
    if not wanted and known is not None and known.cost is not None:
        notes.append("the cost is held against the file's")
        truth = replace(truth, cost=known.cost, accuracy=known.accuracy)
    return truth, notes


def _saved(result: str | Path | Solution, problem: Problem, options: Mapping[str, Any]) -> Solution:
    """Return a saved answer in the place of ours.

    Raises:
        UsageError: it is one of another problem, or options of a solve are given beside it.
    """
    for name in OF_OUR_ROW:
        if options.get(name) is not None:
            raise UsageError(
                f"{name.replace('_', '-')} belongs to a solve, and --result is solved already: "
                "leave one of them out"
            )
    solution = result if isinstance(result, Solution) else loaded(result)
    section = differing(problem, restated(solution))
    if section is not None:
        where = result if not isinstance(result, Solution) else "the result"
        raise UsageError(
            f"{where} answers another problem: its `{section}` differs; what was set for the "
            "result is set again with --set"
        )
    return solution
