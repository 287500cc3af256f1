"""How the benchmarks measure: alternating runs, medians, ratios, and a table on the terminal.

Run all of them, single-threaded, on an otherwise idle machine:

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks

Ratios are those of neighbouring runs (A B A B …), and their median counts, so that a machine that
slows down in between slows both sides. Limits are asserted with a margin (`GUARD`); the tables
say by how much the limit itself is kept.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import TypeVar

import pytest

ROOT = Path(__file__).parents[2]
GUARD = 1.25
"""Limits are asserted with this margin: a busy machine is no reason to fail."""
SINGLE_THREADED = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

for _name, _value in SINGLE_THREADED.items():  # read when IPOPT's linear algebra is first loaded
    os.environ.setdefault(_name, _value)

A = TypeVar("A")
B = TypeVar("B")


def interleaved(first: Callable[[], A], second: Callable[[], B], rounds: int) -> list[tuple[A, B]]:
    """Return what `first` and `second` give, called in turn, after one call of each for warmth."""
    first()
    second()
    return [(first(), second()) for _ in range(rounds)]


def median_ratio(pairs: Sequence[tuple[float, float]]) -> float:
    """Return the median of the ratios first/second of neighbouring runs."""
    return median(a / b for a, b in pairs)


def process_seconds(*arguments: str, bytecode: Path) -> float:
    """Return the wall-clock time of one Python process, from its start to its end.

    Args:
        *arguments: of the interpreter.
        bytecode: folder that compiled modules are kept in, for the package as well as for the
            libraries, as an installed package has them.
    """
    started = time.perf_counter()
    process_output(*arguments, bytecode=bytecode)
    return time.perf_counter() - started


def process_output(*arguments: str, bytecode: Path | None = None) -> str:
    """Return what a Python process prints, started where the package is found.

    Args:
        *arguments: of the interpreter.
        bytecode: folder that compiled modules are kept in; None leaves that to the environment.
    """
    environment = os.environ | SINGLE_THREADED
    if bytecode is not None:
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        environment["PYTHONPYCACHEPREFIX"] = str(bytecode)
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def show(capsys: pytest.CaptureFixture[str], title: str, rows: Sequence[Sequence[str]]) -> None:
    """Print a table, headings in its first row, past pytest's capture."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in rows]
    with capsys.disabled():
        print("\n\n" + title)
        print("\n".join(lines))
