"""A Model whose formulas carry the file's constants as symbols, for a page that people read."""

from __future__ import annotations

import ast
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.build import build, cost, dynamics
from quito_cli.problem.language.expressions import parse
from quito_cli.problem.model import Model
from quito_cli.problem.schema import Problem
from quito_cli.problem.scopes import Scopes
from quito_cli.problem.values import Reader

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True, eq=False)
class NamedConstants:
    """Constants that formulas carry as symbols."""

    names: tuple[str, ...]
    symbols: ca.SX
    """(names, 1)."""
    values: NDArray[np.float64]
    """(names,)."""


def with_named_constants(problem: Problem) -> tuple[Model, NamedConstants]:
    """Return a Model whose dynamics and costs carry the scalar constants as symbols.

    Those that are zero stay numbers, so that what they multiply is gone, and so do those in
    exponents, and all of them in bounds, times and constraints.

    Raises:
        ProblemError: with every mistake in its formulas, sizes and bounds.
    """
    import casadi as ca

    model, scopes = build(problem), Scopes(problem, Reader())
    fixed = _exponents(problem)
    values = {
        name: float(value)
        for name, value in scopes.constants.items()
        if value.numel() == 1 and not value.is_zero() and name not in fixed
    }
    symbols = ca.SX.sym("k", len(values))
    scopes.name_constants(dict(zip(values, ca.vertsplit(symbols), strict=True)))
    pairs = [(getattr(scopes, name), getattr(model, name)) for name in ("x", "u", "p", "t")]
    pairs += [
        (getattr(scopes.ends, end), getattr(model.ends, end)) for end in ("x0", "t0", "xf", "tf")
    ]
    lagrange, mayer = (model.sense * cost(scopes, kind) for kind in ("lagrange", "mayer"))
    old, new = map(list, zip(*pairs, strict=True))
    xdot, lagrange, mayer = ca.substitute([dynamics(scopes), lagrange, mayer], old, new)
    named = NamedConstants(tuple(values), symbols, np.array(list(values.values())))
    return replace(model, xdot=xdot, lagrange=lagrange, mayer=mayer), named


def _exponents(problem: Problem) -> set[str]:
    """Return the names that stand in exponents of dynamics, costs and expressions."""
    texts = [*problem.expressions.values(), problem.cost.lagrange, problem.cost.mayer]
    for value in problem.dynamics.values():
        texts += value if isinstance(value, list) else [value]
    found: set[str] = set()
    for text in texts:
        for node in ast.walk(parse(text).tree) if isinstance(text, str) else ():
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                names = ast.walk(node.right)
                found |= {part.id for part in names if isinstance(part, ast.Name)}
    return found
