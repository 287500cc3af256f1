"""A suite file, with all that it includes -> Suite.

A suite is read as strictly as a problem, and all that is wrong in it is told at once; where there
is so much that it could take for ever, what has been found.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from quito_cli.batch.case import Case
from quito_cli.batch.expansion import Draft, expanded
from quito_cli.batch.files import Wrong, matched, problem_of
from quito_cli.batch.limits import Limits
from quito_cli.batch.schema_suite import MAX_CASES, Entry, Shared, SuiteFile
from quito_cli.batch.sizes import Sizes
from quito_cli.batch.solving import file_stem
from quito_cli.batch.suite_words import complaint
from quito_cli.errors import UsageError
from quito_cli.problem.library import bundled, bundled_suites, says_cases
from quito_cli.problem.load import find, text_of
from quito_cli.problem.text.complaints import Complaint, ProblemError, suggest
from quito_cli.problem.text.complaints import Path as Place
from quito_cli.problem.text.source import Source
from quito_cli.problem.text.strict_yaml import read
from quito_cli.problem.validate import real_path

MOST_WRONG: Final = 25
"""Complaints after which the rest of a file is not looked at: it could take for ever."""
DEEPEST: Final = 8
"""Suites that include one another, in a row."""
MOST_TEXT: Final = 40_000_000
"""Characters of all files that a suite names."""
MOST_SETTINGS: Final = 500_000
"""Options and constants that the cases of a file may set, all of them together."""


@dataclass(frozen=True)
class Suite:
    """Cases to be solved."""

    name: str
    """Short: the file's name without its ending."""
    title: str
    cases: tuple[Case, ...]
    limits: Mapping[str, Limits]
    """What each case may take, by its name."""
    whole: bool = True
    """Whether it has all of its cases, or those only that were chosen."""


def load_suite(where: str | Path) -> Suite:
    """Read a suite, with all that it includes.

    Args:
        where: a path, or the name of a bundled suite.

    Raises:
        UsageError: there is none.
        ProblemError: the file, or one that it includes, has mistakes; all of them are told.
    """
    path = bundled_suites().get(str(where), Path(where))
    if not path.is_file():
        hint = suggest(str(where), bundled_suites())
        raise UsageError(f"there is no suite {where}{hint}")
    return _Reader().suite(path, str(where) if path == Path(where) else str(path), ())


def within(prefix: str, case: Case) -> Case:
    """Return a case of an included suite, under a name that says so."""
    follows = None if case.follows is None else f"{prefix}/{case.follows}"
    return replace(case, name=f"{prefix}/{case.name}", follows=follows)


