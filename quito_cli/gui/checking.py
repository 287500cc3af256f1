"""Text of a problem -> complaints at their lines, and its formulas; safe with any text.

Problem text is untrusted: it is looked at in a process of its own, limited in time and memory,
and one that is slow is ended and begun anew.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Remark:
    """A complaint for the editor."""

    line: int | None
    """From 1; None where it belongs to the whole text."""
    column: int | None
    length: int
    """Characters to underline, in that line."""
    message: str
    severity: str
    """error or warning."""


@dataclass(frozen=True)
class Block:
    """A part of the problem as mathematics."""

    title: str
    """minimise, `subject to`, where, with."""
    lines: tuple[str, ...]
    """Each a formula in LaTeX, to be set in display style; amsmath's commands are used."""


@dataclass(frozen=True)
class Checked:
    """What is to be said of a text."""

    remarks: tuple[Remark, ...]
    title: str
    formulas: tuple[Block, ...]
    """Empty where the text has errors."""
    unicode: str
    """The same as plain text, for readers of screens; empty where the text has errors."""
    options: dict[str, object]
    """What the text asks of the solver in its `options`; empty where it has errors."""
    late: str = ""
    """Why it could not be looked at in time; else empty."""

    @property
    def ok(self) -> bool:
        """Whether it can be solved."""
        return not self.late and all(remark.severity != "error" for remark in self.remarks)


class Checker:
    """Looks at texts, one at a time, in a process of its own."""

    def __init__(self, seconds: float, memory: int, characters: int) -> None:
        raise NotImplementedError

    async def check(self, text: str, name: str) -> Checked:
        """Look at a text; never raises for anything in it.

        Calls take their turns; the asyncio loop is free meanwhile.
        """
        raise NotImplementedError

    def close(self) -> None:
        """End the process."""
