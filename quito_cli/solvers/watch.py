"""Told of every iteration of a CasADi plug-in: reports it, keeps the best, stops on request."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from quito_cli.solvers.interruption import Interruption
from quito_cli.solvers.outcome import Listener, Progress
from quito_cli.solvers.program import Program

FEASIBLE = 1e-6
"""Violation under which the better of two iterates is the cheaper one."""


class Watch(ca.Callback):
    """The iteration callback of one solve."""

    def __init__(
        self, program: Program, listener: Listener | None, interruption: Interruption
    ) -> None:
        ca.Callback.__init__(self)
        self._program, self._listener, self._interruption = program, listener, interruption
        unknowns, rows = len(program.guess), len(program.row_lower)
        self._sizes = {
            "x": unknowns,
            "f": 1,
            "g": rows,
            "lam_x": unknowns,
            "lam_g": rows,
            "lam_p": 0,
        }
        self._iteration = 0
        self.best: tuple[bool, float, dict[str, ca.DM]] | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """Every output of a solver."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Whether to stop."""
        return 1

    def get_name_in(self, i: int) -> str:
        """As the solver's output."""
        return str(ca.nlpsol_out(i))

    def get_name_out(self, i: int) -> str:
        """One."""
        return "stop"

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Dense."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arguments: Sequence[ca.DM]) -> list[int]:
        """Look at one iterate; a one asks the solver to stop."""
        point = dict(zip(self._sizes, arguments, strict=True))
        g, f = np.array(point["g"]).ravel(), float(point["f"])
        rows = np.maximum(self._program.row_lower - g, g - self._program.row_upper)
        violation = float(np.max(rows, initial=0.0))
        # The latest iterate is the best, but for a feasible and cheaper one before it.
        feasible = violation <= FEASIBLE
        if self.best is None or not self.best[0] or (feasible and f <= self.best[1]):
            self.best = feasible, f, point
        if self._listener is not None:
            cost = f / self._program.cost_scale
            self._listener(Progress(self._iteration, cost, violation))
        self._iteration += 1
        return [int(self._interruption.requested)]
