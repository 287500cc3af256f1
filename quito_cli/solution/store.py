"""Solution <-> HDF5: labelled, self-contained, reproducible to the byte but for recorded times.

    problem        the YAML text, its SHA-256, resolved options, bounds
    trajectory     at the nodes: time, state, control, costate
    interpolation  what makes states a function of time: ends of substeps, slopes
    dense          state, control and reference on a fine uniform grid
    control        coefficients of û, generating function, variance, mesh
    multipliers    of the nonlinear program's rows, by block
    iterations     objective, infeasibilities, barrier parameter
    statistics     cost, counts, times, and every figure of the evidence

Every axis has a dimension scale, so that `xarray.open_dataset(file, group="trajectory",
engine="h5netcdf")` finds names and times. A file is written beside the old one and renamed.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.errors import ResultFileError
from quito_cli.solution.solution import (
    Evidence,
    MultiplierAxes,
    Origin,
    Quantity,
    ReferenceSamples,
    Solution,
    Statistics,
)
from quito_cli.solution.trajectory import Trajectory
from quito_cli.solution.violations import Violation
from quito_cli.solvers.outcome import Status
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS

if TYPE_CHECKING:
    import h5py

Array = NDArray[np.float64]

FORMAT = "quito result"
FORMAT_VERSION = 1
DAMAGED = (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""What h5py and numpy raise for a file whose bytes or layout are not what they should be."""
_BY_CONTROL = ("total_variation", "ringing")
_SENTENCES = ("warnings", "diagnosis")


def write_aside(path: Path, write: Callable[[Path], None]) -> None:
    """Let `write` make a file beside `path`, then rename it: `path` is the old or the new one.

    Raises:
        ResultFileError: the file cannot be written.
    """
    aside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(aside)
        os.replace(aside, path)
    except OSError as error:
        raise ResultFileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            aside.unlink()


def save(solution: Solution, path: Path) -> None:
    """Write `solution` to `path`."""
    import h5py

    def write(aside: Path) -> None:
        with h5py.File(aside, "w") as file:
            _write(file, solution)

    write_aside(path, write)


def load(path: Path) -> Solution:
    """Read a Solution.

    Raises:
        ResultFileError: the file is missing, damaged, no result of quito, or of a newer format.
    """
    import h5py

    if not path.is_file():
        raise ResultFileError(f"there is no file {path}")
    try:
        with h5py.File(path, "r") as file:
            _check_format(file, path)
            return _read(file)
    except DAMAGED as error:
        raise ResultFileError(f"{path} is no result of quito, or damaged: {error}") from None


def is_result(path: Path) -> bool:
    """Whether `path` is an HDF5 file, by content."""
    import h5py

    return path.is_file() and bool(h5py.is_hdf5(path))


def _check_format(file: h5py.File, path: Path) -> None:
    if file.attrs.get("format") != FORMAT:
        raise ResultFileError(f"{path} is an HDF5 file, but no result of quito")
    version = int(file.attrs["format_version"])
    if version > FORMAT_VERSION:
        raise ResultFileError(
            f"{path} has format version {version}; this quito reads up to {FORMAT_VERSION}: "
            "update quito to read it"
        )


class _Group:
    """A group being written: datasets with named axes."""

    def __init__(self, file: h5py.File, name: str) -> None:
        self.group = file.create_group(name)

    def axis(self, name: str, values: Any) -> None:
        """Write a dimension scale."""
        scale = self.dataset(name, values)
        scale.make_scale(name)

    def data(self, name: str, values: Any, *axes: str) -> None:
        """Write an array along axes written before."""
        dataset = self.dataset(name, values)
        for i, axis in enumerate(axes):
            dataset.dims[i].attach_scale(self.group[axis])

    def dataset(self, name: str, values: Any) -> Any:
        """Write numbers or a list of texts."""
        import h5py

        array = np.asarray(values)
        if array.dtype.kind == "U" or (array.size == 0 and array.dtype == object):
            return self.group.create_dataset(
                name, data=array.astype(object), dtype=h5py.string_dtype()
            )
        return self.group.create_dataset(name, data=array)


