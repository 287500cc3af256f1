"""Cases of a run made by hand, for the tests of what is said of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from quito_cli.batch.reports.report import Report
from quito_cli.batch.suite.case import Case, Check, Ending, Expectation, Figure, Finished


def finished(
    name: str = "a",
    ending: Ending = Ending.PASSED,
    message: str = "Solved to the tolerance.",
    *,
    checks: tuple[Check, ...] = (),
    result: Path | None = None,
    seconds: float = 0.5,
    case: dict[str, Any] | None = None,
    **figures: Figure,
) -> Finished:
    """A case of the problem `van_der_pol` with these figures."""
    given = Case(name, "van_der_pol", **(case or {}))
    return Finished(given, ending, message, figures, checks, seconds, result)


def answered(name: str, figures: Mapping[str, Figure], ending: Ending = Ending.PASSED) -> Finished:
    """A case of the problem `van_der_pol` with these figures."""
    return Finished(Case(name, "van_der_pol"), ending, "", figures, (), 0.5, None)


def outside(figure: str = "cost", sentence: str = "cost is 2, expected 1 ± 1e-06") -> Check:
    """A check that failed."""
    return Check(Expectation(figure, target=1.0, absolute=1e-6), 2.0, False, sentence)


def report(*cases: Finished, **given: Any) -> Report:
    """A run of these cases."""
    named = given.pop("suite", "nightly"), given.pop("title", "")
    return Report(*named, len(cases), cases, given.pop("seconds", 12.0), **given)


_SOLVED = (Ending.PASSED, Ending.OUTSIDE)
OF_EACH = tuple(
    Finished(
        Case(ending.name.lower(), "van_der_pol"),
        ending,
        "" if ending is Ending.PASSED else f"Said of {ending.name.lower()}.",
        {"cost": 1.5, "iterations": 12} if ending in _SOLVED else {},
        (outside(),) if ending is Ending.OUTSIDE else (),
        0.5,
        None,
    )
    for ending in Ending
)
"""A case with each ending."""
