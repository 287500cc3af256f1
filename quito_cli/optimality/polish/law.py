"""The law of a phase: what its controls and multipliers are, given states and costates.

With z = (u of free and singular controls, η of held rows) and C the held equations,

    (H + ηᵀC)_u = 0  for free controls,     C = 0  for held rows,     A u + B = 0  for singular ones

determine z pointwise; the flow is x' = f, λ' = −(H + ηᵀC)_x, with the integrands of the integral
constraints and (H + ηᵀC)_p integrated beside. Of a state constraint C is its q-th derivative and η
the multiplier of indirect adjoining (`quito_cli.optimality.constraints`). Where z moves with
y = (x, λ), and with t, p, ν, by the implicit function: G_z dz = −G_y dy.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.setting import Setting
from quito_cli.optimality.polish.structure import Phase

if TYPE_CHECKING:
    import casadi as ca

Array = NDArray[np.float64]

PASSES = 25
"""Newton's steps for z: it follows from one iteration to the next, and few are needed."""
SETTLED = 1e-13
"""Relative change of z below which it is found."""


@dataclass(frozen=True, eq=False)
class Values:
    """A flow at points."""

    z: Array
    """(n, n_z)."""
    rates: Array
    """(n, 2 n_x + n_w): x', λ' and what is integrated."""
    slopes: Array
    """(n, 2 n_x + n_w, 2 n_x + 1 + n_p + n_ν): their derivatives in y, t, p, ν."""


@dataclass(frozen=True, eq=False)
class Law:
    """A phase's law, as functions of v = (x, λ, t, p, ν) and z."""

    setting: Setting
    phase: Phase

    @cached_property
    def between(self) -> tuple[int, ...]:
        """Controls that are not at bounds."""
        return tuple(i for i, k in enumerate(self.phase.kinds) if k in ("free", "singular"))

    @cached_property
    def held(self) -> tuple[tuple[int, bool], ...]:
        """Held rows, in order."""
        return tuple(sorted(self.phase.held))

    @cached_property
    def bounds(self) -> Array:
        """(n_u,) values of controls at bounds; NaN where they are not."""
        bounds = self.setting.system.model.control_bounds
        values = {"lower": bounds.lower, "upper": bounds.upper}
        return np.array(
            [values[k][i] if k in values else np.nan for i, k in enumerate(self.phase.kinds)]
        )

    @cached_property
    def unknown(self) -> ca.SX:
        """Symbols of z."""
        import casadi as ca

        system = self.setting.system
        u = [system.model.u[i] for i in self.between]
        return ca.vertcat(*u, *(system.multipliers[r] for r, _ in self.held))

    @cached_property
    def known(self) -> ca.SX:
        """Symbols of v."""
        import casadi as ca

        system, m = self.setting.system, self.setting.system.model
        return ca.vertcat(m.x, system.costate, m.t, m.p, system.integral_multipliers)

    @cached_property
    def adjoined(self) -> ca.SX:
        """H + ηᵀC, scalar."""
        system, value = self.setting.system, self.setting.system.hamiltonian
        for held in self.held:
            value = value + system.multipliers[held[0]] * self.setting.active(held).held
        return value

    @cached_property
    def equations(self) -> ca.SX:
        """G(z, v), (n_z, 1)."""
        import casadi as ca

        system, kinds = self.setting.system, self.phase.kinds
        found = []
        arc = self.setting.singular(self.phase)
        rows = (
            {}
            if arc is None
            else dict(zip(arc.controls, _feedback(arc, system.model.u), strict=True))
        )
        for i in self.between:
            if kinds[i] == "singular":
                found.append(rows[i])
            else:
                found.append(ca.gradient(self.adjoined, system.model.u[i]))
        found += [self.setting.active(held).held for held in self.held]
        return ca.densify(ca.vertcat(*found)) if found else ca.SX(0, 1)

    @cached_property
    def flow(self) -> ca.SX:
        """x', λ' and what is integrated, stacked."""
        import casadi as ca

        m, value = self.setting.system.model, self.adjoined
        integrands = ca.vertcat(*(c.value for c in m.constraints.integral))
        parts = [m.xdot, -ca.gradient(value, m.x), integrands, ca.gradient(value, m.p)]
        return ca.densify(ca.vertcat(*(ca.densify(part) for part in parts)))

    def at_bounds(self, value: ca.SX) -> ca.SX:
        """Put controls that are at bounds into an expression."""
        import casadi as ca

        fixed = [i for i in range(len(self.bounds)) if np.isfinite(self.bounds[i])]
        if not fixed:
            return value
        u = self.setting.system.model.u
        return ca.substitute(value, u[fixed], ca.SX(ca.DM(self.bounds[fixed])))

    def compiled(self, name: str, value: ca.SX) -> ca.Function:
        """Return (v, z) ↦ value, its derivatives in v, in z."""
        import casadi as ca

        system = self.setting.system
        given = self.at_bounds(ca.densify(ca.vec(value)))
        slopes = [ca.densify(ca.jacobian(given, s)) for s in (self.known, self.unknown)]
        inputs, outputs = [self.known, self.unknown], [given, *slopes]
        k = system.constants
        if not k.names:
            return ca.Function(name, inputs, outputs)
        whole = ca.Function(name, [*inputs, k.symbols], outputs)
        return ca.Function(name, inputs, whole.call([*inputs, ca.SX(k.values)]))

    @cached_property
    def _equations(self) -> ca.Function:
        return self.compiled("equations", self.equations)

    @cached_property
    def _flow(self) -> ca.Function:
        return self.compiled("flow", self.flow)

    def settled(self, v: Array, z: Array) -> tuple[Array, Array]:
        """Return z at points and its derivatives in v, from an estimate.

        Args:
            v: (n, n_v).
            z: (n, n_z).

        Returns:
            (n, n_z) and (n, n_z, n_v); NaN where Newton's method does not settle.
        """
        n, count = z.shape
        if not count:
            return z, np.zeros((n, 0, v.shape[1]))
        last = np.inf
        with np.errstate(all="ignore"):
            for _ in range(PASSES):
                g, by_v, by_z = evaluated(self._equations, v, z)
                step = _solved(by_z, g[:, :, None])[:, :, 0]
                z = z - step
                size = float(np.max(np.abs(step) / (1 + np.abs(z)), initial=0.0))
                if not np.isfinite(size) or size <= SETTLED or (size < 1e-9 and size >= last / 2):
                    break
                last = size
            if not size <= 1e-7:
                return np.full_like(z, np.nan), np.full((n, count, v.shape[1]), np.nan)
            _, by_v, by_z = evaluated(self._equations, v, z)
            return z, -_solved(by_z, by_v)

    def values(self, v: Array, z: Array) -> Values:
        """Return the flow at points with its derivatives, (n, n_v) and an estimate of z."""
        z, slope = self.settled(v, z)
        rates, by_v, by_z = evaluated(self._flow, v, z)
        return Values(z, rates, by_v + by_z @ slope)

    def controls(self, z: Array) -> Array:
        """Return all controls, (n, n_u), from z."""
        u = np.tile(self.bounds, (len(z), 1))
        u[:, list(self.between)] = z[:, : len(self.between)]
        return u


