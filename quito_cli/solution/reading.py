"""Open HDF5 file -> Solution; `store` has the layout."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from quito_cli.problem.shapes import Ball, Block
from quito_cli.solution.junctions import Junction
from quito_cli.solution.optimal import Arc, Condition, Extremal, Kind, Verdict
from quito_cli.solution.polish_file import check, read_densities, read_polishing
from quito_cli.solution.rounds import Account, Refinement, Round
from quito_cli.solution.solution import (
    Drawing,
    Evidence,
    MultiplierAxes,
    Origin,
    Quantity,
    ReferenceSamples,
    Solution,
    Statistics,
)
from quito_cli.solution.trajectory import Curve, Polynomials, Trajectory
from quito_cli.solution.violations import Violation
from quito_cli.solution.writing import BY_CONTROL, OF_JUNCTIONS, SENTENCES
from quito_cli.solvers.outcome import Status
from quito_cli.transcription.control import Basis, ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.polynomial import PolynomialBasis

if TYPE_CHECKING:
    import h5py

Array = NDArray[np.float64]


def read(file: h5py.File) -> Solution:
    """Return the Solution of a result file.

    Raises one of `store.DAMAGED` where the file's layout is not what it should be.
    """
    control, statistics = file["control"], dict(file["statistics"].attrs)
    trajectory, adjoint = _read_curves(file["interpolation"])
    return Solution(
        _read_origin(file["problem"]),
        json.loads(file["problem"].attrs["options"]),
        Status[statistics["status"]],
        float(statistics["cost"]),
        control["mesh"][:],
        trajectory,
        _read_basis(control),
        control["coefficients"][:],
        control["parameters"][:],
        file["trajectory/costate"][:],
        *_read_multipliers(file["multipliers"]),
        _read_evidence(file["statistics"], statistics),
        _read_statistics(statistics),
        {name: d[:] for name, d in file["iterations"].items() if name != "iteration"},
        file["dense/time"][:],
        _read_reference(file["dense"]),
        tuple(_read_drawing(group) for group in file.get("plots", {}).values()),
        adjoint,
        _read_junctions(file),
        _read_refinement(file["refinement"]) if "refinement" in file else None,
        _read_extremal(file["optimality"]) if "optimality" in file else None,
        read_polishing(file["polishing"]) if "polishing" in file else None,
        read_densities(file["densities"]) if "densities" in file else None,
    )


def _read_basis(group: h5py.Group) -> Basis:
    """Return the functions of the control, by the attributes that tell them from others."""
    attributes, cells = group.attrs, len(group["mesh"]) - 1
    if "degree" in attributes:
        return PolynomialBasis(cells, int(attributes["degree"]))
    return ControlBasis(
        GENERATING_FUNCTIONS[attributes["generating_function"]],
        cells,
        float(attributes["variance"]),
        bool(attributes["normalised"]),
        int(attributes["most_ghosts"]) if "most_ghosts" in attributes else None,
        group["index_slope"][:] if "index_slope" in group else None,
    )


def _read_junctions(file: h5py.File) -> tuple[Junction, ...]:
    """Return jumps and kinks; none from a file that is older than their detection."""
    if "junctions" not in file:
        return ()
    group, names = file["junctions"], [str(n) for n in file["problem/control"].asstr()]
    rows = zip(
        group["control"].asstr()[:],
        group["kind"].asstr()[:],
        *(group[name][:] for name in ("time", *OF_JUNCTIONS)),
        strict=True,
    )
    return tuple(
        Junction(names.index(control), "kink" if kind == "kink" else "jump", *map(float, numbers))
        for control, kind, *numbers in rows
    )


def _read_refinement(group: h5py.Group) -> Refinement:
    names = [field.name for field in fields(Round) if field.name != "nodes"]
    columns = {name: group[name][:].tolist() for name in names}  # as Python's own numbers
    rounds = tuple(
        Round(nodes=group[f"nodes_{i:03}"][:], **{name: columns[name][i] for name in names})
        for i in range(len(group["round"]))
    )
    account = _read_account(group["account"]) if "account" in group else None
    kept = int(group.attrs["kept"])
    if not 0 <= kept < len(rounds):
        raise ValueError("the mesh that was kept is none of those there are")
    return Refinement(rounds, kept, str(group.attrs["outcome"]), account)


def _read_account(group: h5py.Group) -> Account:
    zones = tuple((float(start), float(end)) for start, end in group["left_out"][:])
    names = [field.name for field in fields(Account) if field.name != "left_out"]
    return Account(left_out=zones, **{name: float(group.attrs[name]) for name in names})


def _read_extremal(group: h5py.Group) -> Extremal:
    arcs, rows = _columns(group["arcs"], Arc), _columns(group["certificate"], Condition)
    check(Kind, (arc["kind"] for arc in arcs))
    check(Verdict, (row["verdict"] for row in rows))
    return Extremal(
        tuple(Arc(**arc) for arc in arcs),
        tuple(Condition(**row) for row in rows),
        group["time"][:],
        {str(name): group["curves"][i] for i, name in enumerate(group["curve"].asstr()[:])},
    )


def _columns(group: h5py.Group, kind: Any) -> list[dict[str, Any]]:
    """Return the fields of a dataclass, value by value, as Python's own numbers and texts."""
    names = [field.name for field in fields(kind)]
    columns = [
        group[f.name][:].tolist() if f.type == "float" else map(str, group[f.name].asstr()[:])
        for f in fields(kind)
    ]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def _read_curves(group: h5py.Group) -> tuple[Curve, Polynomials | None]:
    """Return states, and costates where there are more than at the nodes, as curves."""
    kind, times, states = group.attrs["kind"], group["time"][:], group["state"][:]
    if kind == "polynomial":
        degree = int(group.attrs["degree"])
        if "costate" not in group:
            return Polynomials(times, states, degree), None
        before = group["costate_before"][:] if "costate_before" in group else None
        adjoint = Polynomials(times, group["costate"][:], degree, before)
        return Polynomials(times, states, degree), adjoint
    slopes = group["start_slope"][:], group["end_slope"][:]
    return Trajectory(times, states, *slopes, "cubic" if kind == "cubic" else "linear"), None


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
        name=str(attributes["name"]),
        title=str(attributes["title"]),
        text=group["yaml"].asstr()[()],
        changes=tuple((key, value) for key, value in json.loads(attributes["changes"])),
        states=quantities("state"),
        controls=quantities("control"),
        parameters=quantities("parameter"),
        free_times=bool(attributes["free_times"]),
        maximize=bool(attributes["maximize"]),
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
    values |= {name: tuple(float(v) for v in group[name]) for name in BY_CONTROL}
    values |= {name: tuple(json.loads(attributes[name])) for name in SENTENCES}
    for field in fields(Evidence):
        if field.name not in values:
            values[field.name] = float(attributes[field.name])
    return Evidence(**values)


