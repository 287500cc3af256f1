"""Solution -> matplotlib Figure, by matplotlib's object interface: no display, no global state.

A panel is a row of the table `PANELS`: a list of curves drawn from a Solution. A picture stacks the
panels asked for, one small plot a curve.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import UsageError
from quito_cli.plots.arcs import ARC_NAMES, of_control, on_constraints
from quito_cli.plots.curves import Curve, Line, draw_curve
from quito_cli.plots.history import History, histories
from quito_cli.plots.layout import balanced, places, shared, with_unit
from quito_cli.plots.palette import plain
from quito_cli.plots.plan import draw_plan
from quito_cli.plots.sampling import drawn_times
from quito_cli.solution.junctions import Junction
from quito_cli.solution.optimal import HAMILTONIAN, SWITCHING, Arc
from quito_cli.solution.solution import Drawing, Quantity, Solution
from quito_cli.solution.store import write_aside

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_FLAT = 0.01
"""Part of the size of the Hamiltonian's terms below which its changes are no shape."""
_ENTRY = 1.75
"""Width of an entry of the legend, in inches."""
_COLUMNS = 3
_CURVE_HEIGHT, _PLAN_HEIGHT = 2.2, 4.8
"""Of a row, in inches."""

Panel = Curve | Drawing | History


def _curves(
    solution: Solution,
    quantities: tuple[Quantity, ...],
    values: Array,
    known: Array | None,
    far_bounds: bool,
    junctions: tuple[Junction, ...] = (),
    shades: tuple[Arc, ...] = (),
) -> list[Panel]:
    """Return a plot for each entry, or where there are many, for each vector."""
    curves: list[Panel] = []
    for name, members in shared(quantities).items():
        lines = []
        for i in members:
            reference = None if known is None or np.isnan(known[:, i]).all() else known[:, i]
            q = quantities[i]
            lines.append(Line(q.name, values[:, i], reference, q.lower, q.upper))
        label = with_unit(name, quantities[members[0]].unit)
        marks = tuple(j for j in junctions if j.control in members)
        arcs = of_control(solution, lines[0].name) if far_bounds and len(lines) == 1 else ()
        curves.append(
            Curve(
                label,
                drawn_times(solution),
                tuple(lines),
                far_bounds,
                marks=marks,
                arcs=arcs,
                shades=shades,
                known_times=solution.dense_times,
            )
        )
    return curves


def _states(solution: Solution) -> list[Panel]:
    known = solution.reference.states if solution.reference else None
    values = solution.state(drawn_times(solution))
    return _curves(solution, solution.origin.states, values, known, False)


def _controls(solution: Solution) -> list[Panel]:
    known = solution.reference.controls if solution.reference else None
    values = solution.control(drawn_times(solution))
    quantities, found = solution.origin.controls, solution.junctions
    return _curves(solution, quantities, values, known, True, found)


def _costates(solution: Solution) -> list[Panel]:
    duals = tuple(
        Quantity(f"λ of {state.name}", "", -np.inf, np.inf) for state in solution.origin.states
    )
    values, active = solution.costate(drawn_times(solution)), on_constraints(solution)
    return _curves(solution, duals, values, None, False, shades=active)


def _switching(solution: Solution) -> list[Panel]:
    """Return the switching functions over the arcs of their controls, and the Hamiltonian."""
    if solution.extremal is None:
        return []
    curves = solution.extremal.curves
    horizon = float(solution.times[0]), float(solution.times[-1])
    curve = partial(Curve, times=solution.extremal.times, horizon=horizon, zero=True)
    names = [name for name in curves if name != HAMILTONIAN]
    found: list[Panel] = []
    for name, members in shared(tuple(Quantity(n, "", -np.inf, np.inf) for n in names)).items():
        lines = tuple(Line(names[i], curves[names[i]]) for i in members)
        alone = of_control(solution, name.removeprefix(SWITCHING)) if len(lines) == 1 else ()
        found.append(curve(plain(name), lines=lines, shades=alone))
    if HAMILTONIAN in curves:
        line, active = Line(HAMILTONIAN, curves[HAMILTONIAN]), on_constraints(solution)
        least = _FLAT * _power(solution)
        found.append(curve(HAMILTONIAN, lines=(line,), shades=active, least=least))
    return found


def _power(solution: Solution) -> float:
    """Return the largest Σ |λ ẋ|, of what the Hamiltonian is made."""
    times = solution.dense_times
    rates = np.gradient(solution.state(times), times, axis=0)
    terms = np.abs(solution.costate(times) * rates).sum(axis=1)
    return float(np.nanmax(terms, initial=0.0))


