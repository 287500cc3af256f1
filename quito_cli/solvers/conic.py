"""Solvers of quadratic programs that are plug-ins of CasADi's `conic`, asked directly.

    ½ wᵀHw + gᵀw  over  lower ≤ w ≤ upper,  row_lower − c ≤ A w ≤ row_upper − c

with H, g, A and c from the assembled derivatives at w = 0: of a quadratic program these are all of
it. Whether it is one, `transcription.structure` knows.
"""

from __future__ import annotations

import io
import time
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

import casadi as ca
import numpy as np

from quito_cli.solvers.asking import (
    Request,
    count_of,
    last_line,
    quiet,
    refusal,
    refuse_unknown,
    settings,
    status_of,
)
from quito_cli.solvers.interruption import interruptible
from quito_cli.solvers.outcome import Outcome, Status
from quito_cli.solvers.program import Program


def solve(program: Program, request: Request) -> Outcome:
    """Minimise a quadratic program.

    Raises:
        UsageError: the solver does not know an option, or its value.
    """
    row = request.backend
    started = time.perf_counter()
    data = _data(program)
    solver = _built(request, data)
    built = time.perf_counter()
    failure = None
    with interruptible() as interruption:
        try:
            with quiet(request):
                point = solver(**data)
        except RuntimeError as error:
            failure, point = last_line(error), {}
    if failure and "option" in failure.lower():
        raise refusal(row, failure)
    solved = time.perf_counter()
    statistics = {} if failure else dict(solver.stats())
    status, said = (Status.FAILED, failure) if failure else status_of(row, statistics)
    if interruption.requested and status is not Status.SOLVED:
        status = Status.INTERRUPTED
    unknowns, rows = len(program.guess), len(program.row_lower)
    return Outcome(
        status=status,
        w=np.array(point.get("x", program.guess)).ravel(),
        lam_g=np.array(point.get("lam_a", np.zeros(rows))).ravel(),
        lam_w=np.array(point.get("lam_x", np.zeros(unknowns))).ravel(),
        iterations=count_of(row, statistics),
        history={},
        build_seconds=built - started,
        solve_seconds=solved - built,
        said=said,
        solver=row.name,
    )


def _data(program: Program) -> dict[str, Any]:
    """Return the arguments of a conic solver."""
    origin = np.zeros(len(program.guess))
    rows, A = program.jacobian(origin, [])
    offset = np.array(rows).ravel()
    return {
        "h": ca.triu2symm(program.hessian(origin, [], 1.0, np.zeros(len(offset)))),
        "g": program.gradient(origin, [])[1],
        "a": A,
        "lbx": program.lower,
        "ubx": program.upper,
        "lba": program.row_lower - offset,
        "uba": program.row_upper - offset,
        "x0": program.guess,
    }


def _built(request: Request, data: dict[str, Any]) -> ca.Function:
    """Return the solver; what it prints about a wrong option becomes the message."""
    row = request.backend
    if row.group is None:
        refuse_unknown(row, request.options, tuple(ca.conic_options(row.plugin)))
    shape = {"h": data["h"].sparsity(), "a": data["a"].sparsity()}
    options = {"print_time": False, "error_on_fail": False, **settings(request, warm=False)}
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            return ca.conic("quito", row.plugin, shape, options)
    except RuntimeError as error:
        raise refusal(row, last_line(error)) from None
