"""Whether a nonlinear program is a quadratic one: read off its local functions.

It is where every row is affine in the unknowns and every part of the cost has a Hessian that does
not depend on them. Both are questions about small functions of one cell, asked structurally: what
looks nonlinear and is not, such as x*y − x*y, counts as nonlinear.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quito_cli.transcription.terms import NOWHERE, Term

if TYPE_CHECKING:
    from quito_cli.transcription.transcribe import Nlp


def nonlinearity(nlp: Nlp) -> str | None:
    """Return what keeps `nlp` from being a quadratic program, by name; None where it is one."""
    for term in nlp.terms:
        if not term.local.hessian.nnz_out(0):
            continue
        row = _first_nonlinear_row(term)
        if row is not None:
            return _told(nlp, row)
        if term.in_objective and _hessian_varies(term):
            dynamics = nlp.transcription.dynamics.terms
            along = any(term.function is own.function for own in dynamics) or term.count > 1
            return f"cost.{'lagrange' if along else 'mayer'} is not quadratic"
    return None


def _told(nlp: Nlp, row: int) -> str:
    """Say that a row is not linear, in the words of the problem file.

    In the steps of an integrator every state may depend on every other: whose own dynamics are to
    blame is asked of the model.
    """
    import casadi as ca

    block = next(b for b in nlp.blocks if b.first <= row < b.first + b.count)
    if block.name != "dynamics":
        return f"the {block.name} is not linear"
    model = nlp.transcription.model
    curved = ca.which_depends(model.xdot, ca.vertcat(model.x, model.u, model.p), 2, True)
    if not any(curved):
        return "the horizon is free"
    return f"the dynamics of {block.labels[int(np.argmax(curved))]} is not linear"


def _first_nonlinear_row(term: Term) -> int | None:
    """Return a row of g that is not affine in the unknowns."""
    import casadi as ca

    function = term.function
    z, theta = ca.SX.sym("z", function.size1_in(0)), ca.SX.sym("theta", function.size1_in(1))
    outputs = [i for i in range(len(term.rows)) if term.rows[i].max() != NOWHERE]
    if not outputs:
        return None
    curved = ca.which_depends(function(z, theta)[outputs], z, 2, True)
    if not any(curved):
        return None
    return int(term.rows[outputs[int(np.argmax(curved))]].max())


def _hessian_varies(term: Term) -> bool:
    """Whether the Hessian of the term's part of the cost depends on the unknowns."""
    import casadi as ca

    function = term.function
    z, theta = ca.SX.sym("z", function.size1_in(0)), ca.SX.sym("theta", function.size1_in(1))
    weights = [ca.SX.sym("nu") if row.any() else ca.SX(0) for row in term.weights]
    return bool(ca.depends_on(term.local.hessian(z, theta, ca.vertcat(*weights)), z))
