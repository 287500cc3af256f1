"""Reports of a batch run: the files that were asked for, and the baseline it is held against."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from quito_cli.cli.output import check_file
from quito_cli.errors import UsageError

if TYPE_CHECKING:
    from quito_cli.batch.report import Report

BaselineFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Figures to compare with, of an earlier run: exit code 3 where one is worse.",
    ),
]
UpdateBaseline = Annotated[
    bool,
    typer.Option(
        "--update-baseline", help="Write this run's figures to the baseline; accept them."
    ),
]
Junit = Annotated[Path | None, typer.Option(metavar="FILE", help="Write JUnit XML, for CI.")]
Markdown = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a summary for the page of a CI job.")
]
Html = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write a page with figures and pictures.")
]
Plots = Annotated[
    str | None,
    typer.Option(help="Cases with pictures on the page: failed, all or none. [default: failed]"),
]
_PLOTS: Final = "failed"


@dataclass(frozen=True)
class Wanted:
    """What is to be made of a run."""

    baseline: Path | None
    update: bool
    junit: Path | None
    markdown: Path | None
    html: Path | None
    plots: str | None

    def check(self, keep: str) -> None:
        """Refuse what cannot be made: a long run must not end with nowhere to write.

        Args:
            keep: whose result files stay.

        Raises:
            UsageError: options exclude each other, or a file cannot be written.
        """
        from quito_cli.batch.pictures import check_which

        plots = self.plots or _PLOTS
        check_which(plots)
        if self.plots is not None and self.html is None:
            raise UsageError("--plots chooses pictures for the page: add --html with its file")
        if self.update and self.baseline is None:
            raise UsageError("--update-baseline needs --baseline with the file to write")
        if self.html is not None and plots not in ("none", keep) and keep != "all":
            raise UsageError(
                f"pictures are made of result files, and --keep {keep} leaves none of some cases: "
                f"leave it out, or add --plots {keep}"
            )
        written = [self.junit, self.markdown, self.html]
        for path in [*written, self.baseline if self.update else None]:
            if path is not None:
                check_file(path)

    def write(self, report: Report) -> tuple[Path, ...]:
        """Write the files that were asked for; return them."""
        if self.junit is not None:
            report.write_junit(self.junit)
        if self.markdown is not None:
            report.write_markdown(self.markdown)
        if self.html is not None:  # last: it takes longest
            report.write_html(self.html, self.plots or _PLOTS)
        return tuple(path for path in (self.junit, self.markdown, self.html) if path is not None)
