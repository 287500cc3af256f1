"""What can be taken away of a result: HDF5, pictures, CSV, the YAML, and a report page.

Each is made from the files of a finished job alone, in the job's folder.
"""

from __future__ import annotations

import asyncio
import csv
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from quito_cli.batch.worker import Died, Raised, Returned
from quito_cli.errors import QuitoError, ResultFileError, UsageError
from quito_cli.gui.answer import RESULT, Answer
from quito_cli.gui.aside import Aside

if TYPE_CHECKING:
    from quito_cli.solution.solution import Solution

MEDIA_TYPES: Final = {
    "h5": "application/x-hdf5",
    "csv": "text/csv; charset=utf-8",
    "png": "image/png",
    "pdf": "application/pdf",
    "svg": "image/svg+xml",
    "yaml": "application/yaml; charset=utf-8",
    "html": "text/html; charset=utf-8",
}
"""Of `export`, by ending."""
_LONGEST: Final = 100
"""Characters of a file's name."""


@dataclass(frozen=True)
class Download:
    """A file for the browser."""

    filename: str
    media_type: str
    path: Path
    """Where it is, in the folder of the job; it is there until the job is dropped."""


class Exporter:
    """Makes downloads, one at a time, in a process of its own."""

    def __init__(self, seconds: float, memory: int) -> None:
        """Prepare; the process is started by the first export.

        Args:
            seconds: that one may take.
            memory: bytes that the process may hold.
        """
        self._aside = Aside(seconds, memory, _load)

    async def export(self, folder: Path, form: str) -> Download:
        """Make a download of a finished job; what was made before is not made again.

        Args:
            folder: of a job that is finished.
            form: a key of `MEDIA_TYPES`.

        Raises:
            UsageError: there is no such format, or there is nothing to draw.
            ResultFileError: the result is gone or damaged.
            QuitoError: it took too much time or memory.
        """
        ended = await asyncio.to_thread(self._aside.do, _export, folder, form)
        if isinstance(ended, Returned) and isinstance(ended.value, Download):
            return ended.value
        if isinstance(ended, Raised) and isinstance(ended.error, QuitoError):
            raise ended.error
        if isinstance(ended, Died) and ended.out_of_memory:
            raise QuitoError(f"making the {form} takes too much memory")
        if ended is None:
            raise QuitoError(f"the {form} was not made within {self._aside.seconds:g} seconds")
        raise QuitoError(f"the {form} could not be made")

    def close(self) -> None:
        """End the process."""
        self._aside.close()


def _load(tell: Callable[[Any], None]) -> None:
    """Load what most exports need."""
    import quito_cli.gui.report
    import quito_cli.plots.figure
    import quito_cli.solution.solution  # noqa: F401


def _export(folder: Path, form: str, tell: Callable[[Any], None]) -> Download:
    return export(folder, form)


def export(folder: Path, form: str) -> Download:
    """Make a download, here and now: see `Exporter.export`."""
    if form not in MEDIA_TYPES:
        raise UsageError(f"there is no format {form!r}; there are {', '.join(MEDIA_TYPES)}")
    answer = Answer.load(folder)
    name = f"{answer.name}-compare" if answer.kind == "compare" else answer.name
    path = folder / (RESULT if form == "h5" else f"export.{form}")
    if form != "h5" and not path.exists():
        from quito_cli.solution.solution import Solution
        from quito_cli.solution.store import write_aside

        solution = Solution.load(folder / RESULT)
        write_aside(path, lambda aside: _WRITERS[form](solution, answer, aside))
    elif not path.exists():
        raise ResultFileError("that run is not kept any more: run it again")
    return Download(f"{_fit(name)}.{form}", MEDIA_TYPES[form], path)


def _fit(name: str) -> str:
    """Return a name for a file on any system."""
    return re.sub(r"[^A-Za-z0-9_+-]+", "_", name).strip("_")[:_LONGEST] or "problem"


def _picture(solution: Solution, answer: Answer, path: Path) -> None:
    from quito_cli.gui.compared import draw_sheet
    from quito_cli.plots.figure import DEFAULT, draw

    if answer.kind == "compare":
        draw_sheet(answer, path)
    else:
        draw(solution, DEFAULT, path)


def _table(solution: Solution, answer: Answer, path: Path) -> None:
    """Write the trajectory: a row a node, a column a quantity, in full precision.

    Of a comparison the figures are written, a row a method.
    """
    if answer.kind == "compare":
        from quito_cli.gui.compared import write_table

        write_table(answer, path)
        return
    origin, times = solution.origin, solution.times
    heads = ["t", *(_head(q.name, q.unit) for q in (*origin.states, *origin.controls))]
    heads += [f"costate of {q.name}" for q in origin.states]
    blocks = (times[:, None], solution.state(times), solution.control(times), solution.costates)
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(heads)
        for cells in zip(*blocks, strict=True):
            rows.writerow([repr(float(value)) for cell in cells for value in cell])


def _head(name: str, unit: str) -> str:
    return f"{name} [{' '.join(unit.split())}]" if unit.strip() else name


def _text(solution: Solution, answer: Answer, path: Path) -> None:
    path.write_text(solution.origin.text, "utf-8")


def _report(solution: Solution, answer: Answer, path: Path) -> None:
    from quito_cli.gui.report import report

    path.write_text(report(answer, solution), "utf-8")


_WRITERS: Final[Mapping[str, Callable[[Solution, Answer, Path], None]]] = {
    "csv": _table,
    "png": _picture,
    "pdf": _picture,
    "svg": _picture,
    "yaml": _text,
    "html": _report,
}
"""All but the result file, which is there."""