def _mesh(solution: Solution) -> list[Panel]:
    if solution.refinement is not None:
        return list(histories(solution))
    steps = np.diff(solution.times)
    lengths = Line("length of the cells", np.append(steps, steps[-1]))
    return [Curve(lengths.name, solution.times, (lengths,), steps=True, logarithmic=True)]


PANELS: dict[str, Callable[[Solution], list[Panel]]] = {
    "states": _states,
    "controls": _controls,
    "costates": _costates,
    "switching": _switching,
    "mesh": _mesh,
    "plan": lambda solution: list(solution.drawings),
}
DEFAULT = ("states", "controls", "plan")
"""What a picture shows unless told otherwise."""


def figure(solution: Solution, panels: Iterable[str]) -> Figure:
    """Return the figure of `panels`, names of `PANELS` in the order wanted.

    Raises:
        UsageError: there is nothing to draw in them.
    """
    from matplotlib.figure import Figure

    groups = [PANELS[name](solution) for name in panels]
    rows = [row for group in groups for row in _rows(group)]
    if not rows:
        raise UsageError(f"the problem has no {' or '.join(panels)} to draw")
    columns = max(len(row) for row in rows)
    heights = [_PLAN_HEIGHT if isinstance(row[0], Drawing) else _CURVE_HEIGHT for row in rows]
    size = 1.2 + 3.6 * max(columns, 2), 1.1 + sum(heights)
    drawn = Figure(figsize=size, layout="constrained")
    last = max((i for i, row in enumerate(rows) if isinstance(row[0], Curve)), default=-1)
    for i, _, panel, place in places(drawn, rows, heights):
        if isinstance(panel, Drawing):
            flat = len(panel.labels) == 2
            draw_plan(drawn.add_subplot(place, projection=None if flat else "3d"), panel)
            continue
        axes = drawn.add_subplot(place)
        if isinstance(panel, History):
            panel.draw(axes)
            continue
        draw_curve(axes, panel)
        if i == last:
            axes.set_xlabel("t")
    drawn.suptitle(_heading(solution))
    _legend(drawn)
    return drawn


def _rows(group: Sequence[Panel]) -> list[Sequence[Panel]]:
    """Return rows of nearly equal length; the meshes over time take all of one."""
    if group and isinstance(group[0], History):
        return [row for row in (group[:1], group[1:]) if row]
    return balanced(group, _COLUMNS)


def _heading(solution: Solution) -> str:
    failed = "" if solution.success else "NOT SOLVED: "
    title = solution.origin.title or solution.origin.name
    changed = "".join(
        f", {plain(name)} = {plain(value)}" for name, value in solution.origin.changes
    )
    cells = len(solution.times) - 1
    how = f"polished, {cells} segments" if solution.polished else f"{cells} cells"
    return f"{failed}{plain(title)}\ncost {solution.cost:.8g}, {how}{changed}"


def _legend(drawn: Figure) -> None:
    """One legend for all plots, each entry once, and only where there is more than one."""
    entries: dict[str, Artist] = {}
    for axes in drawn.axes:
        if axes.get_legend() is not None:  # a plan with names of its own
            continue
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(str(label), handle)
    arcs = [name for name in ARC_NAMES if name in entries]
    entries = {name: entries[name] for name in (*(e for e in entries if e not in arcs), *arcs)}
    if len(entries) > 1:
        drawn.legend(
            handles=list(entries.values()),
            labels=list(entries),
            loc="outside lower center",
            ncols=min(len(entries), int(drawn.get_figwidth() / _ENTRY)),
            frameon=False,
        )


def draw(solution: Solution, panels: Iterable[str], path: Path) -> None:
    """Write the figure of `panels`; the ending of `path` is its format.

    Raises:
        ResultFileError: the file cannot be written.
    """
    write(figure(solution, panels), path)


def write(drawn: Figure, path: Path) -> None:
    """Write a figure; the ending of `path` is its format.

    Raises:
        ResultFileError: the file cannot be written.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no word on fonts being looked for
    dateless = {"Date": None} if path.suffix == ".svg" else {}
    if path.suffix == ".pdf":
        dateless = {"CreationDate": None}
    with warnings.catch_warnings():  # a title may have letters that the font has not
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        write_aside(path, lambda aside: drawn.savefig(aside, dpi=150, metadata=dateless))
