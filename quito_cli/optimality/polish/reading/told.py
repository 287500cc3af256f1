"""A structure in a sentence."""

from __future__ import annotations

from quito_cli.optimality.polish.equations.setting import Setting
from quito_cli.optimality.polish.equations.structure import Structure


def told(setting: Setting, structure: Structure) -> str:
    """Say what every control does until when, which rows are held, and what is touched."""
    times, rows = structure.times, setting.system.rows
    parts = [_control(setting, structure, i) for i in range(setting.system.model.n_u)]
    for k, phase in enumerate(structure.phases):
        for row, upper in sorted(phase.held):
            side = "upper" if upper else "lower"
            when = f"from {times[k]:.6g} to {times[k + 1]:.6g}"
            parts.append(f"{rows[row].label} at its {side} bound {when}")
    for k, (row, _) in structure.touches:
        parts.append(f"{rows[row].label} touched at {times[k]:.6g}")
    return "; ".join(parts)


def _control(setting: Setting, structure: Structure, i: int) -> str:
    kinds = [phase.kinds[i] for phase in structure.phases]
    said = []
    for k, kind in enumerate(kinds, start=1):
        if k == len(kinds) or kinds[k] != kind:
            name = "interior" if kind == "free" else kind
            said.append(f"{name} to {structure.times[k]:.6g}")
    return f"{setting.name(i)}: " + ", ".join(said)