@dataclass
class _Reader:
    """What is known of files, so that each is read once."""

    texts: dict[Path, str] = field(default_factory=dict)
    data: dict[str, Mapping[str, Any] | None] = field(default_factory=dict)
    suites: dict[Path, Suite] = field(default_factory=dict)
    read: int = 0
    """Characters of all texts."""

    def suite(self, path: Path, name: str, chain: tuple[Path, ...]) -> Suite:
        """Return the suite in a file; `chain` are the files that include it."""
        if path.resolve() in self.suites:
            return self.suites[path.resolve()]
        chain = (*chain, path.resolve())
        source = read(self.text(path), name)
        file, wrong = _validated(source)
        drafts = self.drafts(file, path, chain, wrong)
        if wrong:
            raise ProblemError(wrong, source)
        cases = tuple(draft.case for draft in drafts)
        limits = {draft.case.name: draft.limits for draft in drafts}
        made = self.suites[chain[-1]] = Suite(path.stem, file.title, cases, limits)
        return made

    def drafts(
        self, file: _File, path: Path, chain: tuple[Path, ...], wrong: list[Complaint]
    ) -> list[Draft]:
        """Return the cases of a suite; what is wrong with them joins `wrong`."""
        found: list[Draft] = []
        settings = 0
        for place, entry in file.entries.items():
            try:
                for draft in self.entry(entry, file.defaults, path, chain, place):
                    found.append(draft)
                    settings += len(draft.case.constants) + len(draft.case.options)
                    if len(found) > MAX_CASES:
                        raise Wrong(Complaint(place, f"more than {MAX_CASES} cases are too many"))
                    if settings > MOST_SETTINGS:
                        said = f"its cases set more than {MOST_SETTINGS:,} values: that is too much"
                        raise Wrong(Complaint(place, said))
            except Wrong as error:
                wrong += error.complaints
            except ProblemError:  # of a suite that is included: it says where
                raise
            except UsageError as error:
                wrong.append(Complaint(place, str(error)))
            if max(len(found) - MAX_CASES, settings - MOST_SETTINGS, len(wrong) - MOST_WRONG) > 0:
                return found
        wrong += _twice(found)
        return found

    def entry(
        self, entry: Entry, defaults: Shared, path: Path, chain: tuple[Path, ...], place: Place
    ) -> Iterator[Draft]:
        """Yield the cases of one entry."""
        _refuse_two_things(entry, place)
        if entry.include is None:
            problem = self.problem(str(entry.problem), path.parent, (*place, "problem"))
            name = entry.name or Path(problem).stem
            yield from self.spelled(name, problem, entry, defaults, place)
            return
        at = (*place, "include")
        for included in matched(entry.include, path.parent, chain, at):
            if not says_cases(self.text(included)):
                problem = str(included.resolve())
                yield from self.spelled(included.stem, problem, entry, defaults, place)
                continue
            self.refuse_beside_a_suite(entry, included, at)
            if len(chain) >= DEEPEST:
                message = f"suites include one another {DEEPEST} deep: that is too deep"
                raise Wrong(Complaint(at, message))
            suite = self.suite(included, str(included), chain)
            for case in suite.cases:
                yield Draft(within(suite.name, case), suite.limits[case.name], place)

    def spelled(
        self, name: str, problem: str, entry: Entry, defaults: Shared, place: Place
    ) -> Iterator[Draft]:
        """Yield a case for every combination of the entry's matrix."""
        content = self.content(problem)
        drafts, wrong = expanded(name, problem, entry, defaults, place, content)
        if wrong:
            raise Wrong(*wrong)
        sizes = Sizes(content)
        for draft in drafts:
            if too_large := sizes.complaint(draft.case, entry, place):
                raise Wrong(too_large)
            yield draft

    def text(self, path: Path) -> str:
        """Return the text of a file.

        Raises:
            UsageError: it cannot be read, or the suite has named too much already.
        """
        real = path.resolve()  # links may give one file many names
        if real not in self.texts:
            self.texts[real] = text_of(path)
            self.read += len(self.texts[real])
        if self.read > MOST_TEXT:
            raise UsageError(
                f"the files of this suite have more than {MOST_TEXT:,} characters: name fewer"
            )
        return self.texts[real]

    def content(self, problem: str) -> Mapping[str, Any] | None:
        """Return the data of a problem; None where its case will tell what is wrong with it."""
        if problem not in self.data:
            try:
                self.data[problem] = read(self.text(find(problem)), problem).data
            except UsageError:
                self.data[problem] = None
        return self.data[problem]

    def problem(self, given: str, folder: Path, place: Place) -> str:
        """Return the absolute path of a problem of a suite, or the name of a bundled one."""
        found = problem_of(given, folder, place)
        if found in bundled() or not says_cases(self.text(Path(found))):
            return found
        message = f"{given} is a suite: write `include: {given}`"
        raise Wrong(Complaint(place, message, length=len(given)))

    def refuse_beside_a_suite(self, entry: Entry, included: Path, place: Place) -> None:
        """Refuse what stands beside the include of a suite, whose cases stand for themselves."""
        beside = sorted(entry.model_fields_set - {"include"})
        if beside:
            message = (
                f"{included.name} is a suite, whose cases are taken as they stand there: leave "
                f"{' and '.join(f'`{key}`' for key in beside)} out"
            )
            raise Wrong(Complaint(place, message))


@dataclass(frozen=True)
class _File:
    """What can be read of a suite file."""

    title: str
    defaults: Shared
    entries: Mapping[Place, Entry]
    """By place in the file."""


def _validated(source: Source) -> tuple[_File, list[Complaint]]:
    """Return what can be read of a suite, and what is wrong with its structure."""
    try:
        file, wrong = SuiteFile.model_validate(source.data), []
    except ValidationError as error:
        details = [(detail, real_path(detail["loc"], source.data)) for detail in error.errors()]
        wrong = list(dict.fromkeys(complaint(detail, path) for detail, path in details))
        file = _without(source.data, {path[:2] for _, path in details})
    entries: dict[Place, Entry] = {}
    for i, case in enumerate(file.cases):
        if isinstance(case, str):
            entries["cases", i] = Entry(problem=case)
        elif case is not None:
            entries["cases", i] = case
    return _File(file.title, file.defaults, entries), wrong


def _without(data: Mapping[str, Any], wrong: set[Place]) -> SuiteFile:
    """Return a suite without the parts that something is wrong with; None for such cases."""
    listed = data.get("cases")
    cases: list[Any] = [
        None
        if ("cases", i) in wrong
        else (case if isinstance(case, str) else Entry.model_validate(case))
        for i, case in enumerate(listed if isinstance(listed, list) else [])
    ]
    return SuiteFile.model_construct(cases=cases)


def _refuse_two_things(entry: Entry, place: Place) -> None:
    if (entry.problem is None) == (entry.include is None):
        raise Wrong(Complaint(place, "a case has a `problem`, or else an `include`"))
    if entry.include is not None and entry.name is not None:
        message = "what is included has its own names: leave `name` out"
        raise Wrong(Complaint((*place, "name"), message, key=True, length=len("name")))


def _twice(drafts: Sequence[Draft]) -> Iterator[Complaint]:
    """Yield a complaint for every case whose name, or that of its file, another one has."""
    seen: dict[str, str] = {}
    for draft in drafts:
        name = draft.case.name
        stem = file_stem(name).casefold()
        if stem in seen:
            other = seen[stem]
            also = f"called {name}" if other == name else f"called {other}, and file names clash"
            yield Complaint(draft.place, f"another case is {also}: give this one a `name`")
        seen[stem] = name
