"""Result files: round trip, reproducible bytes, labelled axes, refusal of everything else."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray

import quito_cli as quito
from quito_cli.problem.load import load_text
from quito_cli.solution import writing
from quito_cli.solution.polishing import Polishing, PolishStatus, PolishStep

Solve = Callable[..., quito.Solution]

VECTOR = """
title: Vectors, units, two controls — and an umlaut (ü)
time: {initial: 0, final: 1}
states:
  x: {size: 2, initial: [1, 0], lower: -2, unit: m}
  y: {initial: 0}
controls:
  u: {size: 2, lower: [-1, null], upper: [1, 2], unit: N}
dynamics:
  x: "-x + u"
  y: x[0]*u[1]
cost: {lagrange: "dot(x, x) + 0.1*dot(u, u)", mayer: y^2}
"""
IMPOSSIBLE = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 10}, v: {initial: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2}
"""
ADAPTIVE: dict[str, Any] = {"mesh": "adaptive", "steps": 50, "mesh_iterations": 4}
ALL: dict[str, tuple[str, dict[str, Any]]] = {
    "reference": ("van_der_pol", {"steps": 20}),
    "vectors": (VECTOR, {"steps": 12, "generating_function": "laguerre4", "variance": 3.0}),
    "piecewise constant": ("bang_bang", {"steps": 15, "control": "piecewise-constant"}),
    "printed sum": ("catalyst_mixing", {"steps": 15, "normalised": False}),
    "linear states": ("bressan", {"steps": 10, "discretization": "euler"}),
    "infeasible": (IMPOSSIBLE, {"steps": 10}),
    "adaptive": ("van_der_pol", ADAPTIVE),
    "adaptive, one mesh": ("bang_bang", {"mesh": "adaptive", "steps": 20, "mesh_iterations": 1}),
    "adaptive, kinks": ("double_integrator_tracking", ADAPTIVE),
}
GROUPS = (
    "problem",
    "trajectory",
    "interpolation",
    "dense",
    "control",
    "junctions",
    "optimality",
    "optimality/arcs",
    "optimality/certificate",
    "multipliers",
    "iterations",
    "statistics",
)


LATER = ("junctions", "optimality")
"""Groups that older files do not have."""


@pytest.fixture(scope="module", params=ALL)
def solution(request: pytest.FixtureRequest, solve: Solve) -> quito.Solution:
    problem, options = ALL[request.param]
    return solve(problem, **options)


@pytest.fixture
def saved(tmp_path: Path, solve: Solve) -> Path:
    path = tmp_path / "a.h5"
    solve("van_der_pol", steps=20).save(path)
    return path


