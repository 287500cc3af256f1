"""A sweep run as a suite: recorded as it goes, and collected at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby, product
from pathlib import Path
from typing import Any, Final

from quito_cli.batch.judging.figures import COSTLY, FIGURES
from quito_cli.batch.suite.axes import Axis, axis, evenly_multiplied, known, parse, refuse_unswept
from quito_cli.batch.suite.case import Case, Finished, Scalar
from quito_cli.batch.suite.suite import Suite
from quito_cli.batch.sweeps.sweep import Sweep, Swept, collected, expand, place_of
from quito_cli.batch.workers.jobs import workers_of
from quito_cli.batch.workers.recorded import limited, recorded
from quito_cli.batch.workers.run import Setting
from quito_cli.batch.workers.solving import file_stem
from quito_cli.errors import UsageError
from quito_cli.problem.load import find, load, text_of
from quito_cli.problem.text.complaints import suggest

SUFFIX: Final = "-sweep"
"""What the files of a sweep are called, after the problem."""
SHOWN: Final = ("cost", "iterations")
"""Figures of the table and the plots, unless others are asked for."""


def sweep(
    problem: str | Path,
    over: Mapping[str, Any] | Iterable[str],
    *,
    warm: bool = False,
    jobs: int | None = None,
    output: str | Path = "results",
    figures: Sequence[str] = SHOWN,
    constants: Mapping[str, Scalar] | None = None,
    time_limit: float | None = None,
    memory_limit: int | str | None = None,
    cluster: str | None = None,
    resume: bool = False,
    **options: Any,
) -> Swept:
    """Solve a problem at all combinations of values, as `quito sweep` does.

    Args:
        problem: a path, or the name of a bundled problem.
        over: values by name of a constant, a path or an option, such as {"mu": "0.1:2:20",
            "steps": [50, 100]}; or texts as the command line takes them.
        warm: start each solve from the answer of its neighbour.
        jobs: cases that are solved at once; as many as there are processors by default.
        output: folder of the files.
        figures: those of them to be found that are found on request only.
        constants: to set in all cases.
        time_limit: seconds of a case.
        memory_limit: of a case, in bytes or such as "2 GB".
        cluster: address of a Dask scheduler that is to solve them.
        resume: go on where an earlier run stopped.
        **options: fields of `Options`, for all cases.

    Raises:
        UsageError: an axis or an option is wrong.
        ProblemError: mistakes in the problem file.
    """
    planned = plan(problem, over, options=options, constants=constants or {}, warm=warm)
    suite = limited(suite_of(planned), time_limit, memory_limit)
    folder = Path(output) / suite.name
    record = tuple(sorted(COSTLY.intersection(known_figures(figures))))
    setting = Setting(
        workers_of(jobs, cluster), folder, "all", suite.limits, record=record, cluster=cluster
    )
    return run_through(planned, suite, setting, resume=resume)


def plan(
    problem: str | Path,
    over: Mapping[str, Any] | Iterable[str],
    *,
    options: Mapping[str, Any],
    constants: Mapping[str, Scalar],
    warm: bool,
) -> Sweep:
    """Return the cases of a sweep; arguments as of `sweep`."""
    loaded = load(problem)
    if isinstance(over, Mapping):
        axes = tuple(axis(name, values, known(loaded)) for name, values in over.items())
        refuse_unswept(axes)
    else:
        axes = parse(over, loaded)
    where = place_of(str(problem), find(problem))
    return expand(loaded, where, axes, options=options, constants=constants, warm=warm)


def suite_of(planned: Sweep) -> Suite:
    """Return a sweep as a suite."""
    return Suite(f"{planned.name}{SUFFIX}", planned.title, planned.cases, {})


def grids(cases: Sequence[Case]) -> tuple[Sweep, ...]:
    """Return the sweeps and matrices of a suite's cases, each with the cases that it has in a row.

    Only those whose cases are all there: of a matrix that was filtered there is no grid.
    """
    found = []
    for (base, problem, names), group in groupby(cases, _origin):
        members = tuple(group)
        axes = tuple(_axis(name, members) for name in names)
        combinations = product(*(axis.values for axis in axes))
        if names and [tuple(case.axes.values()) for case in members] == list(combinations):
            name = file_stem(base)
            warm = any(case.follows for case in members)
            found.append(Sweep(name, base, _text(problem), axes, members, {}, {}, warm))
    return tuple(found)


def _origin(case: Case) -> tuple[str, str, tuple[str, ...]]:
    """Return what cases of one grid have in common."""
    return case.name.partition("[")[0], case.problem, tuple(case.axes)


def _axis(name: str, cases: Sequence[Case]) -> Axis:
    """Return an axis of a grid from the places of its cases."""
    values = tuple(dict.fromkeys(case.axes[name] for case in cases))
    return Axis(name, values, name not in cases[0].constants, evenly_multiplied(values))


def _text(problem: str) -> str:
    try:
        return text_of(find(problem))
    except UsageError:  # as its cases have told
        return ""


def run_through(
    planned: Sweep,
    suite: Suite,
    setting: Setting,
    *,
    resume: bool,
    show: Callable[[Finished], None] = lambda finished: None,
) -> Swept:
    """Solve the cases of a sweep that are not done yet, and return what became of all.

    Args:
        planned: the sweep.
        suite: what it is as a suite.
        setting: how.
        resume: whether to go on where an earlier run stopped.
        show: told of each case as it finishes.
    """
    finished = []
    for one in recorded(suite, setting, resume=resume):
        finished.append(one)
        show(one)
    return collected(planned, finished)


def known_figures(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of figures, each once.

    Raises:
        UsageError: there is no such figure.
    """
    found = tuple(dict.fromkeys(name.strip() for name in names if name.strip()))
    for name in found:
        if name not in FIGURES:
            raise UsageError(
                f"there is no figure '{name}'{suggest(name, FIGURES)}; there are "
                f"{', '.join(FIGURES)}"
            )
    return found
