"""Which solvers are in this installation."""

from __future__ import annotations

import importlib.util
import io
from contextlib import redirect_stderr, redirect_stdout
from functools import cache

from quito_cli.solvers.backend import Backend


def available(row: Backend) -> bool:
    """Whether a solver can be loaded here; a licence is asked for only when it runs."""
    return _found(row.engine, row.plugin)


@cache
def _found(engine: str, plugin: str) -> bool:
    if engine == "scipy":
        return importlib.util.find_spec("scipy") is not None
    import casadi as ca

    has = ca.has_nlpsol if engine == "nlpsol" else ca.has_conic
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):  # it warns of missing ones
        return bool(has(plugin))
