"""What speaks against an extremal that solves the equations of its structure: every inequality.

    a phase has no length                                        its arcs are too many
    (H + ηᵀC)_u ≥ 0 at lower bounds, ≤ 0 at upper ones           an arc is missing
    lower ≤ u ≤ upper where it is free or singular               an arc at a bound is missing
    rows that are not held are within their bounds               an arc of theirs is missing
    η ≥ 0 of rows held at upper bounds, ≤ 0 at lower ones; of a state constraint of order q
    (−1)^q dη^q/dt^q likewise, and the atoms where it begins     it does not hold there
    H_uu positive semidefinite among free controls, (−1)^q A among singular ones (Legendre, Clebsch)
    multipliers of what holds at the ends have their signs, and what does not hold is within bounds

Each is looked at between the points of the segments too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import sampled as along
from quito_cli.optimality.polish.dense import Piece, lengths, sampled
from quito_cli.optimality.polish.structure import Held
from quito_cli.optimality.polish.system import System
from quito_cli.optimality.polish.unknowns import Unknowns

Array = NDArray[np.float64]
What = Literal["vanished", "sign", "beyond", "violated", "pull", "curvature", "end"]

SLIGHT = 1e-7
"""Wrong by this much of its size is rounding, where a function touches zero."""
EMPTY = 1e-9
"""Part of the horizon that is no length."""
OFFSETS = np.linspace(0.0, 1.0, 25)
"""Where every segment is looked at."""


@dataclass(frozen=True)
class Fault:
    """An inequality that does not hold."""

    what: What
    start: float
    end: float
    """From when to when."""
    amount: float
    """Over the size of what it is of."""
    sentence: str
    control: int = -1
    upper: bool = False
    """Of `beyond`: which bound; of `sign`: at which it is now."""
    held: Held | None = None
    phase: int = -1


def faults(system: System, at: Unknowns) -> list[Fault]:
    """Return what speaks against an extremal, vanished phases first, then the worst first."""
    horizon = float(np.ptp(at.shared[system.layout.place("T")]))
    gone = [
        Fault("vanished", 0.0, 0.0, float(-length / horizon), _vanished(system, k, at), phase=k)
        for k, length in enumerate(lengths(system, at))
        if length <= EMPTY * horizon
    ]
    if gone:
        return gone
    pieces = sampled(system, at, OFFSETS)
    found = [*_signs(system, at, pieces), *_beyond(system, pieces), *_violated(system, at, pieces)]
    found += _chattering(system)
    found += [*_pulls(system, at, pieces), *_curved(system, at, pieces), *_ends(system, at)]
    return sorted(found, key=lambda fault: -fault.amount)


def _vanished(system: System, k: int, at: Unknowns) -> str:
    time = float(at.shared[system.layout.place("T")][k])
    return f"the arc that was to begin at {time:.6g} has no length"


def _runs(wrong: Array, t: Array) -> Iterator[tuple[float, float, int]]:
    """Give from when to when, and where most, something is positive; (n,) in order of time."""
    flags = np.concatenate([[False], wrong > 0, [False]])
    edges = np.flatnonzero(flags[1:] != flags[:-1])
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        first, last = max(a - 1, 0), min(b, len(t) - 1)
        yield float(t[first]), float(t[last]), int(a + np.argmax(wrong[a:b]))


def _slopes(system: System, at: Unknowns, pieces: tuple[Piece, ...]) -> list[Array]:
    """Return (H + ηᵀC)_u of all phases, (n, n_u) each."""
    import casadi as ca

    found = []
    for k, piece in enumerate(pieces):
        law = system.laws[k]
        t, y, z, u = piece.flat()
        gradient = ca.gradient(law.adjoined, system.setting.system.model.u)
        function = system.setting.system.function("slopes", [ca.densify(gradient)])
        found.append(along(function, arguments(system, at, k, t, y, z, u))[0])
    return found


def arguments(
    system: System, at: Unknowns, k: int, t: Array, y: Array, z: Array, u: Array
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """Return values for functions of Pontryagin's arguments, η in the place of μ."""
    n, law = system.layout.states, system.laws[k]
    mu = np.zeros((len(t), len(system.setting.system.rows)))
    for j, (row, _) in enumerate(law.held):
        mu[:, row] = z[:, len(law.between) + j]
    p, nu = (at.shared[system.layout.place(name)] for name in ("p", "nu"))
    return t, y[:, :n], y[:, n:], u, p, mu, nu


