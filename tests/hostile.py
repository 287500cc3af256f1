"""Jobs for workers of a batch that do what no solve should, by the `kind` among a case's axes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from quito_cli.batch.case import Case, Ending, Finished
from quito_cli.batch.solving import BEGUN, result_path, solve_case

LONG = 100.0
"""Seconds that nobody waits for."""


def job(case: Case, guess: Path | None, folder: Path, *rest: Any) -> Finished:
    """Do what the case is for."""
    tell: Callable[[Any], None] = rest[-1]
    kind = str(case.axes.get("kind", "good"))
    if kind == "frail":
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    tell(BEGUN)
    if kind == "crash":
        os.write(2, b"double free or corruption\n")
        os.abort()
    if kind == "leave":
        os._exit(5)
    if kind == "hang":
        time.sleep(LONG)
    if kind == "deaf":
        tell("here")
        deaf()
    if kind == "frail":
        tell("here")
        time.sleep(LONG)
    if kind == "hoard":
        held = []
        while True:
            held.append(bytearray(b"1") * 20_000_000)
            time.sleep(0.01)
    if kind == "bug":
        raise KeyError("nobody expected this")
    if kind == "unsolved":
        return Finished(case, Ending.UNSOLVED, "no", {}, (), 0.0, None)
    if kind == "slow":
        time.sleep(0.3)
    figures = {"cost": 1.0, "guess": None if guess is None else guess.stem, "process": os.getpid()}
    return Finished(case, Ending.PASSED, "yes", figures, (), 0.0, result_path(folder, case.name))


def deaf() -> None:
    """Go on whatever is asked."""
    while True:
        try:
            time.sleep(LONG)
        except KeyboardInterrupt:
            continue


def copy(case: Case, guess: Path | None, folder: Path, *rest: Any) -> Finished:
    """Save the answer that the case names as its problem once more, as a solve would."""
    import quito_cli as quito

    rest[-1](BEGUN)
    time.sleep(0.02)
    solution = quito.Solution.load(case.problem)
    path = result_path(folder, case.name)
    solution.save(path)
    return Finished(case, Ending.PASSED, "yes", {"cost": solution.cost}, (), 0.0, path)


def solved(case: Case, *rest: Any) -> Finished:
    """Solve as ever, the named ones excepted."""
    return job(case, *rest) if "kind" in case.axes else solve_case(case, *rest)
