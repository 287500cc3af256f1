"""quito: constrained optimal control from a YAML file.

    import quito_cli as quito
    solution = quito.solve("problems/alychan.yaml", steps=100, variance=2)

The public names are here; everything else may move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

# Not deferred: `quito_cli.solve` is a module too, and the function is to have the name.
from quito_cli.options import Options
from quito_cli.solve import solve

if TYPE_CHECKING:
    from quito_cli.batch.reports.report import Report
    from quito_cli.batch.running import run_suite
    from quito_cli.batch.sweeps.sweeping import sweep
    from quito_cli.comparison.compare import compare
    from quito_cli.comparison.comparison import Comparison
    from quito_cli.comparison.results import compare_results
    from quito_cli.errors import QuitoError, ResultFileError, UnavailableError, UsageError
    from quito_cli.problem.load import load
    from quito_cli.problem.schema import Problem
    from quito_cli.problem.text.complaints import ProblemError
    from quito_cli.solution.solution import Solution

__version__ = "0.1.0"

_HOMES = {
    "Comparison": "quito_cli.comparison.comparison",
    "compare": "quito_cli.comparison.compare",
    "compare_results": "quito_cli.comparison.results",
    "Problem": "quito_cli.problem.schema",
    "ProblemError": "quito_cli.problem.text.complaints",
    "QuitoError": "quito_cli.errors",
    "Report": "quito_cli.batch.reports.report",
    "ResultFileError": "quito_cli.errors",
    "Solution": "quito_cli.solution.solution",
    "UnavailableError": "quito_cli.errors",
    "UsageError": "quito_cli.errors",
    "load": "quito_cli.problem.load",
    "run_suite": "quito_cli.batch.running",
    "sweep": "quito_cli.batch.sweeps.sweeping",
}

__all__ = [
    "Comparison",
    "Options",
    "Problem",
    "ProblemError",
    "QuitoError",
    "Report",
    "ResultFileError",
    "Solution",
    "UnavailableError",
    "UsageError",
    "compare",
    "compare_results",
    "load",
    "run_suite",
    "solve",
    "sweep",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: `quito --help` needs none of them."""
    if name not in _HOMES:
        raise AttributeError(f"module 'quito_cli' has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(_HOMES[name]), name)
