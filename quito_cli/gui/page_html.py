"""Small pieces of HTML from text that nobody has looked at: all of it is escaped here."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

_NUMBER = re.compile(r"[+-]?[\d.]+(e[+-]?\d+)?%?|–|-|inf|nan", re.IGNORECASE)


def table(
    caption: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    helps: Sequence[str] = (),
    classes: Sequence[str] = (),
) -> str:
    """Return a table whose rows begin with their heads.

    Args:
        caption: what it is about; none where it is empty.
        heads: of the columns; no line of heads where there are none.
        rows: texts by row.
        helps: what the columns mean, shown where a pointer rests on a head.
        classes: of each row, for its last cell.
    """
    parts = ["<div class='scrolled' tabindex='0'><table class='data'>"]
    if caption:
        parts.append(f"<caption>{escape(caption)}</caption>")
    if heads:
        titles = [*helps, *[""] * len(heads)]
        cells = (
            f"<th scope='col' title='{escape(title)}'>{escape(head)}</th>"
            for head, title in zip(heads, titles, strict=False)
        )
        parts.append(f"<thead><tr>{''.join(cells)}</tr></thead>")
    parts.append("<tbody>")
    for i, row in enumerate(rows):
        kind = f" class='{escape(classes[i])}'" if i < len(classes) else ""
        cells = (f"<td{_align(text)}>{escape(text)}</td>" for text in row[1:])
        parts.append(f"<tr{kind}><th scope='row'>{escape(row[0])}</th>{''.join(cells)}</tr>")
    return "".join([*parts, "</tbody></table></div>"])


def _align(text: str) -> str:
    return " class='number'" if _NUMBER.fullmatch(text.strip()) else ""


def notes(texts: Sequence[str], kind: str) -> str:
    """Return sentences, each in a box; `kind` is plain, warn or bad."""
    return "".join(f"<div class='note {escape(kind)}'>{escape(text)}</div>" for text in texts)


def paragraph(text: str) -> str:
    """Return a paragraph."""
    return f"<p>{escape(text)}</p>" if text else ""
