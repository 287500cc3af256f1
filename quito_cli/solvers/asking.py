"""What the engines that ask CasADi's plug-ins have in common: options, words, prints, numbers."""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from typing import Any

from quito_cli.errors import UsageError
from quito_cli.problem.text.complaints import suggest
from quito_cli.solvers.backend import Backend
from quito_cli.solvers.outcome import Listener, Progress, Status

MOST_ITERATIONS = 10**9
"""A larger count is memory that was never written."""
ENDINGS = {
    "SOLVER_RET_SUCCESS": Status.SOLVED,
    "SOLVER_RET_LIMITED": Status.ITERATION_LIMIT,
    "SOLVER_RET_NAN": Status.NOT_FINITE,
    "SOLVER_RET_INFEASIBLE": Status.INFEASIBLE,
    "SOLVER_RET_EXCEPTION": Status.FAILED,
}
"""CasADi's kinds of ending."""


@dataclass(frozen=True)
class Request:
    """What is asked of a solver, beside the program."""

    backend: Backend
    tolerance: float
    max_iterations: int
    options: Mapping[str, Any]
    """By the solver's own names."""
    listener: Listener | None


def settings(request: Request, *, warm: bool) -> dict[str, Any]:
    """Return the plug-in's options: the row's, the tolerance and the limit, then those given."""
    row = request.backend
    asked = row.sharper * max(request.tolerance, row.accuracy)
    chosen: dict[str, Any] = {**row.plugin_options}
    inner: dict[str, Any] = chosen if row.group is None else chosen.setdefault(row.group, {})
    inner |= row.fixed
    limits = dict.fromkeys(row.tolerances, asked)
    if row.iterations is not None:
        limits[row.iterations] = request.max_iterations
    for name, value in limits.items():
        (chosen if name in row.outside else inner)[name] = value
    inner |= {**(row.warm or {} if warm else {}), **request.options}
    return chosen


def refuse_unknown(row: Backend, given: Mapping[str, Any], known: tuple[str, ...]) -> None:
    """Refuse an option whose name the solver does not have.

    Raises:
        UsageError: with the nearest name.
    """
    for name in given:
        if name not in known:
            raise UsageError(f"{row.name} has no option '{name}'{suggest(name, known)}")


def refusal(row: Backend, reason: str) -> UsageError:
    """Return what to say of a solver that does not take its options."""
    name = "IPOPT" if row.name == "ipopt" else row.name
    return UsageError(f"{name} refuses an option: {reason}")


def last_line(error: BaseException) -> str:
    """Return what an error of CasADi's says, without where in its source."""
    text = str(error).strip().splitlines() or [type(error).__name__]
    return text[-1].rpartition("cpp:")[2].lstrip("0123456789: ")


def status_of(row: Backend, statistics: Mapping[str, Any]) -> tuple[Status, str]:
    """Return the status and the solver's own word for it."""
    said = str(statistics.get("return_status", "unknown"))
    ending = str(statistics.get("unified_return_status", ""))
    return row.statuses.get(said, ENDINGS.get(ending, Status.FAILED)), said


def count_of(row: Backend, statistics: Mapping[str, Any]) -> int | None:
    """Return the number of iterations; None where the solver says nothing that can be one."""
    counts = [statistics.get(name) for name in row.counters]
    total = 0
    for count in counts:
        if not isinstance(count, int | float) or not math.isfinite(count):
            return None
        if not 0 <= count < MOST_ITERATIONS:
            return None
        total += int(count)
    return total


def heard(listener: Listener | None) -> Listener | None:
    """Return a listener that prints where this is called, though the solver may be silenced."""
    if listener is None:
        return None
    stream = sys.stderr

    def tell(progress: Progress) -> None:
        with redirect_stderr(stream):
            listener(progress)

    return tell


@contextmanager
def quiet(request: Request) -> Iterator[None]:
    """Send what a solver prints to stderr where its options were given, nowhere else.

    Our stdout is for the answer.
    """
    if request.options:
        with redirect_stdout(sys.stderr):
            yield
        return
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        yield
