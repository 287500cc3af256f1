"""The solvers, one row each: what it takes, how it is asked, what its words mean.

Nothing here is a branch of an engine: `nlpsol`, `conic` and `scipy` read the rows. Not rows,
because they were tried on the bundled problems and did not prove reliable:

- bonmin: IPOPT in a frame for integers, of which there are none; its multipliers come back as NaN.
- blocksqp: builds its own block Hessian, with HSL's ma27 or `linsol: ldl`; stops at residuals of
  1e-3 even on a linear-quadratic problem.
- alpaqa: stops at residuals of 1e-2 after a second on Van der Pol with 40 cells.
- sqpmethod with osqp: first-order steps are too inexact for it; it does not end on Bryson-Denham
  and raises on Van der Pol. With highs and daqp it takes no step, with proxqp it does not end.
- proxqp itself calls Bryson-Denham infeasible; daqp returns zeros; ipqp returns NaN; superscs takes
  minutes; hpipm, and fatrop as a QP solver, want the block structure of a Riccati recursion, which
  a quasi-interpolated control does not have.
- feasiblesqpmethod: wants a feasible start. scpgen, ampl: not made for a mapped program.
"""

from __future__ import annotations

from quito_cli.errors import UsageError
from quito_cli.solvers.backend import Backend
from quito_cli.solvers.rows_absent import ROWS as ABSENT
from quito_cli.solvers.rows_conic import ROWS as QUADRATIC
from quito_cli.solvers.rows_nlpsol import ROWS as NONLINEAR
from quito_cli.solvers.rows_scipy import ROWS as OPTIONAL

AUTOMATIC = "auto"
"""Not a solver, but the choice of one: see `quito_cli.solvers`."""
SOLVERS: dict[str, Backend] = {
    row.name: row for row in (*NONLINEAR, *OPTIONAL, *QUADRATIC, *ABSENT)
}


def backend(name: str) -> Backend:
    """Return the row of that name.

    Raises:
        UsageError: there is none; the message lists them.
    """
    from quito_cli.problem.text.complaints import suggest

    if name not in SOLVERS:
        names = [AUTOMATIC, *SOLVERS]
        raise UsageError(
            f"there is no solver {name!r}{suggest(name, names)}; there are {', '.join(names)}"
        )
    return SOLVERS[name]