def _signs(system: System, at: Unknowns, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    slopes = _slopes(system, at, pieces)
    size = np.max([np.abs(s).max(axis=0, initial=0.0) for s in slopes], axis=0)
    fixed = system.setting.system.model.control_bounds.fixed
    for k, (piece, own) in enumerate(zip(pieces, slopes, strict=True)):
        t = piece.t.ravel()
        for i, kind in enumerate(system.structure.phases[k].kinds):
            if kind not in ("lower", "upper") or fixed[i]:
                continue
            wrong = own[:, i] if kind == "upper" else -own[:, i]
            wrong = wrong / (size[i] or 1.0) - SLIGHT
            for start, end, worst in _runs(wrong, t):
                name = system.setting.name(i)
                says = (
                    f"dH/d{name} has the wrong sign for {name} at its {kind} bound from "
                    f"{start:.6g} to {end:.6g}"
                )
                amount = float(wrong[worst])
                yield Fault("sign", start, end, amount, says, i, kind == "upper", None, k)


def _beyond(system: System, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    lower, upper = system.setting.system.model.control_bounds
    for k, piece in enumerate(pieces):
        t, u = piece.t.ravel(), piece.u.reshape(piece.t.size, -1)
        for i, kind in enumerate(system.structure.phases[k].kinds):
            if kind in ("lower", "upper"):
                continue
            span = upper[i] - lower[i]
            span = span if np.isfinite(span) else 1 + float(np.abs(u[:, i]).max())
            for at_upper, over in ((False, lower[i] - u[:, i]), (True, u[:, i] - upper[i])):
                wrong = over / span - SLIGHT
                for start, end, worst in _runs(np.nan_to_num(wrong, neginf=-1.0), t):
                    side = "above its upper" if at_upper else "below its lower"
                    says = (
                        f"{system.setting.name(i)} would be {side} bound from {start:.6g} to "
                        f"{end:.6g}"
                    )
                    amount = float(wrong[worst])
                    yield Fault("beyond", start, end, amount, says, i, at_upper, None, k)


def _chattering(system: System) -> Iterator[Fault]:
    """Give singular arcs of even order that a control jumps to: there is no such junction.

    At a junction the order and the lowest derivative of u that jumps have an odd sum (J. P.
    McDanell and W. F. Powers, SIAM J. Control 9, 1971); where u itself jumps, the order is odd.
    """
    phases, times = system.structure.phases, system.structure.times
    for k in range(1, len(phases)):
        for one, other in ((phases[k - 1], phases[k]), (phases[k], phases[k - 1])):
            arc = system.setting.singular(one)
            if arc is None or arc.order is None or arc.order % 2:
                continue
            for i in arc.controls:
                if other.kinds[i] in ("lower", "upper"):
                    time, name = float(times[k]), system.setting.name(i)
                    says = (
                        f"{name} would come to a singular arc of order {arc.order} from a bound at "
                        f"{time:.6g}: it would chatter, and no such junction is optimal"
                    )
                    yield Fault("curvature", time, time, 1.0, says, i)


def _violated(system: System, at: Unknowns, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    rows, n = system.setting.system.rows, system.layout.states
    p = at.shared[system.layout.place("p")]
    if not rows:
        return
    t, x, u, phase = [], [], [], []
    for k, piece in enumerate(pieces):
        own_t, y, _, own_u = piece.flat()
        t.append(own_t)
        x.append(y[:, :n])
        u.append(own_u)
        phase.append(np.full(len(own_t), k))
    times, phases, held_by = np.concatenate(t), np.concatenate(phase), system.structure.phases
    values = system.setting.rows(times, np.vstack(x), np.vstack(u), p)
    for i, row in enumerate(rows):
        if row.lower == row.upper and any((i, True) in phase.held for phase in held_by):
            continue
        bounds = [abs(b) for b in (row.lower, row.upper) if np.isfinite(b)]
        size = max(
            float(np.ptp(values[:, i])),
            1e-3 * float(np.abs(values[:, i]).max()),
            1e-3 * max(bounds, default=0.0),
            1e-9,
        )
        for upper in (False, True):
            over = values[:, i] - row.upper if upper else row.lower - values[:, i]
            held = np.array([(i, upper) in system.structure.phases[k].held for k in phases])
            wrong = np.where(held | ~np.isfinite(over), -1.0, over / size - SLIGHT)
            for k in _between_touches(system, (i, upper)):
                own_times = times[phases == k]
                if np.abs(over[phases == k]).max() <= SLIGHT * size:
                    start, end = float(own_times[0]), float(own_times[-1])
                    says = f"{row.label} rests at its bound from {start:.6g} to {end:.6g}"
                    yield Fault("violated", start, end, 1.0, says, -1, upper, (i, upper), k)
            for start, end, worst in _runs(wrong, times):
                says = f"{row.label} would be violated from {start:.6g} to {end:.6g}"
                amount = float(wrong[worst])
                yield Fault(
                    "violated", start, end, amount, says, -1, upper, (i, upper), int(phases[worst])
                )


def _between_touches(system: System, held: Held) -> list[int]:
    """Return phases that begin and end with a touch of a row."""
    at = {k for k, touched in system.structure.touches if touched == held}
    return [k for k in at if k + 1 in at]


def _pulls(system: System, at: Unknowns, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    rows = system.setting.system.rows
    for k, own in enumerate(densities(system, at, pieces)):
        t = pieces[k].t.ravel()
        for held, (mu, size) in own.items():
            row, sign = rows[held[0]], 1.0 if held[1] else -1.0
            if row.lower == row.upper:
                continue
            slack = SLIGHT if not system.setting.active(held).order else 1e-5
            wrong = -sign * mu / size - slack
            for start, end, worst in _runs(wrong, t):
                says = f"the multiplier of {row.label} has the wrong sign from "
                says += f"{start:.6g} to {end:.6g}"
                amount = float(wrong[worst])
                yield Fault("pull", start, end, amount, says, -1, held[1], held, k)
    for leap in leaps(system, at):
        if leap.junction == 0:  # the costate before it is free: so is the jump
            continue
        row, sign = rows[leap.held[0]], 1.0 if leap.held[1] else -1.0
        time = float(at.shared[system.layout.place("T")][leap.junction])
        if leap.rest > 1e-5 * leap.size:
            says = f"the costate jumps by more than {row.label} explains"
            yield Fault("curvature", time, time, leap.rest / leap.size, says)
        if row.lower != row.upper and sign * leap.atom < -1e-6 * leap.size:
            says = f"the jump of the costate by {row.label} at {time:.6g} has the wrong sign"
            amount, k = -sign * leap.atom / leap.size, min(leap.junction, len(pieces) - 1)
            k = k if leap.held in system.structure.phases[k].held else k - 1
            yield Fault("pull", time, time, amount, says, -1, leap.held[1], leap.held, k)


@dataclass(frozen=True)
class Impulse:
    """What the multiplier of a state constraint has at a junction."""

    junction: int
    held: Held
    atom: float
    """What its multiplier of direct adjoining jumps by."""
    rest: float
    """What the costate jumps by in the directions of higher derivatives: nothing, in theory."""
    size: float
    """Of what both are made of."""


def leaps(system: System, at: Unknowns) -> Iterator[Impulse]:
    """Give the impulses of state constraints: where arcs begin and end, and at touches.

    Where an arc begins π_i − ζ_i, where it ends ζ_i: i = 0 is the atom, the others vanish.
    """
    known = sampled(system, at, system.method.known.points)
    zetas = [adjoined(system, at, k, piece) for k, piece in enumerate(known)]
    pi = at.shared[system.layout.place("pi")]
    for k, leap in enumerate(system.leaps):
        first = 0 if leap is None else leap.multipliers.start
        for jump in leap.jumps if leap else ():
            values = pi[first : first + jump.values.numel()]
            first += len(values)
            if jump.held is None:
                continue
            begun = np.zeros(len(values))
            if jump.held in zetas[k] and (k, jump.held) not in system.structure.touches:
                begun = zetas[k][jump.held][0, 0, :-1]
            yield _impulse(k, jump.held, values - begun, np.abs(values).max())
        if k == 0:
            continue
        after = system.structure.phases[k].held if k < len(zetas) else frozenset()
        for held in sorted(system.structure.phases[k - 1].held - after):
            if system.setting.active(held).order:
                zeta = zetas[k - 1][held]
                yield _impulse(k, held, zeta[-1, -1, :-1], np.abs(zeta[..., :-1]).max())


def _impulse(k: int, held: Held, values: Array, size: float) -> Impulse:
    rest = float(np.abs(values[1:]).max(initial=0.0))
    return Impulse(k, held, float(values[0]), rest, float(size) or 1.0)


def adjoined(system: System, at: Unknowns, k: int, piece: Piece) -> dict[Held, Array]:
    """Return ζ_0 … ζ_{q−1} and μ of the state constraints that a phase holds, (K, m, q + 1) each.

    ζ_{q−1} = η, ζ_{i−1} = −ζ_i', μ = −ζ_0'; derivatives of the polynomials through the points of
    the piece, which are those of `Gauss.known`. Of a mixed constraint μ = η alone, (K, m, 1).
    """
    law, segments = system.laws[k], at.phases[k]
    h = np.diff(segments.fractions) * lengths(system, at)[k]
    found = {}
    for j, held in enumerate(law.held):
        value = piece.z[..., len(law.between) + j]
        order = system.setting.active(held).order or 0
        parts = [value]
        for _ in range(order):
            slope = np.einsum("mj,kj->km", system.method.known.differentiation, parts[0])
            parts.insert(0, -slope / h[:, None])
        # μ, ζ_0, …, ζ_{q−1}: μ last.
        found[held] = np.stack([*parts[1:], parts[0]], axis=-1)
    return found


def densities(
    system: System, at: Unknowns, pieces: tuple[Piece, ...]
) -> list[dict[Held, tuple[Array, float]]]:
    """Return μ of held rows at the points of pieces, (n,), and its size, by phase.

    The size is that of the terms it is made of: μ = −ζ_0' may be zero where ζ_0 is not.
    """
    known = sampled(system, at, system.method.known.points)
    found = []
    for k, piece in enumerate(pieces):
        own = {}
        for held, parts in adjoined(system, at, k, known[k]).items():
            count = piece.t.shape[1]
            weights = system.method.known.weights(
                OFFSETS if count == len(OFFSETS) else system.method.known.points
            )
            mu: Array = (parts[..., -1] @ weights.T).ravel()
            length = float(lengths(system, at)[k])
            sizes = np.abs(parts).max(axis=(0, 1))
            powers = length ** np.arange(1.0, len(sizes))
            size = max(float(sizes[-1]), float((sizes[:-1] / powers).max(initial=0.0)))
            own[held] = mu, size or 1.0
        found.append(own)
    return found


def _curved(system: System, at: Unknowns, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    import casadi as ca

    setting, u_symbols = system.setting, system.setting.system.model.u
    for k, piece in enumerate(pieces):
        law, phase = system.laws[k], system.structure.phases[k]
        t, y, z, u = piece.flat()
        given = arguments(system, at, k, t, y, z, u)
        free = [i for i, kind in enumerate(phase.kinds) if kind == "free"]
        if free and any(i in setting.controls.of_kind("regular") for i in free):
            hessian = ca.jacobian(ca.gradient(law.adjoined, u_symbols), u_symbols)[free, free]
            rows = [ca.gradient(setting.active(h).held, u_symbols)[free].T for h in law.held]
            outputs = [ca.densify(hessian), *(ca.densify(r) for r in rows)]
            values = along(setting.system.function("curvature", outputs), given)
            matrix = values[0].reshape(len(t), len(free), len(free))
            normals = np.stack(values[1:], axis=1) if rows else np.zeros((len(t), 0, len(free)))
            least = _least(matrix, normals)
            wrong = -least / max(float(np.abs(matrix).max()), 1e-300) - SLIGHT
            yield from _bent(wrong, t, k, "H_uu is not positive semidefinite (Legendre-Clebsch)")
        arc = setting.singular(phase)
        if arc is not None and arc.clebsch is not None:
            function = setting.system.function("clebsch", [ca.densify(arc.clebsch)])
            count = len(arc.controls)
            matrix = along(function, given)[0].reshape(len(t), count, count)
            symmetric = (matrix + matrix.transpose(0, 2, 1)) / 2
            least = np.asarray(np.linalg.eigvalsh(symmetric)[:, 0], dtype=np.float64)
            wrong = -least / max(float(np.abs(matrix).max()), 1e-300) - SLIGHT
            yield from _bent(
                wrong, t, k, "the generalised Legendre-Clebsch condition does not hold"
            )


def _least(matrix: Array, normals: Array) -> Array:
    """Return the least eigenvalue of matrices on the null spaces of normals, (n,)."""
    if not normals.shape[1]:
        return np.asarray(np.linalg.eigvalsh(matrix)[:, 0])
    if normals.shape[1] >= normals.shape[2]:
        return np.zeros(len(matrix))
    basis, _ = np.linalg.qr(normals.transpose(0, 2, 1), mode="complete")
    null = basis[:, :, normals.shape[1] :]
    reduced = np.einsum("nai,nab,nbj->nij", null, matrix, null)
    return np.asarray(np.linalg.eigvalsh(reduced)[:, 0])


def _bent(wrong: Array, t: Array, k: int, what: str) -> Iterator[Fault]:
    for start, end, worst in _runs(wrong, t):
        says = f"{what} from {start:.6g} to {end:.6g}"
        yield Fault("curvature", start, end, float(wrong[worst]), says, phase=k)


def _ends(system: System, at: Unknowns) -> Iterator[Fault]:
    """Give what is outside its range at the ends, and multipliers of the wrong sign."""
    from quito_cli.optimality.polish.limits import limits

    for sentence, amount in limits(system, at):
        yield Fault("end", 0.0, 0.0, amount, sentence)
