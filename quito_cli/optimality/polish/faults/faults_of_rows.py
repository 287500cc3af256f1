"""Path constraints and bounds of states: violated where not held, held where nothing presses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.hamiltonian import Row
from quito_cli.optimality.polish.equations.structure import Held
from quito_cli.optimality.polish.faults.adjoining import adjoined, atoms
from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import FINELY, OFFSETS, SLIGHT, Fault, finely, runs

Array = NDArray[np.float64]

ROUGH = 1e-5
"""Wrong by this much is rounding, where polynomials are differentiated."""
BESIDE = 0.01
"""Part of the shorter phase beside a touch that an arc in its place is to start with."""
ATOM = 1e-6
"""Wrong by this much of its scale is rounding, of an atom."""


@dataclass(frozen=True, eq=False)
class _Along:
    """All rows along the horizon."""

    t: Array
    """(n,)."""
    phase: NDArray[np.int_]
    """(n,)."""
    values: Array
    """(n, rows)."""


def violated(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where rows not held are outside their bounds, or rest at one between touches."""
    rows, phases = dense.system.setting.system.rows, dense.system.structure.phases
    if not rows:
        return
    given = _along(dense, pieces)
    for i, row in enumerate(rows):
        if row.lower == row.upper and any((i, True) in phase.held for phase in phases):
            continue
        value, size = given.values[:, i], _size(row, given.values[:, i])
        for upper in (False, True):
            over = (value - row.upper if upper else row.lower - value) / size
            yield from _rests(dense, given, over, (i, upper))
            free = np.array([(i, upper) not in phase.held for phase in phases])[given.phase]
            wrong = np.where(free & np.isfinite(over), over - SLIGHT, -1.0)
            for run in runs(*finely(wrong, given.t)):
                says = f"{row.label} would be violated {run.when}"
                phase = int(given.phase[run.worst // len(FINELY) * len(OFFSETS)])
                yield _violation(run.start, run.end, run.amount, says, phase, (i, upper))


def _violation(start: float, end: float, amount: float, says: str, phase: int, held: Held) -> Fault:
    return Fault("violated", start, end, amount, says, phase, held=held, upper=held[1])


def _along(dense: Dense, pieces: tuple[Piece, ...]) -> _Along:
    n, flat = dense.system.layout.states, [piece.flat() for piece in pieces]
    t = np.concatenate([own for own, _, _, _ in flat])
    x = np.vstack([y[:, :n] for _, y, _, _ in flat])
    u = np.vstack([own for _, _, _, own in flat])
    phase = np.repeat(np.arange(len(pieces)), [piece.t.size for piece in pieces])
    return _Along(t, phase, dense.system.setting.rows(t, x, u, dense.shared("parameters")))


def _size(row: Row, values: Array) -> float:
    """Return the size of a row, from its values (n,)."""
    bounds = [abs(bound) for bound in (row.lower, row.upper) if np.isfinite(bound)]
    largest = max(float(np.abs(values).max()), *bounds, 0.0)
    return max(float(np.ptp(values)), 1e-3 * largest, 1e-9)


def _rests(dense: Dense, given: _Along, over: Array, held: Held) -> Iterator[Fault]:
    """Give phases between two touches of a row in which it rests at its bound."""
    touched = {k for k, row in dense.system.structure.touches if row == held}
    for k in (k for k in touched if k + 1 in touched):
        own = given.phase == k
        if np.abs(over[own]).max() <= SLIGHT:
            start, end = (float(v) for v in given.t[own][[0, -1]])
            label = dense.system.setting.system.rows[held[0]].label
            says = f"{label} rests at its bound from {start:.6g} to {end:.6g}"
            yield _violation(start, end, 1.0, says, k, held)


def bends(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give touches that are none: S'' has the sign with which S leaves its bound on both sides."""
    setting, structure = dense.system.setting, dense.system.structure
    for k, held in structure.touches:
        if not 0 < k < len(structure.phases):
            continue
        known, sign = setting.active(held), 1.0 if held[1] else -1.0
        second = (*known.derivatives, known.held)[2]
        function = setting.system.function("bend", [second])
        before, after = (dense.along(function, j, pieces[j])[0][:, 0] for j in (k - 1, k))
        size = max(float(np.abs(own).max()) for own in (before, after)) or 1.0
        amount = sign * max(before[-1], after[0]) / size
        if amount > SLIGHT:
            time, spell = float(dense.times[k]), BESIDE * float(dense.lengths[k - 1 : k + 1].min())
            label = setting.system.rows[held[0]].label
            says = f"{label} would be violated beside its touch at {time:.6g}"
            yield _violation(time, time + spell, float(amount), says, k, held)


def pulls(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where the multiplier of a row that is held has the wrong sign."""
    setting, known = dense.system.setting, dense.system.method.known
    for k, piece in enumerate(pieces):
        offsets = (piece.t[0] - piece.t[0, 0]) / (piece.t[0, -1] - piece.t[0, 0])
        weights = known.weights(offsets)
        for held, own in adjoined(dense, k).items():
            row, sign = setting.system.rows[held[0]], 1.0 if held[1] else -1.0
            if row.lower == row.upper:
                continue
            mu, size = (own.mu @ weights.T).ravel(), own.size(float(dense.lengths[k]))
            slack = ROUGH if setting.active(held).order else SLIGHT
            for run in runs(*finely(-sign * mu / size - slack, piece.t.ravel())):
                says = f"the multiplier of {row.label} has the wrong sign {run.when}"
                yield Fault(
                    "pull", run.start, run.end, run.amount, says, k, held=held, upper=held[1]
                )


def atoms_of(dense: Dense, _: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give junctions at which the costate jumps as no multiplier of the right sign explains."""
    system = dense.system
    for atom in atoms(dense):
        if atom.junction == 0:  # the costate before it is free: so is the jump
            continue
        row, sign = system.setting.system.rows[atom.held[0]], 1.0 if atom.held[1] else -1.0
        time = float(dense.times[atom.junction])
        if atom.rest > ROUGH * atom.scale:
            says = f"the costate jumps by more than {row.label} explains"
            yield Fault("curvature", time, time, atom.rest / atom.scale, says)
        if row.lower != row.upper and sign * atom.size < -ATOM * atom.scale:
            says = f"the jump of the costate by {row.label} at {time:.6g} has the wrong sign"
            k = min(atom.junction, len(system.structure.phases) - 1)
            k = k if atom.held in system.structure.phases[k].held else k - 1
            amount = -sign * atom.size / atom.scale
            yield Fault("pull", time, time, amount, says, k, held=atom.held, upper=atom.held[1])