def _feedback(arc: object, u: ca.SX) -> list[ca.SX]:
    """Return A u + B of a singular arc, row by row."""
    import casadi as ca

    from quito_cli.optimality.singular import Singular

    assert isinstance(arc, Singular)
    assert arc.coefficient is not None
    assert arc.remainder is not None
    rows = arc.coefficient @ u[list(arc.controls)] + arc.remainder
    return list(ca.vertsplit(rows))


def _solved(matrix: Array, right: Array) -> Array:
    """Solve at every point; NaN where the matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        found = np.full(right.shape, np.nan)
        for k in range(len(matrix)):
            try:
                found[k] = np.linalg.solve(matrix[k], right[k])
            except np.linalg.LinAlgError:
                continue
        return found


def evaluated(function: ca.Function, v: Array, z: Array) -> tuple[Array, Array, Array]:
    """Evaluate a compiled function at n points: (n, r), (n, r, n_v), (n, r, n_z)."""
    n, rows = len(v), function.size1_out(0)
    value, by_v, by_z = mapped(function, n)(v.T, z.T)
    parts = []
    for part, columns in ((by_v, v.shape[1]), (by_z, z.shape[1])):
        parts.append(np.array(part).reshape(rows, n, columns).transpose(1, 0, 2))
    return np.array(value).reshape(rows, n).T, parts[0], parts[1]


@lru_cache(maxsize=256)
def mapped(function: ca.Function, n: int) -> ca.Function:
    """Return a function over n points."""
    return function.map(n)
