"""Tables -> Markdown and LaTeX, ready for a paper.

LaTeX is a `table` with a `tabular` for each block, and needs no package. Whatever comes from a file
is escaped: it is text there and nothing else.
"""

from __future__ import annotations

import re
from typing import Final

from quito_cli.comparison.comparison import Comparison
from quito_cli.comparison.table import Table, tables, text

_TEX: Final = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    **{mark: f"\\{mark}" for mark in "&%$#_{}"},
}
_MARKDOWN: Final = re.compile(r"([\\`*_\[\]<>|~])")
_INFINITY: Final = r"\infty"
_SCIENTIFIC: Final = re.compile(r"([+-]?)([\d.]+)e([+-])0*(\d+)")


def heading(comparison: Comparison) -> str:
    """Say what is compared, and against what."""
    return comparison.title or comparison.problem


def sentences(comparison: Comparison) -> tuple[str, ...]:
    """Say what the truth was, how errors were measured, and what else a reader must know."""
    said = []
    truth, samples = comparison.truth, len(comparison.sample_times)
    if truth is not None:
        facts = []
        if truth.cost is not None:
            facts.append(f"cost {text(truth.cost, '.10g')}")
        if truth.total_variation:
            facts.append(f"total variation {text(sum(truth.total_variation), '.4g')}")
        what = f" ({', '.join(facts)})" if facts else ""
        said.append(f"Held against: {truth.title}{what}.")
        zones = ", ".join(f"{a:.6g} to {b:.6g}" for a, b in comparison.zones)
        out = f"; jump zones, left out where it says outside: {zones}" if zones else ""
        said.append(f"Norm and DFT are of {samples} samples{out}.")
    said += [f"{note[0].upper()}{note[1:]}." for note in comparison.notes]
    return tuple(said)


def markdown(comparison: Comparison) -> str:
    """Return the tables as Markdown."""
    parts = [f"**{_md(heading(comparison))}**", *(_md(said) for said in sentences(comparison))]
    for table in tables(comparison):
        head = ["method", *(column.heading for column in table.columns)]
        lines = [head, ["---", *["---:"] * len(table.columns)]]
        lines += [[_md(cell) for cell in row] for row in (*table.rows, *table.published)]
        parts.append("\n".join(f"| {' | '.join(line)} |" for line in lines))
    return "\n\n".join(parts)


def latex(comparison: Comparison) -> str:
    """Return the tables as LaTeX."""
    caption = (f"{heading(comparison)}.", *sentences(comparison))
    lines = [
        r"\begin{table}",
        r"\centering",
        "\n\n\\medskip\n\n".join(_tabular(table) for table in tables(comparison)),
        rf"\caption{{{' '.join(map(_tex, caption))}}}",
        r"\end{table}",
    ]
    return "\n".join(lines)


def _tabular(table: Table) -> str:
    lines = [" & ".join(["method", *(column.latex for column in table.columns)]) + r" \\ \hline"]
    for rows in (table.rows, table.published):
        lines += [" & ".join([_tex(row[0]), *map(_tex_figure, row[1:])]) + r" \\" for row in rows]
        lines[-1] += r" \hline" if rows else ""
    columns = "l" + "r" * len(table.columns)
    return "\n".join([rf"\begin{{tabular}}{{{columns}}} \hline", *lines, r"\end{tabular}"])


def _md(given: str) -> str:
    return _MARKDOWN.sub(r"\\\1", " ".join(given.split()))


def _tex(given: str) -> str:
    return "".join(_TEX.get(character, character) for character in " ".join(given.split()))


def _tex_figure(figure: str) -> str:
    """Return a number in mathematics: a minus is a minus there, and a power a power."""
    if found := _SCIENTIFIC.fullmatch(figure):
        sign, digits, minus, power = found.groups()
        return rf"${sign}{digits}\times10^{{{'-' if minus == '-' else ''}{power}}}$"
    return "--" if figure == "-" else f"${figure.replace('inf', _INFINITY)}$"
