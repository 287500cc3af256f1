"""A sweep -> HDF5, with the axes of the sweep as dimensions: xarray opens it labelled.

    /            along the axes, each with its values as dimension scale: success, ending, message,
                 and every figure of the answers, NaN where there is none; of a figure with several
                 numbers another dimension counts them
    trajectory   along the axes and a common grid of normalised time (t - t0)/(tf - t0): time,
                 state and control by name; parameters; NaN where there is no answer
    problem      the YAML text, its SHA-256, what was given for all cases

Answers on whatever mesh are sampled on the common grid, one after another, so that memory does not
grow with the sweep; all there is of an answer is in the result file of its case. An axis called
like a variable here is named by its path, `constants.time`. A file is written beside the old one
and renamed; two runs differ in recorded times alone.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from quito_cli.batch.axes import Axis
from quito_cli.batch.case import Finished
from quito_cli.batch.sweep import ANSWERED, Swept
from quito_cli.solution.groups import Group
from quito_cli.solution.solution import Quantity, Solution
from quito_cli.solution.store import SWEEP, write_aside

if TYPE_CHECKING:
    import h5py

Array = NDArray[np.float64]

FORMAT_VERSION: Final = 1
POINTS: Final = 201
"""Of the grid of normalised time."""
_TIME, _STATE, _CONTROL, _PARAMETER = (
    "normalised_time",
    "state_name",
    "control_name",
    "parameter_name",
)
_TAKEN: Final = frozenset(
    {
        *(_TIME, _STATE, _CONTROL, _PARAMETER),
        *("time", "state", "control", "parameters", "state_unit", "control_unit"),
        *("success", "ending", "message", "trajectory", "problem"),
    }
)
"""What is in a file by these names already."""


@dataclass(frozen=True)
class Sample:
    """An answer on the common grid."""

    times: Array
    """(points,)."""
    states: Array
    """(points, n_x)."""
    controls: Array
    """(points, n_u)."""
    parameters: Array
    """(n_p,)."""


class _Root(Group):
    """A file itself, to be written as its groups are."""

    def __init__(self, file: h5py.File) -> None:
        self._begin(file)


def grid() -> Array:
    """Return the grid of normalised time, from 0 to 1."""
    return np.linspace(0.0, 1.0, POINTS)


def sampled(solution: Solution) -> Sample:
    """Return an answer on the common grid."""
    start, end = solution.times[0], solution.times[-1]
    times = start + grid() * (end - start)
    return Sample(times, solution.state(times), solution.control(times), solution.parameters)


def answer(one: Finished | None) -> Solution | None:
    """Return the answer of a case; None where it has none.

    Raises:
        ResultFileError: its result file is gone, or damaged.
    """
    if one is None or one.result is None or one.ending not in ANSWERED:
        return None
    return Solution.load(one.result)


def save(swept: Swept, path: Path) -> None:
    """Write a sweep; an older file of that name is replaced only when all is written.

    Raises:
        ResultFileError: it cannot be written, or the result of a case cannot be read.
    """
    import h5py

    def write(aside: Path) -> None:
        with h5py.File(aside, "w") as file:
            _write(file, swept)

    write_aside(path, write)


def _write(file: h5py.File, swept: Swept) -> None:
    import quito_cli

    sweep = swept.sweep
    file.attrs["format"], file.attrs["format_version"] = SWEEP, FORMAT_VERSION
    file.attrs["quito_version"] = quito_cli.__version__
    file.attrs["name"], file.attrs["title"] = sweep.name, sweep.title
    file.attrs["continuation"] = sweep.warm
    _write_figures(_Root(file), swept)
    _write_trajectories(Group(file, "trajectory"), swept)
    problem = Group(file, "problem")
    problem.dataset("yaml", sweep.text)
    problem.group.attrs["sha256"] = hashlib.sha256(sweep.text.encode()).hexdigest()
    problem.group.attrs["options"] = json.dumps(dict(sweep.options))
    problem.group.attrs["constants"] = json.dumps(dict(sweep.constants))


def _write_axes(into: Group, axes: tuple[Axis, ...], taken: frozenset[str]) -> tuple[str, ...]:
    """Write the axes, and return the names they have in the file."""
    names = []
    for axis in axes:
        section = "options" if axis.option else "constants"
        name = f"{section}.{axis.name}" if axis.name in taken else axis.name
        values: Any = np.array(axis.values) if axis.numeric else _texts(axis.labels)
        into.axis(name, values)
        names.append(name)
    return tuple(names)


def _texts(values: Any) -> NDArray[np.object_]:
    return np.array(list(values), dtype=object)


def _write_figures(into: Group, swept: Swept) -> None:
    """Write whether and how the cases were solved, and what is known of the answers."""
    shape, figures = swept.sweep.shape, swept.figures
    axes = _write_axes(into, swept.sweep.axes, _TAKEN.union(figures))
    success = np.array(swept.solved, dtype=np.int8).reshape(shape)
    into.data("success", success, *axes)["dtype"] = "bool"  # how xarray has truth values
    endings = ["" if one is None else one.ending.name.lower() for one in swept.finished]
    messages = ["" if one is None else one.message for one in swept.finished]
    into.data("ending", _texts(endings).reshape(shape), *axes)
    into.data("message", _texts(messages).reshape(shape), *axes)
    for name in (figure for figure in figures if figure not in _TAKEN):
        values = swept.grid(name)
        if values is None:
            texts = ["" if value is None else str(value) for value in swept.figure(name)]
            into.data(name, _texts(texts).reshape(shape), *axes)
        elif values.ndim == len(shape):
            into.data(name, values, *axes)
        else:
            into.axis(f"{name}_number", np.arange(values.shape[-1]))
            into.data(name, values, *axes, f"{name}_number")


def _write_trajectories(into: Group, swept: Swept) -> None:
    """Write the answers on the common grid, one after another."""
    sweep, first = swept.sweep, next((s for one in swept.finished if (s := answer(one))), None)
    if first is None:
        return
    axes = _write_axes(into, sweep.axes, _TAKEN)
    into.axis(_TIME, grid())
    quantities = {_STATE: first.origin.states, _CONTROL: first.origin.controls}
    quantities[_PARAMETER] = first.origin.parameters
    for name, members in quantities.items():
        into.axis(name, _texts(one.name for one in members))
    variables = {
        "time": _along(into, sweep.shape, "time", (*axes, _TIME)),
        "state": _along(into, sweep.shape, "state", (*axes, _TIME, _STATE)),
        "control": _along(into, sweep.shape, "control", (*axes, _TIME, _CONTROL)),
        "parameters": _along(into, sweep.shape, "parameters", (*axes, _PARAMETER)),
    }
    for name in ("state", "control"):
        variables[name].attrs["coordinates"] = "time"
        into.data(f"{name}_unit", _units(quantities[f"{name}_name"]), f"{name}_name")
    for index, one in zip(np.ndindex(sweep.shape), swept.finished, strict=True):
        solution = answer(one)
        if solution is not None:
            found = sampled(solution)
            variables["time"][index] = found.times
            variables["state"][index] = found.states
            variables["control"][index] = found.controls
            variables["parameters"][index] = found.parameters


def _units(quantities: tuple[Quantity, ...]) -> NDArray[np.object_]:
    return _texts(one.unit for one in quantities)


def _along(into: Group, shape: tuple[int, ...], name: str, axes: tuple[str, ...]) -> Any:
    """Return a dataset along axes written before, all of it NaN."""
    sizes = (*shape, *(len(into.group[axis]) for axis in axes[len(shape) :]))
    found = into.group.create_dataset(name, sizes, dtype=np.float64, fillvalue=np.nan)
    for i, axis in enumerate(axes):
        found.dims[i].attach_scale(into.group[axis])
    return found