def _read_statistics(attributes: Mapping[str, Any]) -> Statistics:
    iterations = int(attributes["iterations"])
    return Statistics(
        iterations=None if iterations < 0 else iterations,
        build_seconds=float(attributes["build_seconds"]),
        solve_seconds=float(attributes["solve_seconds"]),
        unknowns=int(attributes["unknowns"]),
        constraints=int(attributes["constraints"]),
        solver=str(attributes["solver"]),
        solver_said=str(attributes["solver_said"]),
        program=str(attributes.get("program", "NLP")),
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


def _read_drawing(group: h5py.Group) -> Drawing:
    def rows(kind: str) -> list[tuple[float, ...]]:
        return [tuple(float(number) for number in row) for row in group[kind][:]]

    curves = group["curve"].asstr()[:]
    return Drawing(
        str(group.attrs["name"]),
        str(group.attrs["title"]),
        tuple(str(label) for label in group["axis"].asstr()),
        {str(curve): group["coordinates"][i] for i, curve in enumerate(curves)},
        tuple(
            Ball(centre, float(radius))
            for centre, radius in zip(rows("ball_centre"), group["ball_radius"][:], strict=True)
        ),
        tuple(Block(*pair) for pair in zip(rows("box_centre"), rows("box_half"), strict=True)),
    )