def equal(a: Any, b: Any) -> bool:
    """Equal to the last bit, through dataclasses, mappings and arrays; NaN equals NaN."""
    if isinstance(a, np.ndarray):
        return (
            isinstance(b, np.ndarray)
            and a.dtype == b.dtype
            and np.array_equal(a, b, equal_nan=True)
        )
    if isinstance(a, float):
        return isinstance(b, float) and (a == b or (math.isnan(a) and math.isnan(b)))
    if is_dataclass(a):
        same = type(a) is type(b)
        return same and all(equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(equal(a[k], b[k]) for k in a)
    if isinstance(a, tuple):
        same = isinstance(b, tuple) and len(a) == len(b)
        return same and all(equal(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)


def timeless(solution: quito.Solution) -> quito.Solution:
    """The same answer without what a clock had to say."""
    how = solution.refinement
    if how is not None:
        how = replace(how, rounds=tuple(replace(one, seconds=0.0) for one in how.rounds))
    clocked = replace(solution.statistics, build_seconds=0.0, solve_seconds=0.0)
    return replace(solution, statistics=clocked, refinement=how)


# Round trip


def test_loading_gives_back_what_was_saved(solution: quito.Solution, tmp_path: Path) -> None:
    solution.save(tmp_path / "a.h5")
    loaded = quito.Solution.load(tmp_path / "a.h5")
    for field in fields(quito.Solution):
        ours, theirs = getattr(solution, field.name), getattr(loaded, field.name)
        assert equal(ours, theirs), field.name


def test_a_loaded_answer_is_the_same_function_of_time(
    solution: quito.Solution, tmp_path: Path
) -> None:
    solution.save(str(tmp_path / "a.h5"))
    loaded = quito.Solution.load(str(tmp_path / "a.h5"))
    t = np.linspace(solution.times[0], solution.times[-1], 500)
    assert (loaded.control(t) == solution.control(t)).all()
    assert (loaded.state(t) == solution.state(t)).all()
    assert (loaded.costate(t) == solution.costate(t)).all()
    assert loaded.success is solution.success
    assert loaded.evidence.maximum_violation == solution.evidence.maximum_violation
    assert loaded.mesh.cells == solution.mesh.cells


# Reproducible


@pytest.mark.parametrize("name", ["reference", "vectors", "adaptive"])
def test_the_same_run_writes_the_same_bytes_but_for_times(name: str, tmp_path: Path) -> None:
    problem, options = ALL[name]
    contents = []
    for folder in ("a", "b"):
        path = tmp_path / folder / "same.h5"
        given = load_text(problem, "same.yaml") if "\n" in problem else quito.load(problem)
        timeless(quito.solve(given, **options)).save(path)
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]


def test_another_process_writes_the_same_bytes(tmp_path: Path) -> None:
    """Nothing depends on the order of a set, on memory or on the name of the file."""
    program = (
        "import sys, quito_cli as quito; from dataclasses import replace;"
        "s = quito.solve('van_der_pol', steps=10); t = s.statistics;"
        "replace(s, statistics=replace(t, build_seconds=0.0, solve_seconds=0.0)).save(sys.argv[1])"
    )
    other = tmp_path / "other.h5"
    environment = {**os.environ, "PYTHONHASHSEED": "1"}
    subprocess.run([sys.executable, "-c", program, str(other)], check=True, env=environment)
    timeless(quito.solve("van_der_pol", steps=10)).save(tmp_path / "here.h5")
    assert other.read_bytes() == (tmp_path / "here.h5").read_bytes()


def test_nothing_but_the_times_differs_between_two_runs(tmp_path: Path) -> None:
    contents = []
    for name in ("a.h5", "b.h5"):
        quito.solve("van_der_pol", steps=10).save(tmp_path / name)
        found: dict[str, Any] = {}

        def keep(where: str, item: Any, found: dict[str, Any] = found) -> None:
            if isinstance(item, h5py.Dataset):
                found[where] = repr(np.asarray(item[()]).tolist())
            for key in item.attrs:
                if key not in ("DIMENSION_LIST", "REFERENCE_LIST"):
                    found[f"{where}@{key}"] = repr(item.attrs[key])

        with h5py.File(tmp_path / name) as file:
            keep("/", file)
            file.visititems(keep)
        contents.append(found)
    assert contents[0].keys() == contents[1].keys()
    different = {key for key in contents[0] if contents[0][key] != contents[1][key]}
    assert different <= {"statistics@build_seconds", "statistics@solve_seconds"}


# Adaptive meshes


def test_a_graded_control_needs_the_slopes_of_its_index(tmp_path: Path, solve: Solve) -> None:
    solution = solve("van_der_pol", **ADAPTIVE)
    steps = np.diff(solution.times)
    assert steps.max() > 10 * steps.min()
    solution.save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        slopes = file["control/index_slope"]
        assert slopes.shape == (len(steps), 2)
        assert [slopes.dims[i].keys() for i in (0, 1)] == [["cell"], ["side"]]
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file["control/index_slope"]
    t = np.linspace(0, 4, 2000)
    without = quito.Solution.load(tmp_path / "a.h5").control(t)
    assert np.abs(without - solution.control(t)).max() > 1e-3


def test_the_rounds_of_a_refinement_are_labelled(tmp_path: Path, solve: Solve) -> None:
    solution = solve("van_der_pol", **ADAPTIVE)
    assert solution.refinement is not None
    solution.save(tmp_path / "a.h5")
    with xarray.open_dataset(tmp_path / "a.h5", group="refinement", engine="h5netcdf") as data:
        assert data["cells"].dims == data["change"].dims == ("round",)
        assert data["cells"].values[0] == 50
        for i, cells in enumerate(data["cells"].values):
            assert data[f"nodes_{i:03}"].size == cells + 1
        assert np.isnan(data["change"].values[0])
        kept = int(data.attrs["kept"])
        assert data[f"nodes_{kept:03}"].values == pytest.approx(solution.times)
        assert data.attrs["outcome"] == solution.refinement.outcome
    with xarray.open_dataset(tmp_path / "a.h5", group="junctions", engine="h5netcdf") as data:
        first = data.isel(time=0)
        assert (first["control"].item(), first["kind"].item()) == ("u", "jump")
        known = 1.3667400310631783
        assert first["time"].item() == pytest.approx(known, abs=first["uncertainty"].item())
        assert (first["before"].item(), first["after"].item()) == pytest.approx((-1, 1), abs=0.02)


def test_the_account_is_labelled_too(tmp_path: Path, solve: Solve) -> None:
    solution = solve("van_der_pol", **ADAPTIVE)
    assert solution.refinement is not None
    account = solution.refinement.account
    assert account is not None
    solution.save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        for where in ("refinement", "refinement/account"):
            for name, dataset in file[where].items():
                if isinstance(dataset, h5py.Dataset):
                    for dimension in dataset.dims:
                        assert dataset.is_scale or len(dimension) == 1, name
    with xarray.open_dataset(
        tmp_path / "a.h5", group="refinement/account", engine="h5netcdf"
    ) as data:
        assert data["left_out"].dims == ("zone", "side")
        assert data["left_out"].values.tolist() == [list(zone) for zone in account.left_out]
        assert data.attrs["meshes"] == account.meshes


@pytest.mark.parametrize("kept", [-1, 99])
def test_a_file_that_kept_a_mesh_there_is_none_of_is_refused(
    kept: int, tmp_path: Path, solve: Solve
) -> None:
    solve("van_der_pol", **ADAPTIVE).save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["refinement"].attrs["kept"] = kept
    refused(tmp_path / "a.h5")


def test_a_file_from_before_adaptive_meshes_is_read(saved: Path, solve: Solve) -> None:
    with h5py.File(saved, "r+") as file:
        del file["junctions"]
    loaded = quito.Solution.load(saved)
    assert loaded.refinement is None
    assert (loaded.junctions, loaded.switching_times) == ((), ())
    assert equal(loaded, replace(solve("van_der_pol", steps=20), junctions=()))


POLISHING = Polishing(
    PolishStatus.REFUSED,
    "the sign of dH/du fails at t = 0.5 — by 1e-3",
    (
        PolishStep("assume", "u: upper until 0.5, lower from there on"),
        PolishStep("solve", "three steps", (1.0, 1e-5, 3.3e-15)),
        PolishStep("drop", "nothing", (math.nan,)),
    ),
    3.3e-15,
    0.25,
    1.0 / 3.0,
    7,
    3,
)


@pytest.mark.parametrize(
    "account", [POLISHING, replace(POLISHING, steps=(), reason="", residual=math.nan)]
)
def test_the_account_of_a_polish_is_read_as_it_was_written(
    account: Polishing, tmp_path: Path, solve: Solve
) -> None:
    solution = solve("van_der_pol", steps=20)
    assert solution.polishing is None
    polished = replace(solution, polishing=account)
    polished.save(tmp_path / "a.h5")
    assert equal(quito.Solution.load(tmp_path / "a.h5"), polished)
    with xarray.open_dataset(tmp_path / "a.h5", group="polishing", engine="h5netcdf") as data:
        assert data["sentence"].dims == ("step",)
        assert data["residuals"].values.tolist() == [len(s.residuals) for s in account.steps]
        assert data["residual"].dims == ("solve",)


@pytest.mark.parametrize("where", ["status", "action"])
def test_an_account_with_a_word_that_there_is_not_is_refused(
    where: str, saved: Path, solve: Solve
) -> None:
    replace(solve("van_der_pol", steps=20), polishing=POLISHING).save(saved)
    with h5py.File(saved, "r+") as file:
        if where == "status":
            file["polishing"].attrs["status"] = "SHINY"
        else:
            file["polishing/action"][0] = "guess"
    refused(saved)


# What others see


def test_xarray_finds_labelled_axes(saved: Path, solve: Solve) -> None:
    solution = solve("van_der_pol", steps=20)
    with xarray.open_dataset(saved, group="trajectory", engine="h5netcdf") as data:
        assert data["state"].dims == ("time", "state_name")
        assert data["control"].dims == ("time", "control_name")
        assert data["costate"].dims == ("time", "state_name")
        assert data["state_name"].values.tolist() == ["x1", "x2"]
        assert data["control_name"].values.tolist() == ["u"]
        assert data["time"].values == pytest.approx(np.linspace(0, 4, 21), abs=1e-14)
        second = data["state"].sel(state_name="x2", time=0.0).item()
        assert second == 1.0
        assert data["costate"].values == pytest.approx(solution.costates)
    with xarray.open_dataset(saved, group="dense", engine="h5netcdf") as data:
        assert data.sizes["time"] == 2001
        near = data.sel(time=1.0, method="nearest")
        assert near["state"].values == pytest.approx(solution.state(1.0)[0], abs=1e-12)
        assert near["control"].values == pytest.approx(solution.control(1.0)[0], abs=1e-12)
        assert data["reference_control"].dims == ("time", "control_name")
        assert near["reference_control"].item() == -1
        assert data["switching_time"].values == pytest.approx([1.36674003, 2.46087438], abs=1e-8)
        assert data.attrs["reference_cost"] == pytest.approx(0.7576179286593919, abs=1e-13)


@pytest.mark.parametrize("group", GROUPS)
def test_every_axis_of_every_group_has_a_name(
    group: str, solution: quito.Solution, tmp_path: Path
) -> None:
    path = tmp_path / "a.h5"
    solution.save(path)
    with xarray.open_dataset(path, group=group, engine="h5netcdf") as data:
        names = {str(name) for name in data.sizes}
        assert not any("phony" in name for name in names), names
        for variable in data.variables.values():
            assert len(set(variable.dims)) == len(variable.dims)
        data.load()
    with h5py.File(path) as file:
        adaptive = () if solution.refinement is None else ("refinement",)
        assert set(file) == {*(name.split("/")[0] for name in GROUPS), *adaptive}
        for name, dataset in file[group].items():
            for dimension in () if isinstance(dataset, h5py.Group) else dataset.dims:
                assert dataset.is_scale or len(dimension) == 1, name


def test_the_other_groups_are_labelled_too(tmp_path: Path, solve: Solve) -> None:
    problem, options = ALL["vectors"]
    solution = solve(problem, **options)
    solution.save(tmp_path / "a.h5")

    def opened(group: str) -> xarray.Dataset:
        return xarray.load_dataset(tmp_path / "a.h5", group=group, engine="h5netcdf")

    control = opened("control")
    assert control["coefficients"].dims == ("index", "control_name")
    assert control["control_name"].values.tolist() == ["u[0]", "u[1]"]
    assert control["index"].values.tolist() == solution.basis.centres.tolist()
    assert control["mesh"].values == pytest.approx(np.linspace(0, 1, 13))
    assert control.attrs["generating_function"] == "laguerre4"
    assert control.attrs["variance"] == 3.0
    iterations = opened("iterations")
    assert iterations["objective"].dims == ("iteration",)
    assert iterations.sizes["iteration"] == (solution.statistics.iterations or 0) + 1
    assert iterations["objective"].values[-1] == pytest.approx(solution.cost, rel=1e-6)
    assert {"primal_infeasibility", "dual_infeasibility", "barrier_parameter"} <= set(iterations)
    statistics = opened("statistics")
    assert statistics["total_variation"].dims == ("control_name",)
    assert statistics["violation_amount"].dims == ("constraint",)
    assert "x[0] >= -2" in statistics["constraint"].values.tolist()
    assert statistics.attrs["cost"] == solution.cost
    assert bool(statistics.attrs["success"]) is True
    problem_group = opened("problem")
    assert problem_group["state_unit"].values.tolist() == ["m", "m", ""]
    assert problem_group["control_upper"].values.tolist() == [1, 2]


def test_the_file_carries_the_problem_and_the_versions(tmp_path: Path, solve: Solve) -> None:
    problem, options = ALL["vectors"]
    solve(problem, **options).save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        text = file["problem/yaml"].asstr()[()]
        assert text == problem
        digest = hashlib.sha256(problem.encode()).hexdigest()
        assert digest in {str(value) for value in file["problem"].attrs.values()}
        stored = json.loads(file["problem"].attrs["options"])
        assert stored["steps"] == 12
        assert stored["variance"] == 3.0
        assert stored["tolerance"] == 1e-9
        for name in ("quito", "casadi", "numpy", "h5py", "python"):
            assert file.attrs[f"{name}_version"]
        assert file.attrs["format"] == "quito result"
        assert file.attrs["format_version"] == 1


# Refusal


def refused(path: Path) -> str:
    with pytest.raises(quito.ResultFileError) as caught:
        quito.Solution.load(path)
    assert caught.value.exit_code == 2
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_a_newer_format_is_refused(saved: Path) -> None:
    with h5py.File(saved, "a") as file:
        file.attrs["format_version"] = 99
        del file["control"]  # a newer file may look different: the version is read first
    message = refused(saved)
    assert "99" in message
    assert "update" in message


def test_a_missing_file_or_a_folder_is_refused(tmp_path: Path) -> None:
    assert "no file" in refused(tmp_path / "nothing.h5")
    refused(tmp_path)


@pytest.mark.parametrize("content", [b"", b"title: no HDF5\n", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_what_is_not_hdf5_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(content)
    refused(path)


def test_foreign_hdf5_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(3)
    assert "no result of quito" in refused(path)
    with h5py.File(path, "a") as file:
        file.attrs["format"] = "quito result"
    refused(path)
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 1
    refused(path)


@pytest.mark.parametrize("fraction", [0.02, 0.2, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_refused(fraction: float, saved: Path) -> None:
    content = saved.read_bytes()
    saved.write_bytes(content[: int(fraction * len(content))])
    refused(saved)


@pytest.mark.parametrize("group", [group for group in GROUPS if group not in LATER])
def test_a_file_that_lacks_a_group_is_refused(group: str, saved: Path) -> None:
    with h5py.File(saved, "a") as file:
        del file[group]
    refused(saved)


@pytest.mark.parametrize("group", GROUPS)
def test_a_file_with_something_else_in_place_of_a_group_is_refused(group: str, saved: Path) -> None:
    with h5py.File(saved, "a") as file:
        del file[group]
        file[group] = 1.0
    refused(saved)


@pytest.mark.parametrize(
    ("where", "name", "value"),
    [
        ("problem", "options", "{"),
        ("problem", "changes", "3"),
        ("statistics", "status", "HAPPY"),
        ("statistics", "cost", "much"),
        ("control", "generating_function", "unknown"),
        ("/", "format_version", "one"),
    ],
)
def test_a_file_with_a_wrong_attribute_is_refused(
    where: str, name: str, value: str, saved: Path
) -> None:
    with h5py.File(saved, "a") as file:
        assert name in file[where].attrs
        file[where].attrs[name] = value
    refused(saved)


def test_whatever_the_library_says_of_a_damaged_file_it_is_refused(
    saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A flipped byte makes h5py raise this; flipping bytes here could make the library crash."""

    def damaged(file: h5py.File) -> None:
        raise RuntimeError("Error iterating over attributes (ran off end of input buffer)")

    monkeypatch.setattr("quito_cli.solution.reading.read", damaged)
    refused(saved)


# Writing


def test_folders_are_made(tmp_path: Path, solve: Solve) -> None:
    solve("van_der_pol", steps=20).save(tmp_path / "new" / "deeper" / "a.h5")
    assert (tmp_path / "new" / "deeper" / "a.h5").is_file()


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), ValueError("broken")])
@pytest.mark.parametrize("existing", [True, False])
def test_a_failed_write_leaves_the_older_file_and_nothing_else(
    error: Exception,
    existing: bool,
    tmp_path: Path,
    solve: Solve,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "a.h5"
    solution = solve("van_der_pol", steps=20)
    if existing:
        solution.save(path)
    before = path.read_bytes() if existing else None

    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr(writing, "_write_statistics", fail)
    expected = quito.ResultFileError if isinstance(error, OSError) else ValueError
    with pytest.raises(expected):
        solution.save(path)
    monkeypatch.undo()
    assert [entry.name for entry in tmp_path.iterdir()] == (["a.h5"] if existing else [])
    if existing:
        assert path.read_bytes() == before
        assert quito.Solution.load(path).success


def test_an_interrupted_write_leaves_nothing_behind(
    tmp_path: Path, solve: Solve, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        solve("van_der_pol", steps=20).save(tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path, solve: Solve) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(quito.ResultFileError, match="cannot be written"):
        solve("van_der_pol", steps=20).save(tmp_path / "file" / "a.h5")
    (tmp_path / "folder.h5").mkdir()
    with pytest.raises(quito.ResultFileError, match="cannot be written"):
        solve("van_der_pol", steps=20).save(tmp_path / "folder.h5")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["file", "folder.h5"]


def test_plots_of_the_file_come_back(solve: Solve, tmp_path: Path) -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {size: 2, initial: 0}}
controls: {u: {size: 2}}
dynamics: {x: u}
cost: {lagrange: "dot(u - 1, u - 1)"}
plots:
  second: {curves: {a: x, b: u}, circles: [{centre: [1, 2], radius: 3}]}
  first: {title: In space, curves: {c: ["x[0]", "x[1]", t]}, boxes: [{centre: 1, half: [1, 2, 3]}]}
"""
    solution = solve(text, steps=6)
    solution.save(tmp_path / "a.h5")
    loaded = quito.Solution.load(tmp_path / "a.h5")
    for given, found in zip(solution.drawings, loaded.drawings, strict=True):
        assert list(found.curves) == list(given.curves)
        for name, points in given.curves.items():
            assert np.array_equal(found.curves[name], points)
        assert replace(found, curves={}) == replace(given, curves={})
    dataset = xarray.open_dataset(tmp_path / "a.h5", group="plots/plot_000", engine="h5netcdf")
    assert dataset["coordinates"].dims == ("curve", "time", "axis")
