"""Lines of a page: broken between their terms, and set in unicode or LaTeX."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

_WIDTH: Final = 100
_MARGIN: Final = len("subject to ")


@dataclass(frozen=True)
class Line:
    """A line of the page: it may be broken between its terms."""

    terms: tuple[str, ...]
    head: str = ""
    """What stands before the first term; what is broken off is aligned after it."""
    gap: str = " "


Section = tuple[str, list[Line]]


def side_by_side(texts: Sequence[str], latex: bool) -> Line:
    """Write things on one line, with commas between them."""
    commas = [text + "," for text in texts[:-1]]
    return Line((*commas, *texts[-1:]), gap=r" \quad " if latex else "  ")


def _broken(line: Line) -> list[str]:
    """Break a line between its terms where it gets too long; the first part carries the head."""
    room = _WIDTH - _MARGIN - _width(line.head)
    parts: list[str] = []
    for term in line.terms:
        longer = parts[-1] + line.gap + term if parts else term
        if parts and _width(longer) <= room:
            parts[-1] = longer
        else:
            parts.append(term)
    return [line.head + parts[0], *parts[1:]]


def _width(text: str) -> int:
    """Count the columns of a text, those of LaTeX roughly as it will be seen."""
    seen = re.sub(r"\\[A-Za-z]+ ?|\\.|[{}^_&]", lambda m: "" if len(m[0]) == 1 else "x", text)
    return sum(not unicodedata.combining(character) for character in seen)


def unicode_page(sections: Sequence[Section], unknowns: str) -> str:
    """Lay the page out as plain text."""
    rows: list[str] = []
    for title, lines in sections:
        parts = [
            " " * (_width(line.head) if i else 0) + part
            for line in lines
            for i, part in enumerate(_broken(line))
        ]
        rows += [f"{title if not i else '':<{_MARGIN}}{part}" for i, part in enumerate(parts)]
        if title in {"minimise", "maximise"} and unknowns:
            rows[-1] += f"    (over {unknowns})"
    return "\n".join(rows)


def latex_page(sections: Sequence[Section], unknowns: str) -> str:
    """Lay the page out as one display."""
    rows: list[str] = []
    for title, lines in sections:
        parts = latex_lines(lines)
        words = rf"\text{{{title}}}"
        if title in {"minimise", "maximise"} and unknowns:
            words = rf"\underset{{{unknowns}}}{{{words}}}"
        rows += [rf"{'' if i else words} \quad & {part}" for i, part in enumerate(parts)]
    body = " \\\\\n".join(row.strip() for row in rows)
    return f"\\[\n\\begin{{aligned}}\n{body}\n\\end{{aligned}}\n\\]"


def latex_lines(lines: Sequence[Line]) -> list[str]:
    """Return the lines as LaTeX, each to be set by itself; long ones are broken."""
    return [
        r"\qquad {} " * (i > 0) + re.sub(r"^-(?=\S)", "{-}", part)  # a sign, no subtraction
        for line in lines
        for i, part in enumerate(_broken(line))
    ]
