"""The NLP as a sum of mapped terms, with exact derivatives assembled from local ones.

A term is one small function y = φ(z, θ) repeated over `count` places (cells, nodes, one endpoint).
Its inputs are gathered from all unknowns by a constant sparse matrix, z = S w, in which the weights
of the quasi-interpolant stand too; θ are numbers of the place. Each output adds to a row of the
constraints and, with a weight, to the objective:

    g = P vec(φ(S w)),   f = cᵀ vec(φ(S w)),   hence

    ∂g = P blkdiag(∂φ) S,   ∇f = Sᵀ blkdiag(∂φ)ᵀ c,   ∇²(σf + λᵀg) = Sᵀ blkdiag(∇²(νᵀφ)) S

with ν = Pᵀλ + σc. The derivatives of φ are formed once, symbolically, on a function of a few dozen
operations; nothing symbolic ever touches the large problem.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

LARGE = 10_000
"""Operations of a local function from which on common subexpressions are left alone."""
NOWHERE = -1
"""The row of an output that is no constraint."""


def sparse(shape: tuple[int, int], rows: Indices, columns: Indices, values: Array) -> ca.DM:
    """Return a CasADi matrix from triplets without duplicates."""
    import casadi as ca

    order = np.lexsort((rows, columns))
    starts = np.concatenate([[0], np.cumsum(np.bincount(columns, minlength=shape[1]))])
    pattern = ca.Sparsity(*shape, starts.tolist(), rows[order].tolist())
    return ca.DM(pattern, values[order])


@dataclass
class Gather:
    """Builds S: which unknowns, with which weights, make the inputs z of each place."""

    size: int
    """Length of z."""
    count: int
    """Number of places."""
    _rows: list[Indices] = field(default_factory=list)
    _columns: list[Indices] = field(default_factory=list)
    _values: list[Array] = field(default_factory=list)

    def take(self, inputs: Indices, unknowns: Indices) -> None:
        """Let entries `inputs` (k,) of z be `unknowns` (count, k)."""
        self.combine(inputs, unknowns[:, :, None], np.ones((*unknowns.shape, 1)))

    def combine(self, inputs: Indices, unknowns: Indices, weights: Array) -> None:
        """Let entries `inputs` (k,) of z be weighted sums of unknowns (count, k, width)."""
        places = np.arange(self.count)[:, None] * self.size + inputs[None, :]
        rows = np.broadcast_to(places[:, :, None], unknowns.shape)
        used = weights != 0
        self._rows.append(rows[used])
        self._columns.append(unknowns[used])
        self._values.append(weights[used])

    def matrix(self, scale: Array) -> ca.DM:
        """Return S, (count · size, unknowns), for unknowns in units of `scale`."""
        columns = np.concatenate(self._columns)
        return sparse(
            (self.count * self.size, len(scale)),
            np.concatenate(self._rows),
            columns,
            np.concatenate(self._values) * scale[columns],
        )


@dataclass(frozen=True)
class Term:
    """A small function φ(z, θ), where it is applied, and what its outputs add to."""

    function: ca.Function
    """SX function (z, θ) ↦ y."""
    gather: ca.DM
    """S, (n_z · count, unknowns)."""
    parameters: Array
    """θ, (n_θ, count)."""
    rows: Indices
    """(n_y, count): the row of g that an output adds to, or `NOWHERE`."""
    weights: Array
    """(n_y, count): the weight of an output in f."""

    @property
    def count(self) -> int:
        """Number of places."""
        return int(self.parameters.shape[1])

    @cached_property
    def local(self) -> LocalDerivatives:
        """Derivatives of φ; formed once."""
        return LocalDerivatives.of(self.function)

    @property
    def in_objective(self) -> bool:
        """Whether any output enters f."""
        return bool(self.weights.any())

    def scatter(self, scale: Array) -> ca.DM:
        """Return P, (rows, n_y · count), for rows multiplied by `scale`."""
        flat = self.rows.T.ravel()
        (used,) = np.nonzero(flat != NOWHERE)
        return sparse((len(scale), flat.size), flat[used], used, scale[flat[used]])


@dataclass(frozen=True)
class LocalDerivatives:
    """φ's first and second derivatives as SX functions."""

    jacobian: ca.Function
    """(z, θ) ↦ ∂φ/∂z."""
    gradient: ca.Function
    """(z, θ, ν) ↦ ∂(νᵀφ)/∂z."""
    hessian: ca.Function
    """(z, θ, ν) ↦ ∂²(νᵀφ)/∂z²."""

    @classmethod
    def of(cls, function: ca.Function) -> LocalDerivatives:
        """Differentiate."""
        import casadi as ca

        z = ca.SX.sym("z", function.size1_in(0))
        theta = ca.SX.sym("theta", function.size1_in(1))
        y = function(z, theta)
        nu = ca.SX.sym("nu", y.numel())
        hessian, gradient = ca.hessian(ca.dot(nu, y), z)
        return cls(
            _function("jacobian", [z, theta], ca.jacobian(y, z)),
            _function("gradient", [z, theta, nu], gradient),
            _function("hessian", [z, theta, nu], hessian),
        )


