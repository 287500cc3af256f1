"""Result files -> pictures that a page can hold within itself."""

from __future__ import annotations

import base64
import gc
import io
import logging
import warnings
from collections.abc import Mapping
from typing import Final

from quito_cli.batch.reports.report import Report
from quito_cli.batch.suite.case import Finished
from quito_cli.errors import UsageError

WHICH: Final = ("failed", "all", "none")
"""Of which cases there are pictures."""
MOST: Final = 60
"""Pictures of failed cases: where more have failed, one cause is likely, and a page of pictures is
of no more use. Who asks for all of them gets all."""


def check_which(which: str) -> None:
    """Refuse what names no choice of cases.

    Raises:
        UsageError: there is no such choice.
    """
    if which not in WHICH:
        raise UsageError(f"plots: expected {', '.join(WHICH[:-1])} or {WHICH[-1]}, got {which!r}")


def pictures(report: Report, which: str) -> Mapping[str, str]:
    """Return pictures by case, as addresses of the `data:` kind; or sentences why there is none.

    Args:
        report: the run.
        which: one of `WHICH`.
    """
    wanted = [] if which == "none" else [case for case in report.finished if case.result]
    if which == "failed":
        wanted = [case for case in wanted if report.failed(case)][:MOST]
    return {case.case.name: _picture(case) for case in wanted}


def _picture(case: Finished) -> str:
    assert case.result is not None
    from matplotlib import rc_context

    from quito_cli.plots.figure import DEFAULT, figure
    from quito_cli.solution.solution import Solution

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no word on fonts being looked for
    drawn = io.BytesIO()
    try:
        with warnings.catch_warnings(), rc_context({"svg.hashsalt": "quito"}):
            # a title may have letters that the font has not
            warnings.filterwarnings("ignore", "Glyph .* missing from font")
            made = figure(Solution.load(case.result), DEFAULT)
            made.savefig(drawn, format="svg", metadata={"Date": None})
    except Exception as error:  # one picture that cannot be drawn must not cost the report
        return f"There is no picture: {error}"
    finally:
        gc.collect()  # figures are cycles, and a command does not collect them by itself
    return f"data:image/svg+xml;base64,{base64.b64encode(drawn.getvalue()).decode('ascii')}"
