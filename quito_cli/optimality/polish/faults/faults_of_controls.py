"""Controls at bounds that H would have inside, and controls that are beyond their bounds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quito_cli.optimality.polish.faults.dense import Dense, Piece
from quito_cli.optimality.polish.faults.fault import OFFSETS, SLIGHT, Fault, finely, runs
from quito_cli.transcription.legendre import Nodes

Array = NDArray[np.float64]

STEEP = 1e-6
"""Part of its size by which a slope has a wrong sign, at least."""


def signs(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where (H + ηᵀC)_u has the wrong sign for a control at a bound."""
    setting, phases = dense.system.setting, dense.system.structure.phases
    slopes = [
        dense.along(law.slopes, k, piece)[0]
        for k, (law, piece) in enumerate(zip(dense.system.laws, pieces, strict=True))
    ]
    size = np.max([np.abs(s).max(axis=0, initial=0.0) for s in slopes], axis=0)
    fixed = setting.system.model.control_bounds.fixed
    for k, (piece, own) in enumerate(zip(pieces, slopes, strict=True)):
        for i, kind in enumerate(phases[k].kinds):
            if kind not in ("lower", "upper") or fixed[i]:
                continue
            wrong = (own[:, i] if kind == "upper" else -own[:, i]) / (size[i] or 1.0) - SLIGHT
            name = setting.name(i)
            for run in runs(*finely(wrong, piece.t.ravel())):
                says = f"dH/d{name} has the wrong sign for {name} at its {kind} bound {run.when}"
                at_upper = kind == "upper"
                yield Fault(
                    "sign", run.start, run.end, run.amount, says, k, control=i, upper=at_upper
                )


def slopes_at_ends(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give ends of the horizon where H_u of a control at a bound is zero, and comes to it wrongly.

    There the sign is that of the derivative, however small H_u is itself.
    """
    setting, phases = dense.system.setting, dense.system.structure.phases
    affine = set(setting.controls.of_kind("affine"))
    fixed, rates = setting.system.model.control_bounds.fixed, Nodes(OFFSETS).differentiation
    for k, end in ((0, 0), (len(phases) - 1, -1)):
        own = dense.along(dense.system.laws[k].slopes, k, pieces[k])[0]
        own = own.reshape(*pieces[k].t.shape, -1)
        lengths = np.ptp(pieces[k].t, axis=1)[:, None, None]
        slopes = np.einsum("ij,kjc->kic", rates, own) / lengths
        for i in (i for i in affine if phases[k].kinds[i] in ("lower", "upper") and not fixed[i]):
            size, steep = np.abs(own[..., i]).max(), np.abs(slopes[..., i]).max()
            # With time H_u ≥ 0 rises from zero, or falls to it.
            sign = (1.0 if phases[k].kinds[i] == "lower" else -1.0) * (1.0 if end == 0 else -1.0)
            wrong = -sign * slopes[end, end, i] / (steep or 1.0)
            if abs(own[end, end, i]) > SLIGHT * size or wrong <= STEEP:
                continue
            time = float(dense.times[end])
            spell = float(lengths[end, 0, 0]) * (0.5 if end == 0 else -0.5)
            name = setting.name(i)
            says = f"dH/d{name} is zero at {time:.6g}, and comes to it from the wrong side"
            yield Fault(
                "sign",
                min(time, time + spell),
                max(time, time + spell),
                float(wrong),
                says,
                k,
                control=i,
                upper=phases[k].kinds[i] == "upper",
            )


def beyond(dense: Dense, pieces: tuple[Piece, ...]) -> Iterator[Fault]:
    """Give where a control that is free or singular is beyond a bound."""
    setting, phases = dense.system.setting, dense.system.structure.phases
    lower, upper = setting.system.model.control_bounds
    for k, piece in enumerate(pieces):
        t, u = piece.t.ravel(), piece.u.reshape(piece.t.size, -1)
        for i, kind in enumerate(phases[k].kinds):
            if kind in ("lower", "upper"):
                continue
            span = upper[i] - lower[i]
            span = span if np.isfinite(span) else 1 + float(np.abs(u[:, i]).max())
            for at_upper, over in ((False, lower[i] - u[:, i]), (True, u[:, i] - upper[i])):
                wrong = np.nan_to_num(over / span - SLIGHT, neginf=-1.0)
                side = "above its upper" if at_upper else "below its lower"
                for run in runs(*finely(wrong, t)):
                    says = f"{setting.name(i)} would be {side} bound {run.when}"
                    yield Fault(
                        "beyond", run.start, run.end, run.amount, says, k, control=i, upper=at_upper
                    )
