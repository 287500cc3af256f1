"""The tables of a comparison: what stands in them, as text, Markdown and LaTeX."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import quito_cli as quito
from quito_cli.cli.comparison import print_comparison
from quito_cli.comparison.comparison import Comparison
from quito_cli.comparison.dictionary import as_dictionary
from quito_cli.comparison.table import COLUMNS, by_control, tables, text
from quito_cli.comparison.writing import latex, markdown
from quito_cli.problem.load import load_text
from quito_cli.problem.schema_reference import Published

TEXT = """\
title: "100 % of $x_1$ & {more} #1 ~ x^2 \\\\input | *bold*"
time: {initial: 0, final: 1}
states: {x_1: {initial: 0, final: 1}}
controls: {u_1: {lower: -3, upper: 3}}
dynamics: {x_1: u_1}
cost: {lagrange: u_1^2}
reference:
  cost: 1
  switching_times: [0.5]
  control: {u_1: [{until: 0.5, value: 0}, {value: 1}]}
published:
  - tool: "A_B 50 % | \\\\end{table}"
    steps: 400
    time: 5
    iterations: 16
    violation: 5.4e-19
    dft_norm: 39.2
  - {tool: silent}
"""


@pytest.fixture(scope="module")
def found() -> Comparison:
    return quito.compare(load_text(TEXT, "hard.yaml"), "piecewise-constant", steps=6)


def test_columns_that_nobody_fills_are_left_out(found: Comparison) -> None:
    keys = {column.key for table in tables(found) for column in table.columns}
    every = {column.key for given in COLUMNS.values() for column in given}
    assert every - keys == {"state_error", "polish_seconds"}, "no state is known, none polished"
    calm = replace(found, zones=())
    keys = {column.key for table in tables(calm) for column in table.columns}
    assert every - keys == {"state_error", "polish_seconds", "error_sup_outside"}


def test_published_rows_are_marked_and_stand_where_they_have_something(found: Comparison) -> None:
    shown = {table.title: table.published for table in tables(found)}
    assert [len(rows) for rows in shown.values()] == [1, 1, 1, 0]
    ((tool, *figures),) = shown["Solve"]
    assert tool.endswith(", 400 steps (published)")
    assert figures == ["-", "16", "-", "-", "5"]
    ((_, *errors),) = shown["Error of the control"]
    assert errors == ["-", "-", "-", "-", "-", "39.2"]


def test_figures() -> None:
    assert [text(value, ".2e") for value in (None, float("nan"), 0.0, 1e-3, float("inf"))] == [
        *("-", "-", "0", "1.00e-03", "inf")
    ]


def test_tables_fit_a_terminal(found: Comparison, capsys: pytest.CaptureFixture[str]) -> None:
    plain = replace(found, published=(Published(tool="ICLOCS2 (LGR)", steps=400, time=5),))
    print_comparison(plain, (), verbose=False)
    lines = capsys.readouterr().out.splitlines()
    table = [line for line in lines if line.startswith("  ")]
    assert len(table) > 12
    assert max(map(len, table)) <= 100


def test_a_narrow_terminal_has_the_names_above_their_figures(
    found: Comparison, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    print_comparison(found, (), verbose=False)
    wide = capsys.readouterr().out.split()
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "64")
    print_comparison(found, (), verbose=False)
    printed = re.sub(r"\x1b\[\d+m", "", capsys.readouterr().out)
    table = [line for line in printed.splitlines() if line.startswith("  ")]
    assert max(map(len, table)) <= 64
    assert table[1] == "  quasi-interpolant:gaussian"
    kept = printed.split()
    assert [kept.count(cell) for cell in wide if cell != "method"] == [
        wide.count(cell) for cell in wide if cell != "method"
    ]


def test_verbose_says_what_every_column_means(
    found: Comparison, capsys: pytest.CaptureFixture[str]
) -> None:
    print_comparison(found, (), verbose=True)
    printed = capsys.readouterr().out
    for table in tables(found):
        for column in table.columns:
            assert column.help in printed


def test_each_of_several_controls_by_itself(
    found: Comparison, capsys: pytest.CaptureFixture[str]
) -> None:
    assert by_control(found) is None, "one control is in the tables already"
    several = quito.compare("siri", "piecewise-constant", steps=12)
    table = by_control(several)
    assert table is not None
    assert [row[0] for row in table.rows] == [
        f"u{i} by {row.method}" for i in (1, 2, 3) for row in several.rows
    ]
    at = [column.key for column in table.columns].index("error_l2") + 1
    alone = [float(row[at]) for row in table.rows if "piecewise" in row[0]]
    together = several.rows[1].errors
    assert together is not None
    assert np.linalg.norm(alone) == pytest.approx(together.l2, rel=0.01)
    assert not {"state_error", "switching_error"} & {column.key for column in table.columns}
    for verbose in (True, False):
        print_comparison(several, (), verbose=verbose)
        assert ("u2 by piecewise-constant" in capsys.readouterr().out) is verbose


def cells(line: str) -> list[str]:
    return re.split(r"(?<!\\)\|", line)[1:-1]


def test_markdown_is_a_table_whatever_the_file_says(found: Comparison) -> None:
    page = markdown(found)
    blocks = [block.splitlines() for block in page.split("\n\n") if block.startswith("|")]
    assert len(blocks) == len(tables(found))
    for block, table in zip(blocks, tables(found), strict=True):
        assert all(len(cells(line)) == len(table.columns) + 1 for line in block)
        assert set(block[1]) <= set("|-: ")
        assert len(block) == 2 + len(table.rows) + len(table.published)
    assert r"**100 % of $x\_1$ & {more} #1 \~ x^2 \\input \| \*bold\***" in page
    assert r"A\_B 50 % \| \\end{table}, 400 steps (published)" in page


def test_latex_is_balanced_and_escaped(found: Comparison) -> None:
    page = latex(found)
    assert page.startswith("\\begin{table}")
    assert page.endswith("\\end{table}")
    begun, ended = re.findall(r"\\begin\{(\w+)\}", page), re.findall(r"\\end\{(\w+)\}", page)
    assert sorted(begun) == sorted(ended)
    assert begun.count("tabular") == len(tables(found))
    bare = re.sub(r"\\[\\%&_#${}]", "", page)
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    outside = re.sub(r"\$.*?\$", "", bare)
    assert not set(outside) & set("%#~|^_<>"), "each would be a command, or print as another sign"
    for tabular, table in zip(
        re.findall(r"\\begin\{tabular\}\{(l(r+))\}(.*?)\\end", page, re.DOTALL),
        tables(found),
        strict=True,
    ):
        assert len(tabular[1]) == len(table.columns)
        rows = re.findall(r"^(.*) \\\\", tabular[2], re.MULTILINE)
        assert len(rows) == 1 + len(table.rows) + len(table.published)
        for row in rows:
            assert len(re.findall(r"(?<!\\)&", row)) == len(table.columns)
    assert r"100 \% of \$x\_1\$ \& \{more\} \#1 \textasciitilde{} x\textasciicircum{}2" in page
    assert r"\textbackslash{}input" in page
    assert r"$5.4\times10^{-19}$" in page


def test_json_names_controls_and_states(found: Comparison) -> None:
    said = as_dictionary(found)
    assert list(said["rows"][0]["controls"]) == ["u_1"]
    assert list(said["rows"][0]["states"]) == ["x_1"]
    assert said["published"][1] == {"tool": "silent"}
    assert said["rows"][1]["switching_times"][0]["known"] == 0.5


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="LaTeX is not here")
def test_latex_compiles(found: Comparison, tmp_path: Path) -> None:
    page = f"\\documentclass{{article}}\n\\begin{{document}}\n{latex(found)}\n\\end{{document}}\n"
    (tmp_path / "page.tex").write_text(page, encoding="utf-8")
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "page"],
        cwd=tmp_path,
        capture_output=True,
        check=False,
        timeout=60,
    )
    log = (tmp_path / "page.log").read_text(encoding="utf-8", errors="replace")
    assert done.returncode == 0, log[-2000:]
    assert (tmp_path / "page.pdf").is_file()
