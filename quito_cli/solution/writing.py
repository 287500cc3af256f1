"""Solution -> open HDF5 file; `store` has the layout."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.solution.groups import Attributes, Group, texts
from quito_cli.solution.optimal import Arc, Condition, Extremal
from quito_cli.solution.solution import Drawing, Evidence, Solution
from quito_cli.solution.trajectory import Polynomials, Trajectory
from quito_cli.transcription.control import ControlBasis

if TYPE_CHECKING:
    import h5py

    from quito_cli.solution.rounds import Refinement

Array = NDArray[np.float64]

FORMAT = "quito result"
FORMAT_VERSION = 1
BY_CONTROL = ("total_variation", "ringing")
"""Figures of the evidence that are arrays along the controls."""
SENTENCES = ("warnings", "diagnosis")
"""Those that are lists of sentences."""
OF_JUNCTIONS = ("uncertainty", "before", "after", "blur")
"""Figures of the junctions that are arrays along them."""


def write(file: h5py.File, solution: Solution) -> None:
    """Write all groups of a result file."""
    import casadi
    import h5py

    import quito_cli

    root = Attributes(file.id)
    root["format"], root["format_version"] = FORMAT, FORMAT_VERSION
    versions = {"quito": quito_cli.__version__, "casadi": casadi.CasadiMeta.version()}
    versions |= {"numpy": np.__version__, "h5py": h5py.__version__}
    versions |= {"python": platform.python_version()}
    for name, version in versions.items():
        root[f"{name}_version"] = version
    _write_problem(Group(file, "problem"), solution)
    _write_trajectory(Group(file, "trajectory"), solution)
    _write_interpolation(Group(file, "interpolation"), solution)
    _write_dense(Group(file, "dense"), solution)
    _write_control(Group(file, "control"), solution)
    _write_junctions(Group(file, "junctions"), solution)
    if solution.refinement is not None:
        _write_refinement(Group(file, "refinement"), solution.refinement)
    if solution.extremal is not None:
        _write_extremal(Group(file, "optimality"), solution.extremal)
    _write_polish(file, solution)
    multipliers = Group(file, "multipliers")
    for name, values in sorted(solution.multipliers.items()):
        key = name.replace(" ", "_")
        axes = solution.multiplier_axes[name]
        multipliers.axis(f"{key}_time", axes.times)
        multipliers.axis(f"{key}_row", texts(axes.labels))
        written = multipliers.data(key, values, f"{key}_time", f"{key}_row")
        written["block"] = name
    iterations = Group(file, "iterations")
    length = max((len(values) for values in solution.history.values()), default=0)
    iterations.axis("iteration", np.arange(length))
    for name, values in sorted(solution.history.items()):
        iterations.data(name, values, "iteration")
    _write_statistics(Group(file, "statistics"), solution)
    for i, drawing in enumerate(solution.drawings):
        _write_drawing(Group(file, f"plots/plot_{i:03}"), drawing, solution.dense_times)


def _write_problem(into: Group, solution: Solution) -> None:
    origin = solution.origin
    into.dataset("yaml", origin.text)
    attributes = into.attributes
    attributes["name"], attributes["title"] = origin.name, origin.title
    attributes["sha256"] = hashlib.sha256(origin.text.encode()).hexdigest()
    attributes["changes"] = json.dumps(origin.changes)
    attributes["options"] = json.dumps(dict(solution.options))
    attributes["free_times"], attributes["maximize"] = origin.free_times, origin.maximize
    kinds = {"state": origin.states, "control": origin.controls, "parameter": origin.parameters}
    for kind, quantities in kinds.items():
        into.axis(kind, texts(q.name for q in quantities))
        into.data(f"{kind}_unit", texts(q.unit for q in quantities), kind)
        into.data(f"{kind}_lower", np.array([q.lower for q in quantities]), kind)
        into.data(f"{kind}_upper", np.array([q.upper for q in quantities]), kind)


def _axes(into: Group, solution: Solution, times: Array) -> None:
    into.axis("time", times)
    into.axis("state_name", texts(q.name for q in solution.origin.states))
    into.axis("control_name", texts(q.name for q in solution.origin.controls))


def _write_trajectory(into: Group, solution: Solution) -> None:
    _axes(into, solution, solution.times)
    nodes = solution.trajectory(solution.times)
    into.data("state", nodes, "time", "state_name")
    into.data("control", solution.control(solution.times), "time", "control_name")
    into.data("costate", solution.costates, "time", "state_name")


def _write_interpolation(into: Group, solution: Solution) -> None:
    trajectory = solution.trajectory
    into.attributes["kind"] = trajectory.interpolation
    into.axis("time", trajectory.times)
    into.axis("step", np.arange(len(trajectory.times) - 1))
    into.axis("state_name", texts(q.name for q in solution.origin.states))
    into.data("state", trajectory.states, "time", "state_name")
    if isinstance(trajectory, Trajectory):
        into.data("start_slope", trajectory.start_slopes, "step", "state_name")
        into.data("end_slope", trajectory.end_slopes, "step", "state_name")
    if isinstance(trajectory, Polynomials):
        into.attributes["degree"] = trajectory.degree
    if (adjoint := solution.adjoint) is not None:
        into.data("costate", adjoint.states, "time", "state_name")
        if adjoint.before is not None:
            into.axis("cell", np.arange(len(adjoint.before)))
            into.data("costate_before", adjoint.before, "cell", "state_name")


def _write_dense(into: Group, solution: Solution) -> None:
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
            into.attributes[f"reference_{name}"] = np.nan if value is None else value


def _write_control(into: Group, solution: Solution) -> None:
    basis = solution.basis
    into.axis("index", basis.centres)
    into.axis("node", np.arange(len(solution.times)))
    into.axis("control_name", texts(q.name for q in solution.origin.controls))
    into.data("coefficients", solution.coefficients, "index", "control_name")
    into.data("mesh", solution.times, "node")
    into.axis("parameter_name", texts(q.name for q in solution.origin.parameters))
    into.data("parameters", solution.parameters, "parameter_name")
    for name, value in basis.attributes.items():
        into.attributes[name] = value
    if isinstance(basis, ControlBasis) and basis.index_slopes is not None:
        into.axis("cell", np.arange(basis.cells))
        into.axis("side", texts(("start", "end")))
        into.data("index_slope", basis.index_slopes, "cell", "side")


def _write_junctions(into: Group, solution: Solution) -> None:
    found, controls = solution.junctions, solution.origin.controls
    into.axis("time", np.array([j.time for j in found], dtype=float))
    into.data("control", texts(controls[j.control].name for j in found), "time")
    into.data("kind", texts(j.kind for j in found), "time")
    for name in OF_JUNCTIONS:
        into.data(name, np.array([getattr(j, name) for j in found], dtype=float), "time")


def _write_polish(file: h5py.File, solution: Solution) -> None:
    """Write the account of a polish, and the multipliers of what it found, where they are."""
    if solution.polishing is None and solution.densities is None:
        return
    from quito_cli.solution.polish_file import write_densities, write_polishing

    if solution.polishing is not None:
        write_polishing(Group(file, "polishing"), solution.polishing)
    if solution.densities is not None:
        write_densities(Group(file, "densities"), solution.densities)


def _write_refinement(into: Group, refinement: Refinement) -> None:
    from quito_cli.solution.rounds import Round

    rounds, account = refinement.rounds, refinement.account
    into.attributes["kept"], into.attributes["outcome"] = refinement.kept, refinement.outcome
    into.axis("round", np.arange(len(rounds)))
    into.data("cells", np.array([one.cells for one in rounds]), "round")
    for field in fields(Round):
        if field.name != "nodes":
            into.data(field.name, np.array([getattr(one, field.name) for one in rounds]), "round")
    for i, one in enumerate(rounds):
        into.axis(f"nodes_{i:03}", one.nodes)
    if account is None:
        return
    numbers = asdict(account)
    zones = np.array(numbers.pop("left_out"), dtype=float).reshape(-1, 2)
    inner = Group(into.group, "account")
    inner.axis("zone", np.arange(len(zones)))
    inner.axis("side", texts(("start", "end")))
    inner.data("left_out", zones, "zone", "side")
    for name, value in numbers.items():
        inner.attributes[name] = value


def _write_extremal(into: Group, extremal: Extremal) -> None:
    arcs, rows = Group(into.group, "arcs"), Group(into.group, "certificate")
    arcs.axis("arc", np.arange(len(extremal.arcs)))
    _write_fields(arcs, Arc, extremal.arcs, "arc")
    rows.axis("row", np.arange(len(extremal.certificate)))
    _write_fields(rows, Condition, extremal.certificate, "row")
    into.axis("time", extremal.times)
    into.axis("curve", texts(extremal.curves))
    curves = np.array(list(extremal.curves.values()), dtype=float)
    into.data("curves", curves.reshape(len(curves), len(extremal.times)), "curve", "time")


def _write_fields(into: Group, kind: Any, values: tuple[Any, ...], axis: str) -> None:
    """Write each field of a dataclass, text or number, along the values."""
    for field in fields(kind):
        column = [getattr(value, field.name) for value in values]
        numbers = field.type == "float"  # the annotation as it is written
        array = np.array(column, dtype=float) if numbers else texts(map(str, column))
        into.data(field.name, array, axis)


def _write_statistics(into: Group, solution: Solution) -> None:
    evidence = solution.evidence
    attributes = into.attributes
    attributes["status"], attributes["success"] = solution.status.name, solution.success
    attributes["status_sentence"] = solution.status.value
    attributes["cost"] = solution.cost
    attributes["maximum_violation"] = evidence.maximum_violation
    numbers = {f.name: getattr(evidence, f.name) for f in fields(Evidence)} | asdict(
        solution.statistics
    )
    into.axis("control_name", texts(q.name for q in solution.origin.controls))
    for name in BY_CONTROL:
        into.data(name, np.array(numbers.pop(name), dtype=float), "control_name")
    for name in SENTENCES:
        attributes[name] = json.dumps(numbers.pop(name), ensure_ascii=False)
    found = numbers.pop("violations")
    into.axis("constraint", texts(v.constraint for v in found))
    for name in ("time", "amount", "scale"):
        values = np.array([getattr(v, name) for v in found], dtype=float)
        into.data(f"violation_{name}", values, "constraint")
    for name, value in numbers.items():
        attributes[name] = -1 if value is None else value


def _write_drawing(into: Group, drawing: Drawing, times: Array) -> None:
    into.attributes["name"], into.attributes["title"] = drawing.name, drawing.title
    into.axis("curve", texts(drawing.curves))
    into.axis("time", times)
    into.axis("axis", texts(drawing.labels))
    into.data("coordinates", np.array(list(drawing.curves.values())), "curve", "time", "axis")
    axes, balls, boxes = len(drawing.labels), drawing.balls, drawing.blocks
    into.axis("ball", np.arange(len(balls)))
    into.data("ball_centre", np.array([b.centre for b in balls]).reshape(-1, axes), "ball", "axis")
    into.data("ball_radius", np.array([b.radius for b in balls]), "ball")
    into.axis("box", np.arange(len(boxes)))
    into.data("box_centre", np.array([b.centre for b in boxes]).reshape(-1, axes), "box", "axis")
    into.data("box_half", np.array([b.half for b in boxes]).reshape(-1, axes), "box", "axis")
