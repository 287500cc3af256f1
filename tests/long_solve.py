"""A solve that takes minutes of quick iterations, for tests that interrupt it."""

from __future__ import annotations

import re

from quito_cli.problem.library import bundled

_SLOWLY = (
    "options: {steps: 901, max_iterations: 10000, solver_options: {barrier_tol_factor: 1.0e-4, "
    "mu_linear_decrease_factor: 0.999, mu_superlinear_decrease_power: 1.0001}}\n"
)
"""The barrier parameter is lowered by a thousandth at a time."""
LONG = re.sub(
    r"^options:.*\n", _SLOWLY, bundled()["van_der_pol"].read_text("utf-8"), flags=re.MULTILINE
)
