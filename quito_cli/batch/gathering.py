"""Where cases come from: files and names, as a command line has them -> Suite; and a part of one.

A file with `cases:` is a suite, one with `dynamics:` a problem.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from quito_cli.batch.case import Case
from quito_cli.batch.limits import Limits
from quito_cli.batch.suite import Suite, load_suite, within
from quito_cli.errors import UsageError
from quito_cli.problem.library import bundled_suites, says_cases
from quito_cli.problem.load import find, text_of
from quito_cli.problem.text.complaints import suggest

SEVERAL: Final = "batch"
"""What cases are called together that come from several files."""


def gather(
    targets: Sequence[str], options: Mapping[str, Any], constants: Mapping[str, Any]
) -> Suite:
    """Return the cases of suites and problems, as a command line names them.

    Args:
        targets: paths, or names of bundled suites and problems.
        options: of the solves, where the targets are problems.
        constants: to set, likewise.

    Raises:
        UsageError: there is no such file, two cases have a name, or options are given to suites.
        ProblemError: a suite has mistakes; all of them are told.
    """
    cases: list[Case] = []
    limits: dict[str, Limits] = {}
    suites = [target for target in targets if _names_suite(target)]
    if suites and (options or constants):
        given = next(iter([*options, *constants])).replace("_", "-")
        raise UsageError(
            f"{given}: options and constants are for problems, and {suites[0]} is a suite, which "
            "says itself what each of its cases is solved with"
        )
    if len(targets) == 1 and suites:
        return load_suite(targets[0])
    paths = {target: find(target, bundled_suites()) for target in targets if target not in suites}
    stems = Counter(path.stem for path in paths.values())
    for target in targets:
        if target in suites:
            suite = load_suite(target)
            cases += [within(suite.name, case) for case in suite.cases]
            limits |= {f"{suite.name}/{name}": kept for name, kept in suite.limits.items()}
        else:
            path = paths[target]
            problem = target if path != Path(target) else str(path.resolve())
            above = f"{path.resolve().parent.name}/" if stems[path.stem] > 1 else ""
            cases.append(Case(above + path.stem, problem, dict(options), dict(constants)))
    name = cases[0].name if len(targets) == 1 else SEVERAL
    return Suite(name, "", tuple(cases), limits)


def selected(suite: Suite, patterns: Sequence[str]) -> Suite:
    """Return a suite of those cases that a pattern means, and of those that they follow.

    Args:
        suite: to choose from.
        patterns: parts of names; or whole names with `*` for anything and `?` for a character.

    Raises:
        UsageError: a pattern means no case.
    """
    if not patterns:
        return suite
    follows = {case.name: case.follows for case in suite.cases}
    chosen: set[str] = set()
    for pattern in patterns:
        meant = [name for name in follows if _means(pattern, name)]
        if not meant:
            raise UsageError(f"no case is called {pattern}{suggest(pattern, follows)}")
        for name in meant:
            at: str | None = name
            while at is not None and at not in chosen:
                chosen.add(at)
                at = follows[at]
    cases = tuple(case for case in suite.cases if case.name in chosen)
    return replace(suite, cases=cases, whole=False)


def _means(pattern: str, name: str) -> bool:
    if not set("*?") & set(pattern):
        return pattern in name
    parts = (re.escape(part) for part in re.split(r"([*?])", pattern))
    return bool(re.fullmatch("".join(parts).replace(r"\*", ".*").replace(r"\?", "."), name))


def _names_suite(target: str) -> bool:
    if Path(target).is_file():
        return says_cases(text_of(Path(target)))
    return target in bundled_suites()
