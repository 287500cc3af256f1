"""The problem as mathematics on the page: LaTeX -> MathML, which browsers show by themselves.

Each formula is a row of a table, so that a narrow page may scroll it. `latex2mathml` writes
characters as entities, and undoes all escaping at the end, which would let a `<` of a problem file
become a tag; so its tree is taken instead, characters are put in, and it is serialised here,
escaped.
"""

from __future__ import annotations

import html
import re
from xml.etree import ElementTree

from quito_cli.gui.checking import Block, Checked

_FONTS = re.compile(r"\\(ttfamily|rmfamily)\b\s*")
"""Commands of fonts within text, which MathML has not."""
_LETTERS = ((ord("A"), 0x1D400), (ord("a"), 0x1D41A))
_BOLD = str.maketrans({chr(a + i): chr(bold + i) for a, bold in _LETTERS for i in range(26)})
"""Letters to bold ones: browsers no longer read `mathvariant="bold"`."""


def mathml(latex: str) -> str:
    """Return a formula as a MathML element in which no text can be a tag."""
    from latex2mathml.converter import convert_to_element

    root = convert_to_element(_FONTS.sub("", latex))
    for node in root.iter():
        if node.text:
            node.text = html.unescape(node.text)
            if node.get("mathvariant") == "bold":
                node.text = node.text.translate(_BOLD)
                del node.attrib["mathvariant"]
    return ElementTree.tostring(root, encoding="unicode")


def formulas(checked: Checked) -> str:
    """Return the problem as a table in HTML; where a formula cannot be set, as plain text."""
    try:
        rows = [row for block in checked.formulas for row in _rows(block)]
    except Exception:  # of a library that refuses what it does not know, by many kinds of errors
        return f"<pre>{html.escape(checked.unicode)}</pre>"
    return f"<table>{''.join(rows)}</table>"


def _rows(block: Block) -> list[str]:
    """Return the rows of a part; the first says what the part is."""
    over = f" <span class='over'>over {mathml(block.over)}</span>" if block.over else ""
    heads = [html.escape(block.title) + over, *[""] * len(block.lines)]
    return [
        f"<tr><th scope='row'>{head}</th><td>{mathml(line)}</td></tr>"
        for head, line in zip(heads, block.lines, strict=False)
    ]