def _write(file: h5py.File, solution: Solution) -> None:
    import casadi
    import h5py

    import quito_cli

    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    versions = {"quito": quito_cli.__version__, "casadi": casadi.CasadiMeta.version()}
    versions |= {"numpy": np.__version__, "h5py": h5py.__version__}
    versions |= {"python": platform.python_version()}
    for name, version in versions.items():
        file.attrs[f"{name}_version"] = version
    _write_problem(_Group(file, "problem"), solution)
    _write_trajectory(_Group(file, "trajectory"), solution)
    _write_interpolation(_Group(file, "interpolation"), solution)
    _write_dense(_Group(file, "dense"), solution)
    _write_control(_Group(file, "control"), solution)
    multipliers = _Group(file, "multipliers")
    for name, values in sorted(solution.multipliers.items()):
        key = name.replace(" ", "_")
        axes = solution.multiplier_axes[name]
        multipliers.axis(f"{key}_time", axes.times)
        multipliers.axis(f"{key}_row", _texts(axes.labels))
        multipliers.data(key, values, f"{key}_time", f"{key}_row")
        multipliers.group[key].attrs["block"] = name
    iterations = _Group(file, "iterations")
    length = max((len(values) for values in solution.history.values()), default=0)
    iterations.axis("iteration", np.arange(length))
    for name, values in sorted(solution.history.items()):
        iterations.data(name, values, "iteration")
    _write_statistics(_Group(file, "statistics"), solution)


def _write_problem(into: _Group, solution: Solution) -> None:
    origin = solution.origin
    into.dataset("yaml", origin.text)
    attributes = into.group.attrs
    attributes["name"], attributes["title"] = origin.name, origin.title
    attributes["sha256"] = hashlib.sha256(origin.text.encode()).hexdigest()
    attributes["changes"] = json.dumps(origin.changes)
    attributes["options"] = json.dumps(dict(solution.options))
    attributes["free_times"], attributes["maximize"] = origin.free_times, origin.maximize
    kinds = {"state": origin.states, "control": origin.controls, "parameter": origin.parameters}
    for kind, quantities in kinds.items():
        into.axis(kind, _texts(q.name for q in quantities))
        into.data(f"{kind}_unit", _texts(q.unit for q in quantities), kind)
        into.data(f"{kind}_lower", np.array([q.lower for q in quantities]), kind)
        into.data(f"{kind}_upper", np.array([q.upper for q in quantities]), kind)


def _texts(values: Any) -> NDArray[np.object_]:
    return np.array(list(values), dtype=object)


def _axes(into: _Group, solution: Solution, times: Array) -> None:
    into.axis("time", times)
    into.axis("state_name", _texts(q.name for q in solution.origin.states))
    into.axis("control_name", _texts(q.name for q in solution.origin.controls))


def _write_trajectory(into: _Group, solution: Solution) -> None:
    _axes(into, solution, solution.times)
    nodes = solution.trajectory(solution.times)
    into.data("state", nodes, "time", "state_name")
    into.data("control", solution.control(solution.times), "time", "control_name")
    into.data("costate", solution.costates, "time", "state_name")


def _write_interpolation(into: _Group, solution: Solution) -> None:
    trajectory = solution.trajectory
    into.group.attrs["kind"] = trajectory.interpolation
    into.axis("time", trajectory.times)
    into.axis("step", np.arange(len(trajectory.times) - 1))
    into.axis("state_name", _texts(q.name for q in solution.origin.states))
    into.data("state", trajectory.states, "time", "state_name")
    into.data("start_slope", trajectory.start_slopes, "step", "state_name")
    into.data("end_slope", trajectory.end_slopes, "step", "state_name")


def _write_dense(into: _Group, solution: Solution) -> None:
    times = solution.dense_times
    _axes(into, solution, times)
    into.data("state", solution.state(times), "time", "state_name")
    into.data("control", solution.control(times), "time", "control_name")
    into.data("costate", solution.costate(times), "time", "state_name")
    if (reference := solution.reference) is not None:
        into.data("reference_state", reference.states, "time", "state_name")
        into.data("reference_control", reference.controls, "time", "control_name")
        into.axis("switching_time", np.array(reference.switching_times, dtype=float))
        for name in ("cost", "accuracy"):
            value = getattr(reference, name)
            into.group.attrs[f"reference_{name}"] = np.nan if value is None else value


def _write_control(into: _Group, solution: Solution) -> None:
    basis = solution.basis
    into.axis("index", basis.centres)
    into.axis("node", np.arange(len(solution.times)))
    into.axis("control_name", _texts(q.name for q in solution.origin.controls))
    into.data("coefficients", solution.coefficients, "index", "control_name")
    into.data("mesh", solution.times, "node")
    into.axis("parameter_name", _texts(q.name for q in solution.origin.parameters))
    into.data("parameters", solution.parameters, "parameter_name")
    into.group.attrs["generating_function"] = basis.function.name
    into.group.attrs["variance"] = basis.variance
    into.group.attrs["normalised"] = basis.normalised


