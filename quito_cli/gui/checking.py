"""Text of a problem -> complaints at their lines, and its formulas; safe with any text.

Problem text is untrusted: it is looked at in a process of its own, limited in time and memory, and
one that is too slow is ended and begun anew. Mistakes and formulas come first; the warnings, for
which the Model has to be built, may come too late, and are left out then.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, Literal

from quito_cli.batch.worker import Died, Returned
from quito_cli.gui.aside import Aside
from quito_cli.problem.text.source import Source

if TYPE_CHECKING:
    from quito_cli.problem.schema import Problem
    from quito_cli.problem.text.complaints import Complaint, ProblemError

_BREAK: Final = re.compile(r"\r\n|\n|\r")
"""Of lines, as an editor counts them."""
_MOST_LATEX: Final = 40_000
"""Characters of formulas that are worth setting."""
_MOST_REMARKS: Final = 100


@dataclass(frozen=True)
class Remark:
    """A complaint for the editor."""

    line: int | None
    """From 1; None where it belongs to the whole text."""
    column: int | None
    """From 1, in UTF-16 units, as editors in browsers count."""
    length: int
    """Units to underline, in that line."""
    message: str
    severity: Literal["error", "warning"]


@dataclass(frozen=True)
class Block:
    """A part of the problem as mathematics."""

    title: str
    """minimise, `subject to`, where, with."""
    over: str
    """The unknowns in LaTeX, of the first part; else empty."""
    lines: tuple[str, ...]
    """Each a formula in LaTeX, to be set in display style; amsmath's commands are used."""


@dataclass(frozen=True)
class Checked:
    """What is to be said of a text."""

    remarks: tuple[Remark, ...]
    """By place."""
    title: str = ""
    formulas: tuple[Block, ...] = ()
    """Empty where the text has errors, or where there is too much to show."""
    unicode: str = ""
    """The same as plain text, for readers of screens; empty where the text has errors."""
    options: dict[str, Any] = field(default_factory=dict)
    """What the text asks of the solver in its `options`; empty where it has errors."""
    complete: bool = True
    """Whether there was time to look for warnings, and for the mistakes of formulas."""

    @property
    def ok(self) -> bool:
        """Whether no error is known."""
        return all(remark.severity != "error" for remark in self.remarks)


class Checker:
    """Looks at texts, one at a time, in a process of its own."""

    def __init__(self, seconds: float, memory: int, characters: int) -> None:
        """Prepare; the process is started by the first text.

        Args:
            seconds: that looking at a text may take.
            memory: bytes that the process may hold.
            characters: of the longest text that is looked at.
        """
        self._characters = characters
        self._aside = Aside(seconds, memory, load)
        self._solvers: tuple[str, ...] | None = None

    async def check(self, text: str, name: str) -> Checked:
        """Look at a text; never raises for anything in it. Calls take their turns."""
        if len(text) > self._characters:
            said = f"the text has {len(text):,} characters; at most {self._characters:,} are read"
            return Checked((_of_all(said),), complete=False)
        return await asyncio.to_thread(self._check, text, name)

    async def solvers(self) -> tuple[str, ...]:
        """Return the names of the solvers that are here."""
        if self._solvers is None:
            found = await asyncio.to_thread(self._aside.do, here)
            if isinstance(found, Returned):
                self._solvers = found.value
        return self._solvers or ("ipopt",)

    def close(self) -> None:
        """End the process."""
        self._aside.close()

    def _check(self, text: str, name: str) -> Checked:
        first: list[Checked] = []
        ended = self._aside.do(look, text, name, told=first.append)
        if isinstance(ended, Returned) and isinstance(ended.value, Checked):
            return ended.value
        if first:
            return first[0]
        said = f"the text could not be looked at within {self._aside.seconds:g} seconds"
        if isinstance(ended, Died) and ended.out_of_memory:
            said = "looking at the text takes too much memory"
        elif ended is not None:
            said = "the text could not be looked at: its checker failed"
        return Checked((_of_all(said),), complete=False)


def _of_all(message: str) -> Remark:
    return Remark(None, None, 1, message, "error")


def load(tell: Callable[[Any], None]) -> None:
    """Look at something small, so that all that a look needs has been loaded once."""
    from quito_cli.gui.work import QUICK

    look(QUICK, "quick", tell)


def here(tell: Callable[[Any], None]) -> tuple[str, ...]:
    """Return the names of the solvers that are here; in the worker."""
    from quito_cli.solvers import AUTOMATIC, SOLVERS
    from quito_cli.solvers.availability import available

    return (AUTOMATIC, *(name for name, row in SOLVERS.items() if available(row)))


def look(text: str, name: str, tell: Callable[[Any], None]) -> Checked:
    """Look at a text, in the worker; what needs no Model is told first."""
    from quito_cli.check import check
    from quito_cli.errors import QuitoError
    from quito_cli.problem.load import load_text
    from quito_cli.problem.text.complaints import ProblemError

    try:
        problem = load_text(text, f"{name}.yaml")
        read = _read(problem)
        tell(replace(read, complete=False))
        told = ProblemError(check(problem), problem.file)
        return replace(read, remarks=_remarks(told, "warning"))
    except ProblemError as error:
        return Checked(_remarks(error, "error"))
    except QuitoError as error:
        return Checked((_of_all(str(error)),))


def _read(problem: Problem) -> Checked:
    from quito_cli.problem.mathematics import latex_lines, render, statement

    sections, unknowns = statement(problem, latex=True)
    blocks = tuple(
        Block(title, "" if i else unknowns, tuple(latex_lines(lines)))
        for i, (title, lines) in enumerate(sections)
    )
    size = sum(len(line) for block in blocks for line in block.lines)
    plain = render(problem, latex=False)
    return Checked(
        (),
        problem.title,
        blocks if size <= _MOST_LATEX else (),
        plain[:_MOST_LATEX] + "…" * (len(plain) > _MOST_LATEX),
        problem.options.model_dump(exclude_none=True),
    )


def _remarks(error: ProblemError, severity: Literal["error", "warning"]) -> tuple[Remark, ...]:
    return tuple(_remark(one, error, severity) for one in error.complaints[:_MOST_REMARKS])


def _remark(one: Complaint, error: ProblemError, severity: Literal["error", "warning"]) -> Remark:
    """Return a complaint at the place where an editor has it.

    The parser takes more characters for the end of a line than editors do, and a browser counts
    what is beyond the first 65 536 characters of Unicode twice.
    """
    if one.position is None or not isinstance(error.source, Source):
        return Remark(None, None, 1, one.message, severity)
    read = error.source.text
    index = error.source.index(one.position)
    breaks = [match.end() for match in _BREAK.finditer(read, 0, index)]
    start = breaks[-1] if breaks else 0
    end = _BREAK.search(read, index)
    room = (end.start() if end else len(read)) - index
    underlined = read[index : index + max(min(one.length, room), 1)]
    column = 1 + _units(read[start:index])
    return Remark(len(breaks) + 1, column, _units(underlined) or 1, one.message, severity)


def _units(text: str) -> int:
    """Return the length of a text in UTF-16."""
    return len(text.encode("utf-16-le", "surrogatepass")) // 2
