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
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.equations.structure import Phase
from quito_cli.optimality.polish.solving.pointwise import evaluated, solved

if TYPE_CHECKING:
    import casadi as ca

    from quito_cli.optimality.polish.equations.setting import Setting

Array = NDArray[np.float64]

PASSES = 25
"""Newton's steps for z: it follows from one iteration to the next, and few are needed."""
SETTLED = 1e-13
"""Relative change of z below which it is found."""
STALLED = 1e-9
"""Change below which rounding may keep it from falling."""
NEARLY = 1e-7
"""Change above which z is not found, when steps are used up."""


@dataclass(frozen=True, eq=False)
class Settled:
    """The law's z at points."""

    z: Array
    """(n, n_z)."""
    by_v: Array
    """(n, n_z, n_v): its derivatives."""


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

        u = self.setting.system.model.u
        singular, slope = self._singular, ca.gradient(self.adjoined, u)
        found = [singular[i] if i in singular else slope[i] for i in self.between]
        found += [self.setting.active(held).held for held in self.held]
        return ca.densify(ca.vertcat(ca.SX(0, 1), *found))

    @property
    def _singular(self) -> dict[int, ca.SX]:
        """A u + B, by singular control."""
        import casadi as ca

        arc = self.setting.singular(self.phase)
        if arc is None:
            return {}
        assert arc.coefficient is not None, "a phase's singular arc has a feedback"
        assert arc.remainder is not None, "a phase's singular arc has a feedback"
        u = self.setting.system.model.u[list(arc.controls)]
        rows = ca.vertsplit(arc.coefficient @ u + arc.remainder)
        return dict(zip(arc.controls, rows, strict=True))

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

    @cached_property
    def energy(self) -> ca.Function:
        """(v, z) ↦ H, its derivatives in v, in z."""
        return self.compiled("H", self.setting.system.hamiltonian)

    @property
    def free(self) -> tuple[int, ...]:
        """Controls that are neither at bounds nor singular."""
        return tuple(i for i, kind in enumerate(self.phase.kinds) if kind == "free")

    @cached_property
    def slopes(self) -> ca.Function:
        """Pontryagin's arguments ↦ (H + ηᵀC)_u, (n_u, 1)."""
        import casadi as ca

        gradient = ca.gradient(self.adjoined, self.setting.system.model.u)
        return self.setting.system.function("slopes", [ca.densify(gradient)])

    @cached_property
    def curvature(self) -> ca.Function:
        """Pontryagin's arguments ↦ (H + ηᵀC)_uu and C_u among free controls."""
        import casadi as ca

        u, free = self.setting.system.model.u, list(self.free)
        hessian = ca.jacobian(ca.gradient(self.adjoined, u), u)[free, free]
        held = ca.vertcat(ca.SX(0, 1), *(self.setting.active(h).held for h in self.held))
        normals = ca.jacobian(held, u)[:, free]
        return self.setting.system.function("curvature", [hessian, normals])

    @cached_property
    def clebsch(self) -> ca.Function | None:
        """Pontryagin's arguments ↦ (−1)^q A; None where no singular arc has an order."""
        arc = self.setting.singular(self.phase)
        if arc is None or arc.clebsch is None:
            return None
        return self.setting.system.function("clebsch", [arc.clebsch])

    def settled(self, v: Array, z: Array) -> Settled:
        """Return z at points (n, n_v) from an estimate (n, n_z).

        NaN at all points where Newton's method does not settle at one.
        """
        last = np.inf
        with np.errstate(all="ignore"):
            for _ in range(PASSES):
                g, by_v, by_z = evaluated(self._equations, v, z)
                moved = solved(by_z, np.concatenate([g, by_v], axis=2))
                step, slope = moved[..., 0], -moved[..., 1:]
                z = z - step
                size = float(np.max(np.abs(step) / (1 + np.abs(z)), initial=0.0))
                stalls = size < STALLED and size >= last / 2
                if size <= SETTLED or stalls or not np.isfinite(size):
                    break
                last = size
        if size > NEARLY or not np.isfinite(size):
            return Settled(np.full_like(z, np.nan), np.full_like(slope, np.nan))
        return Settled(z, slope)

    def values(self, v: Array, z: Array) -> Values:
        """Return the flow at points with its derivatives, (n, n_v) and an estimate of z."""
        found = self.settled(v, z)
        rates, by_v, by_z = evaluated(self._flow, v, found.z)
        return Values(found.z, rates[..., 0], by_v + by_z @ found.by_v)

    def controls(self, z: Array) -> Array:
        """Return all controls, (n, n_u), from z."""
        u = np.tile(self.bounds, (len(z), 1))
        u[:, list(self.between)] = z[:, : len(self.between)]
        return u