def _write_statistics(into: _Group, solution: Solution) -> None:
    evidence = solution.evidence
    attributes = into.group.attrs
    attributes["status"], attributes["success"] = solution.status.name, solution.success
    attributes["status_sentence"] = solution.status.value
    attributes["cost"] = solution.cost
    attributes["maximum_violation"] = evidence.maximum_violation
    numbers = {f.name: getattr(evidence, f.name) for f in fields(Evidence)} | asdict(
        solution.statistics
    )
    into.axis("control_name", _texts(q.name for q in solution.origin.controls))
    for name in _BY_CONTROL:
        into.data(name, np.array(numbers.pop(name), dtype=float), "control_name")
    for name in _SENTENCES:
        attributes[name] = json.dumps(numbers.pop(name), ensure_ascii=False)
    found = numbers.pop("violations")
    into.axis("constraint", _texts(v.constraint for v in found))
    for name in ("time", "amount", "scale"):
        values = np.array([getattr(v, name) for v in found], dtype=float)
        into.data(f"violation_{name}", values, "constraint")
    for name, value in numbers.items():
        attributes[name] = -1 if value is None else value


def _read(file: h5py.File) -> Solution:
    control, statistics = file["control"], dict(file["statistics"].attrs)
    basis = ControlBasis(
        GENERATING_FUNCTIONS[control.attrs["generating_function"]],
        len(control["mesh"]) - 1,
        float(control.attrs["variance"]),
        bool(control.attrs["normalised"]),
    )
    interpolation = file["interpolation"]
    kind = interpolation.attrs["kind"]
    return Solution(
        _read_origin(file["problem"]),
        json.loads(file["problem"].attrs["options"]),
        Status[statistics["status"]],
        float(statistics["cost"]),
        control["mesh"][:],
        Trajectory(
            interpolation["time"][:],
            interpolation["state"][:],
            interpolation["start_slope"][:],
            interpolation["end_slope"][:],
            "cubic" if kind == "cubic" else "linear",
        ),
        basis,
        control["coefficients"][:],
        control["parameters"][:],
        file["trajectory/costate"][:],
        *_read_multipliers(file["multipliers"]),
        _read_evidence(file["statistics"], statistics),
        _read_statistics(statistics),
        {name: d[:] for name, d in file["iterations"].items() if name != "iteration"},
        file["dense/time"][:],
        _read_reference(file["dense"]),
    )


def _read_multipliers(
    group: h5py.Group,
) -> tuple[dict[str, Array], dict[str, MultiplierAxes]]:
    blocks = {d.attrs["block"]: (key, d) for key, d in group.items() if "block" in d.attrs}
    axes = {
        name: MultiplierAxes(
            group[f"{key}_time"][:], tuple(str(t) for t in group[f"{key}_row"].asstr())
        )
        for name, (key, _) in blocks.items()
    }
    return {name: d[:] for name, (_, d) in blocks.items()}, axes


def _read_origin(group: h5py.Group) -> Origin:
    def quantities(kind: str) -> tuple[Quantity, ...]:
        names, units = group[kind].asstr()[:], group[f"{kind}_unit"].asstr()[:]
        rows = zip(names, units, group[f"{kind}_lower"], group[f"{kind}_upper"], strict=True)
        return tuple(Quantity(str(n), str(u), float(low), float(up)) for n, u, low, up in rows)

    attributes = group.attrs
    return Origin(
        str(attributes["name"]),
        str(attributes["title"]),
        group["yaml"].asstr()[()],
        tuple((key, value) for key, value in json.loads(attributes["changes"])),
        quantities("state"),
        quantities("control"),
        quantities("parameter"),
        bool(attributes["free_times"]),
        bool(attributes["maximize"]),
    )


def _read_evidence(group: h5py.Group, attributes: Mapping[str, Any]) -> Evidence:
    rows = zip(
        group["constraint"].asstr()[:],
        *(group[f"violation_{name}"][:] for name in ("time", "amount", "scale")),
        strict=True,
    )
    values: dict[str, Any] = {
        "violations": tuple(Violation(str(c), float(t), float(a), float(s)) for c, t, a, s in rows)
    }
    values |= {name: tuple(float(v) for v in group[name]) for name in _BY_CONTROL}
    values |= {name: tuple(json.loads(attributes[name])) for name in _SENTENCES}
    for field in fields(Evidence):
        if field.name not in values:
            values[field.name] = float(attributes[field.name])
    return Evidence(**values)


def _read_statistics(attributes: Mapping[str, Any]) -> Statistics:
    iterations = int(attributes["iterations"])
    return Statistics(
        None if iterations < 0 else iterations,
        float(attributes["build_seconds"]),
        float(attributes["solve_seconds"]),
        int(attributes["unknowns"]),
        int(attributes["constraints"]),
        str(attributes["solver"]),
        str(attributes["solver_said"]),
    )


def _read_reference(group: h5py.Group) -> ReferenceSamples | None:
    if "reference_state" not in group:
        return None

    def number(name: str) -> float | None:
        value = float(group.attrs[f"reference_{name}"])
        return None if np.isnan(value) else value

    return ReferenceSamples(
        number("cost"),
        number("accuracy"),
        tuple(float(t) for t in group["switching_time"]),
        group["reference_state"][:],
        group["reference_control"][:],
    )
