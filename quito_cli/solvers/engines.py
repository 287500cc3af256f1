"""The engines by name, each imported when it is first asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from quito_cli.solvers.asking import Request
from quito_cli.solvers.outcome import Outcome
from quito_cli.solvers.program import Program

Engine = Callable[[Program, Request], Outcome]


def _imported(name: str) -> Callable[[], Engine]:
    def engine() -> Engine:
        found: Engine = importlib.import_module(f"quito_cli.solvers.{name}").solve
        return found

    return engine


ENGINES: dict[str, Callable[[], Engine]] = {
    name: _imported(name) for name in ("nlpsol", "conic", "scipy")
}
