"""The Report of a run: its cases and what a baseline says of them, with the verdict; frozen.

All reports are made of it: the tables, JSON, JUnit, Markdown and the page.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from quito_cli.batch.case import Case, Ending, Finished
from quito_cli.batch.comparing import Difference, Verdict
from quito_cli.batch.recorded import counted, exit_code
from quito_cli.errors import GateError

if TYPE_CHECKING:
    from quito_cli.batch.sweep import Swept

WORDS: Final[Mapping[Ending, str]] = {
    Ending.PASSED: "passed",
    Ending.OUTSIDE: "outside",
    Ending.UNSOLVED: "not solved",
    Ending.REFUSED: "refused",
    Ending.CRASHED: "crashed",
    Ending.TIMED_OUT: "timed out",
    Ending.OUT_OF_MEMORY: "out of memory",
    Ending.INTERRUPTED: "interrupted",
}
"""Endings in a word or two."""


@dataclass(frozen=True)
class Report:
    """A run of a suite."""

    suite: str
    """Name."""
    title: str
    """What the suite calls itself; may be empty."""
    cases: int
    """How many there are in the suite; those that have not begun are not among the finished."""
    finished: tuple[Finished, ...]
    """In the order of the suite."""
    seconds: float
    """From the start of the run to its end."""
    baseline: Path | None = None
    """The file that it was held against."""
    differences: tuple[Difference, ...] = ()
    """From the baseline, those included that are the same; empty where there is none."""
    recorded: bool = False
    """Whether the baseline was written anew, so that its differences are accepted."""
    planned: tuple[Case, ...] = ()
    """All cases of the suite, those that have not begun too."""
    folder: Path = Path()
    """Where result files and journal are."""
    interrupted: bool = False
    """Whether the user stopped it before its end."""

    def __iter__(self) -> Iterator[Finished]:
        """Yield what became of each case, in the order of the suite."""
        return iter(self.finished)

    def __len__(self) -> int:
        """Return how many cases have begun."""
        return len(self.finished)

    def as_dictionary(self) -> dict[str, Any]:
        """Return what `quito batch --json` prints; figures that are not finite are numbers here."""
        from quito_cli.batch.dictionary import as_dictionary

        return as_dictionary(self)

    def write_junit(self, path: str | Path) -> None:
        """Write JUnit XML, for CI.

        Raises:
            ResultFileError: the file cannot be written; so with the other files.
        """
        from quito_cli.batch.junit import write

        write(self, Path(path))

    def write_markdown(self, path: str | Path) -> None:
        """Write a summary for the page of a CI job."""
        from quito_cli.batch.markdown import write

        write(self, Path(path))

    def write_html(self, path: str | Path, plots: str = "failed") -> None:
        """Write a page with figures and pictures that loads nothing from elsewhere.

        Args:
            path: of the file.
            plots: of which cases there are pictures: `failed`, `all` or `none`. They are made of
                result files: cases that kept none have none.

        Raises:
            UsageError: there is no such choice.
        """
        from quito_cli.batch.html import write
        from quito_cli.batch.pictures import check_which

        check_which(plots)
        write(self, Path(path), plots)

    def sweeps(self) -> tuple[Swept, ...]:
        """Return the sweeps and matrices of the suite, with what became of their cases."""
        from quito_cli.batch.sweep import collected
        from quito_cli.batch.sweeping import grids

        return tuple(collected(grid, self.finished) for grid in grids(self.planned))

    def save_sweeps(self, folder: str | Path | None = None, picture: str = "png") -> list[Path]:
        """Write an HDF5 and pictures of each of the `sweeps`; return the paths.

        Args:
            folder: where to; by default where the results are.
            picture: format of the pictures: png, pdf or svg.
        """
        from quito_cli.batch.dataset import save
        from quito_cli.batch.sweeping import SHOWN, SUFFIX
        from quito_cli.plots.sweep import draw_all

        into, written = self.folder if folder is None else Path(folder), []
        for swept in self.sweeps():
            path = into / f"{swept.sweep.name}{SUFFIX}.h5"
            save(swept, path)
            written += [path, *draw_all(swept, SHOWN, into, picture)]
        return written

    @cached_property
    def counts(self) -> Mapping[Ending, int]:
        """Cases by ending; endings that no case has are left out."""
        return counted(self.finished)

    @cached_property
    def verdicts(self) -> Mapping[Verdict, int]:
        """Differences by verdict; verdicts that none has are left out."""
        counted = Counter(row.verdict for row in self.differences)
        return {verdict: counted[verdict] for verdict in Verdict if counted[verdict]}

    @cached_property
    def failing(self) -> Mapping[str, tuple[Difference, ...]]:
        """By case what fails it against the baseline; empty where that was written anew."""
        found: dict[str, tuple[Difference, ...]] = {}
        for row in () if self.recorded else self.differences:
            if row.verdict.fails:
                found[row.case] = (*found.get(row.case, ()), row)
        return found

    def failed(self, case: Finished) -> bool:
        """Whether a case did not pass, or is outside the baseline."""
        return case.ending is not Ending.PASSED or case.case.name in self.failing

    @cached_property
    def gone(self) -> tuple[str, ...]:
        """Cases that fail by not being there: those of the baseline alone."""
        there = {case.case.name for case in self.finished}
        return tuple(name for name in self.failing if name not in there)

    @property
    def heading(self) -> str:
        """What to call it."""
        return self.title or self.suite

    @cached_property
    def exit_code(self) -> int:
        """What the command ends with, unless it was interrupted."""
        return exit_code(self.finished) or (GateError.exit_code if self.failing else 0)

    @cached_property
    def verdict(self) -> str:
        """The whole run in a sentence or two."""
        count, failed = len(self.finished), sum(map(self.failed, self.finished))
        if not count:
            said = "There was no case to run"
        elif not failed:
            said = "The one case passed" if count == 1 else f"All {count} cases passed"
            if gone := len(self.gone):
                said += f", but {gone} that the baseline has {'is' if gone == 1 else 'are'} missing"
        else:
            of_each = (
                f"{number} {WORDS[ending]}"
                for ending, number in self.counts.items()
                if ending is not Ending.PASSED
            )
            worse = sum(
                case.ending is Ending.PASSED and self.failed(case) for case in self.finished
            )
            parts = [*of_each, *([f"{worse} worse than the baseline"] if worse else [])]
            of_all = "The one case" if count == 1 else f"{failed} of {count} cases"
            said = f"{of_all} failed: {', '.join(parts)}"
        if left := self.cases - count:
            said += f"; {left} had not begun"
        return f"{said}. {self.against}".strip()

    @property
    def against(self) -> str:
        """What the baseline says, in a sentence."""
        if self.baseline is None:
            return ""
        if self.recorded:
            return "The baseline was written anew."
        told = [f"{n} {v.value}" for v, n in self.verdicts.items() if v is not Verdict.SAME]
        if told:
            return f"Against the baseline: {', '.join(told)}."
        return "As the baseline has it." if self.differences else "The baseline knows none of them."
