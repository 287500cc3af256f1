"""Figures of a run held against a baseline: better, same, worse, new, missing.

Of two figures a (recorded) and b (found) the verdict is

    same       where |b − a| <= max(absolute, relative |a|), with the tolerance declared for them,
    otherwise  better or worse by the rule of the figure,

and a figure that one side alone knows is new or missing. Lists are compared entry by entry. Most
figures are errors and counts, and smaller is better; some have no better, and a change of them that
nobody has declared is for the worse.

**The cost** is neither. A lower one is no gain where it was bought by violating a constraint or by
a coarser integration, and that of a direct method may be below the optimum. So where the optimum is
known, the better of two costs is the one nearer to it, from whichever side; where it is not, the
lower one in a minimisation and the higher one in a maximisation, and only if neither the violation
nor the re-simulation gap became worse with it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from quito_cli.batch.judging.baseline import (
    ANSWERED,
    Baseline,
    Figures,
    known,
    measured,
    without_times,
)
from quito_cli.batch.judging.rules import RULES, Better, Rule, Tolerance
from quito_cli.batch.suite.case import Case, Ending, Figure, Finished
from quito_cli.errors import QuitoError


class Verdict(Enum):
    """What became of a figure; in the order that a reviewer wants to read them in."""

    WORSE = "worse"
    MISSING = "missing"
    BETTER = "better"
    NEW = "new"
    SAME = "same"

    @property
    def fails(self) -> bool:
        """Whether a run with such a figure is outside its baseline."""
        return self in (Verdict.WORSE, Verdict.MISSING)


@dataclass(frozen=True)
class Difference:
    """A figure of a case, recorded and found."""

    case: str
    figure: str
    """`ENDING` where the case as a whole is meant."""
    verdict: Verdict
    recorded: Figure
    found: Figure
    allowed: float | None = None
    """The difference that would be the same."""
    note: str = ""
    """What a reader must know beside the figures."""


ENDING: Final = "ending"
"""Stands for a figure where a case has none, or is new or missing altogether."""
SOLVED: Final = "solved"
"""What a baseline says of the ending of a case that it has."""
_NOT_SOUGHT: Final = "it was not looked for: was the run resumed from one without this baseline?"
_EVIDENCE: Final = ("violation", "resimulation_gap")
"""What must not become worse for a cost to become better."""


def compare(
    baseline: Baseline,
    finished: Sequence[Finished],
    calibration: float | None,
    maximises: Callable[[Case], bool],
    everything: Collection[str] | None,
) -> tuple[Difference, ...]:
    """Return every figure of a run beside what is recorded of it, by case.

    Args:
        baseline: what is recorded.
        finished: the cases of the run; one that was interrupted is not looked at.
        calibration: processor seconds of a calibration solve; None leaves the times out.
        maximises: whether the problem of a case is a maximisation.
        everything: names of all cases of the suite: one that is not among them is missing. None
            of a run of a part of the suite.
    """
    rows: list[Difference] = []
    for case in finished:
        name, recorded = case.case.name, baseline.cases.get(case.case.name)
        if case.ending is Ending.INTERRUPTED:
            continue
        if case.ending in ANSWERED:
            if recorded is None:
                rows.append(Difference(name, ENDING, Verdict.NEW, None, SOLVED))
            else:
                found = measured(baseline, case, calibration)
                if calibration is None:
                    recorded = without_times(recorded)
                rows += _of_case(baseline, case, recorded, found, maximises)
        elif recorded is not None:
            ending = case.ending.name.lower().replace("_", " ")
            rows.append(Difference(name, ENDING, Verdict.WORSE, SOLVED, ending))
    if everything is not None:
        gone = sorted(baseline.cases.keys() - set(everything))
        rows += [Difference(name, ENDING, Verdict.MISSING, SOLVED, None) for name in gone]
    return tuple(rows)


def same(rows: Sequence[Difference]) -> dict[str, frozenset[str]]:
    """Return by case the figures that are the same."""
    found: dict[str, set[str]] = {}
    for row in rows:
        if row.verdict is Verdict.SAME:
            found.setdefault(row.case, set()).add(row.figure)
    return {case: frozenset(figures) for case, figures in found.items()}


def _of_case(
    baseline: Baseline,
    case: Finished,
    recorded: Figures,
    found: Figures,
    maximises: Callable[[Case], bool],
) -> list[Difference]:
    name, rows = case.case.name, {}
    for figure in sorted(recorded.keys() | found.keys()):
        tolerance = baseline.tolerance(name, figure)
        if tolerance is None:
            continue
        before, after, rule = recorded.get(figure), found.get(figure), RULES[figure]
        verdict, allowed = judged(before, after, tolerance, rule)
        sought = (rule.of or figure) in case.figures
        note = "" if sought or verdict is not Verdict.MISSING else _NOT_SOUGHT
        rows[figure] = Difference(name, figure, verdict, before, after, allowed, note)
    cost = rows.get("cost")
    if cost is not None and cost.verdict is Verdict.WORSE:
        sense = -1 if maximises(case.case) else 1
        rows["cost"] = _of_cost(cost, rows, case.figures.get("cost_error"), sense)
    return list(rows.values())


def judged(
    before: Figure, after: Figure, tolerance: Tolerance, rule: Rule
) -> tuple[Verdict, float | None]:
    """Return the verdict on a figure by itself, and the difference that is allowed.

    A cost that is not the same is worse here: it cannot be judged by itself.
    """
    if not known(before):
        return Verdict.NEW, None
    if not known(after):
        return Verdict.MISSING, None
    match before, after:
        case str(), str():
            return _of_words(before, after, rule), None
        case tuple(), tuple():
            return _of_lists(before, after, tolerance)
        case bool() | int() | float(), bool() | int() | float():
            return _of_numbers(float(before), float(after), tolerance, rule.better)
    return Verdict.WORSE, None


def _of_numbers(
    before: float, after: float, tolerance: Tolerance, better: Better
) -> tuple[Verdict, float]:
    allowed = tolerance.of(before)
    if better is Better.SMALLER:
        before, after = abs(before), abs(after)
    if before == after or abs(after - before) <= allowed:  # infinities have no difference
        return Verdict.SAME, allowed
    gained = {Better.SMALLER: after < before, Better.LARGER: after > before}.get(better, False)
    return Verdict.BETTER if gained else Verdict.WORSE, allowed


def _of_lists(
    before: tuple[float, ...], after: tuple[float, ...], tolerance: Tolerance
) -> tuple[Verdict, float]:
    allowed = tolerance.of(max(map(abs, before), default=0.0))
    near = len(before) == len(after) and all(
        a == b or abs(b - a) <= tolerance.of(a) or not (known(a) or known(b))
        for a, b in zip(before, after, strict=True)
    )
    return Verdict.SAME if near else Verdict.WORSE, allowed


def _of_words(before: str, after: str, rule: Rule) -> Verdict:
    if before == after:
        return Verdict.SAME
    if before in rule.words and after in rule.words:
        gained = rule.words.index(after) < rule.words.index(before)
        return Verdict.BETTER if gained else Verdict.WORSE
    return Verdict.WORSE


def _of_cost(
    cost: Difference, rows: Mapping[str, Difference], error: Figure, sense: int
) -> Difference:
    """Return the row of a cost that is not the same, judged by what else is known.

    Args:
        cost: the row, with the verdict worse.
        rows: of the other figures.
        error: |found − optimum|, where that is known.
        sense: 1 of a minimisation, −1 of a maximisation.
    """
    before, after = cost.recorded, cost.found
    assert isinstance(before, int | float)
    assert isinstance(after, int | float)
    gained = sense * (after - before) < 0
    once = rows["cost_error"].recorded if "cost_error" in rows else None
    if isinstance(error, int | float) and isinstance(once, int | float):
        optimum = _optimum(before, after, once, error)
        verdict = Verdict.BETTER if error < abs(before - optimum) else Verdict.WORSE
        beyond = gained and verdict is Verdict.WORSE
        side = "below" if sense > 0 else "above"
        note = f"{side} the known optimum: it claims more than can be had" if beyond else ""
        return replace(cost, verdict=verdict, note=note)
    doubts = [name for name in _EVIDENCE if name in rows and rows[name].verdict.fails]
    if gained and doubts:
        said = " and ".join(name.replace("_", " ") for name in doubts)
        return replace(cost, note=f"{said} became worse with it: it may be no gain")
    return replace(cost, verdict=Verdict.BETTER if gained else Verdict.WORSE)


def _optimum(before: float, after: float, error_before: float, error_after: float) -> float:
    """Return the optimum that is |error| from both costs: of the two beside `after` the likelier.

    What is recorded of an error is rounded, so that it serves to choose alone.
    """
    sides = (after - error_after, after + error_after)
    return min(sides, key=lambda optimum: abs(abs(before - optimum) - error_before))


def maximises(case: Case) -> bool:
    """Return whether the problem of a case says so; False of one that cannot be read any more."""
    from quito_cli.problem.load import load, load_text

    try:
        problem = load(case.problem) if case.text is None else load_text(case.text, case.problem)
    except QuitoError:
        return False
    return problem.sense == "maximize"