def _function(name: str, inputs: list[ca.SX], output: ca.SX) -> ca.Function:
    """Return a function, without common subexpressions where it pays to look for them.

    That halves some small functions; in large ones it saves 3 % and takes most of the build.
    """
    import casadi as ca

    plain = ca.Function(name, inputs, [output])
    if plain.n_instructions() > LARGE:
        return plain
    return ca.Function(name, inputs, [ca.cse(output)])


def _block_diagonal(stacked: ca.MX, block: ca.Sparsity, count: int) -> ca.MX:
    """Reinterpret [B₁ B₂ …] as blkdiag(B₁, B₂, …): the same nonzeros in the same order."""
    import casadi as ca

    starts, rows = np.array(block.colind()), np.array(block.row(), dtype=np.int64)
    places = np.arange(count)[:, None]
    colind = np.concatenate([[0], (starts[1:] + block.nnz() * places).ravel()])
    row = (rows + block.size1() * places).ravel()
    pattern = ca.Sparsity(
        count * block.size1(), count * block.size2(), colind.tolist(), row.tolist()
    )
    return ca.sparsity_cast(stacked, pattern)


@dataclass(frozen=True)
class Assembled:
    """The sum of all terms as CasADi expressions, and its derivatives as functions."""

    unknowns: ca.MX
    objective: ca.MX
    constraints: ca.MX
    gradient: ca.Function
    """(x, p) ↦ (f, ∇f), dense as IPOPT wants it."""
    jacobian: ca.Function
    """(x, p) ↦ (g, ∂g)."""
    hessian: ca.Function
    """(x, p, σ, λ) ↦ upper triangle of ∇²(σf + λᵀg)."""


def assemble(terms: tuple[Term, ...], unknowns: int, row_scale: Array) -> Assembled:
    """Return objective, constraints (times `row_scale`) and derivatives of the sum of `terms`."""
    import casadi as ca

    rows = len(row_scale)

    w, none = ca.MX.sym("w", unknowns), ca.MX.sym("p", 0, 1)
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", rows)
    f, g = ca.MX(0.0), ca.MX(rows, 1)
    gradient, jacobian = ca.MX(unknowns, 1), ca.MX(rows, unknowns)
    hessian = ca.MX(unknowns, unknowns)
    for term in terms:
        count, local = term.count, term.local
        S, P, c = ca.MX(term.gather), ca.MX(term.scatter(row_scale)), term.weights
        Z = ca.reshape(S @ w, -1, count)
        theta = ca.MX(ca.DM(term.parameters))
        Y = term.function.map(count)(Z, theta)
        nu = ca.reshape(P.T @ lam, -1, count)
        if term.rows.max() != NOWHERE:
            g += P @ ca.vec(Y)
            blocks = local.jacobian.map(count)(Z, theta)
            jacobian += P @ (_block_diagonal(blocks, local.jacobian.sparsity_out(0), count) @ S)
        if term.in_objective:
            f += ca.dot(ca.DM(c), Y)
            gradient += S.T @ ca.vec(local.gradient.map(count)(Z, theta, ca.DM(c)))
            nu += sigma * ca.DM(c)
        if local.hessian.nnz_out(0):
            blocks = local.hessian.map(count)(Z, theta, nu)
            hessian += S.T @ (_block_diagonal(blocks, local.hessian.sparsity_out(0), count) @ S)
    return Assembled(
        w,
        f,
        ca.densify(g),
        ca.Function("grad_f", [w, none], [f, ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"]),
        ca.Function("jac_g", [w, none], [g, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        ca.Function(
            "hess_lag",
            [w, none, sigma, lam],
            [ca.triu(hessian)],
            ["x", "p", "lam_f", "lam_g"],
            ["hess_gamma_x_x"],
        ),
    )
