"""Whole processes: what the command costs beside the libraries that it cannot do without.

    OMP_NUM_THREADS=1 pytest -m benchmark tests/benchmarks/test_startup.py

Processes alternate (A B A B …), and medians count; all modules are compiled before, as those of an
installed package are. The limits are those this project set itself:
`quito --help` at most 1.5 times `import typer, rich`; `quito solve alychan --no-plot` at most 1.6
times the import of what any such program imports, plus the solve; `quito check alychan` at most
1.5 times the import of what reading a problem takes.
"""

from __future__ import annotations

from pathlib import Path
from statistics import median

import pytest
from measuring import GUARD, interleaved, median_ratio, process_seconds, show

import quito_cli as quito

ROUNDS = 15
HELP_LIMIT = 1.5
SOLVE_LIMIT = 1.6
CHECK_LIMIT = 1.5
COMMAND_LINE = ("-c", "import typer, rich")
LIBRARIES = ("-c", "import casadi, h5py, pydantic, typer, yaml")
READING = ("-c", "import casadi, pydantic, typer, yaml")
COMMAND = ("-m", "quito_cli")


@pytest.fixture(scope="module")
def bytecode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for compiled modules, filled by the first runs, which are not counted."""
    return tmp_path_factory.mktemp("bytecode")


def _solve_seconds() -> float:
    """Return build plus solve of Aly–Chan, everything loaded, in the median."""
    problem = quito.load("alychan")
    solutions = [quito.solve(problem) for _ in range(ROUNDS)]
    return median(s.statistics.build_seconds + s.statistics.solve_seconds for s in solutions)


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f}"


@pytest.mark.benchmark
def test_help(bytecode: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ratio of the process `quito --help` to the process `import typer, rich`."""
    pairs = interleaved(
        lambda: process_seconds(*COMMAND, "--help", bytecode=bytecode),
        lambda: process_seconds(*COMMAND_LINE, bytecode=bytecode),
        ROUNDS,
    )
    ratio = median_ratio(pairs)
    rows = [
        ["process", "median ms"],
        ["quito --help", _milliseconds(median(p[0] for p in pairs))],
        ["import typer, rich", _milliseconds(median(p[1] for p in pairs))],
    ]
    show(capsys, f"quito --help: ratio {ratio:.2f} (limit {HELP_LIMIT})", rows)
    assert ratio <= GUARD * HELP_LIMIT


@pytest.mark.benchmark
def test_solve(bytecode: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ratio of the process `quito solve alychan --no-plot` to imports in a process plus the solve.

    The solve is build plus solve in a process that has everything loaded, which leaves the reading
    of the file, the evidence and the writing of the result to be paid from the limit.
    """
    solve = (*COMMAND, "solve", "alychan", "--no-plot", "-o", str(tmp_path))
    solving = _solve_seconds()
    pairs = interleaved(
        lambda: process_seconds(*solve, bytecode=bytecode),
        lambda: process_seconds(*LIBRARIES, bytecode=bytecode),
        ROUNDS,
    )
    ratio = median_ratio([(ours, imports + solving) for ours, imports in pairs])
    rows = [
        ["process", "median ms"],
        ["quito solve alychan --no-plot", _milliseconds(median(p[0] for p in pairs))],
        ["import casadi, h5py, pydantic, typer, yaml", _milliseconds(median(p[1] for p in pairs))],
        ["build and solve", _milliseconds(solving)],
    ]
    show(capsys, f"quito solve: ratio {ratio:.2f} (limit {SOLVE_LIMIT})", rows)
    assert ratio <= GUARD * SOLVE_LIMIT


@pytest.mark.benchmark
def test_check(bytecode: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ratio of the process `quito check alychan` to the process that imports what it imports."""
    pairs = interleaved(
        lambda: process_seconds(*COMMAND, "check", "alychan", bytecode=bytecode),
        lambda: process_seconds(*READING, bytecode=bytecode),
        ROUNDS,
    )
    ratio = median_ratio(pairs)
    rows = [
        ["process", "median ms"],
        ["quito check alychan", _milliseconds(median(p[0] for p in pairs))],
        ["import casadi, pydantic, typer, yaml", _milliseconds(median(p[1] for p in pairs))],
    ]
    show(capsys, f"quito check: ratio {ratio:.2f} (limit {CHECK_LIMIT})", rows)
    assert ratio <= GUARD * CHECK_LIMIT
