"""What the generating functions are like: against quadrature, Poisson's formula and plain sums; the
command that prints it, the warning of a solve, and what each of the six makes of two problems."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

import quito_cli as quito
from quito_cli.cli.app import main
from quito_cli.options import Options
from quito_cli.plots.generating import figure
from quito_cli.problem.load import load_text
from quito_cli.solving.on_mesh import SATURATION_LIMIT
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.qualities import (
    all_qualities,
    enough_variance,
    jump,
    order,
    saturation,
    saturation_warning,
)

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Run = Callable[..., tuple[int, str, str]]

GAUSS = math.sqrt(math.pi)
PSI: dict[str, Callable[[Array], Array]] = {
    "gaussian": lambda x: np.exp(-(x**2)) / GAUSS,
    "laguerre4": lambda x: (1.5 - x**2) * np.exp(-(x**2)) / GAUSS,
    "laguerre6": lambda x: (1.875 - 2.5 * x**2 + x**4 / 2) * np.exp(-(x**2)) / GAUSS,
    "hermite10": lambda x: (
        (315 / 128 - 105 * x**2 / 16 + 63 * x**4 / 16 - 0.75 * x**6 + x**8 / 24)
        * np.exp(-(x**2))
        / GAUSS
    ),
    "trigonometric": lambda x: (
        math.sqrt(math.e / math.pi) * np.exp(-(x**2)) * np.cos(np.sqrt(2) * x)
    ),
    "sech": lambda x: 1 / np.cosh(x) / np.pi,
}
"""The formulas of the paper, corrected, in its order."""
SIX = tuple(PSI)
POSITIVE = ("gaussian", "sech")
ORDERS = dict(zip(SIX, (2, 4, 6, 10, 4, 2), strict=True))
FAR = 40
"""Beyond it, every ψ is below 1e-17."""


def transform(name: str, w: float) -> float:
    """Fψ(w) = ∫ ψ(x) cos(2πwx) dx."""
    return float(
        2 * quad(PSI[name], 0, FAR, weight="cos", wvar=2 * math.pi * w, epsabs=1e-13, limit=400)[0]
    )


def slope_of_transform(name: str, w: float) -> float:
    """(Fψ)'(w) = −2π ∫ x ψ(x) sin(2πwx) dx."""
    wave = 2 * math.pi * w
    whole = quad(
        lambda x: x * PSI[name](x), 0, FAR, weight="sin", wvar=wave, epsabs=1e-13, limit=400
    )[0]
    return float(-4 * math.pi * whole)


def plain_weights(name: str, s: Array, variance: float, normalised: bool) -> tuple[Array, Indices]:
    """w_m(s) and m by the plain formula, nothing cut, far from the ends of the row."""
    root = math.sqrt(variance)
    m = np.arange(-math.ceil(FAR * root), math.ceil(FAR * root) + 2)
    weights = PSI[name]((s[:, None] - m) / root)
    return weights / (weights.sum(axis=1, keepdims=True) if normalised else root), m


def plain_jump(name: str, variance: float, normalised: bool) -> tuple[Array, Array]:
    """s and Σ_{m>0} w_m(s) for places s around the jump at 1/2."""
    s = np.linspace(-9 * math.sqrt(variance), 9 * math.sqrt(variance), 9001) + 0.5
    weights, m = plain_weights(name, s, variance, normalised)
    return s, weights[:, m > 0].sum(axis=1)


def rise(s: Array, u: Array) -> float:
    """The distance of the places where u last is at 10 % and first at 90 %."""
    top = np.flatnonzero(u >= 0.9)[0]
    return float(s[top] - s[np.flatnonzero(u[:top] <= 0.1)[-1]])


def total(name: str, x: float) -> float:
    """∫ψ up to x: the jump for a variance so large that the nodes do not count."""
    return 0.5 + float(quad(PSI[name], 0, x, epsabs=1e-12, limit=200)[0])


# Figures


@pytest.mark.parametrize("name", SIX)
def test_the_order_is_that_of_the_first_moment_that_does_not_vanish(name: str) -> None:
    for k in range(1, ORDERS[name]):
        assert quad(lambda x, k=k: x**k * PSI[name](x), -FAR, FAR, limit=400)[0] == pytest.approx(
            0, abs=1e-8
        )
    k = ORDERS[name]
    assert abs(quad(lambda x: x**k * PSI[name](x), -FAR, FAR, limit=400)[0]) > 0.1
    assert order(GENERATING_FUNCTIONS[name]) == ORDERS[name] == GENERATING_FUNCTIONS[name].order


@pytest.mark.parametrize("variance", [0.5, 1.0, 1.5])
def test_saturation_of_the_gaussian_in_closed_form(variance: float) -> None:
    row, decay = GENERATING_FUNCTIONS["gaussian"], math.exp(-(math.pi**2) * variance)
    assert saturation(row, variance, False) == pytest.approx(2 * decay, rel=1e-3, abs=1e-8)
    line = 2 * math.pi * variance * decay
    assert saturation(row, variance, True) == pytest.approx(line, rel=2e-2, abs=1e-8)


@pytest.mark.parametrize("name", SIX)
@pytest.mark.parametrize("variance", [0.7, 1.0, 2.0])
def test_saturation_by_the_summation_formula(name: str, variance: float) -> None:
    """Σ ψ((s−m)/√D)/√D = 1 + 2 Σ_ν F(√Dν) cos 2πνs, and with (m−s): √D/π Σ_ν F'(√Dν) sin 2πνs."""
    row, root = GENERATING_FUNCTIONS[name], math.sqrt(variance)
    s = np.linspace(0, 1, 513)
    ripple = np.zeros_like(s)
    slope = np.zeros_like(s)
    for v in range(1, 5):
        ripple += 2 * transform(name, root * v) * np.cos(2 * math.pi * v * s)
        slope += root / math.pi * slope_of_transform(name, root * v) * np.sin(2 * math.pi * v * s)
    assert saturation(row, variance, False) == pytest.approx(
        np.abs(ripple).max(), rel=1e-3, abs=2e-8
    )
    assert saturation(row, variance, True) == pytest.approx(
        np.abs(slope / (1 + ripple)).max(), rel=5e-3, abs=2e-7
    )


@pytest.mark.parametrize("name", SIX)
@pytest.mark.parametrize("variance", [0.7, 2.0])
def test_saturation_is_what_a_control_misses(name: str, variance: float) -> None:
    """A constant as printed, and normalised a line that rises by one in a cell, from coefficients
    that are its values."""
    row = GENERATING_FUNCTIONS[name]
    cells = np.repeat(np.arange(60, 62), 40)
    offsets = np.tile(np.arange(40) / 40, 2)
    for normalised in (True, False):
        basis = ControlBasis(row, 121, variance, normalised)
        line = basis.centres if normalised else np.ones(basis.count)
        found = basis.evaluate(line[:, None], cells, offsets)[:, 0]
        missed = np.abs(found - (cells + offsets if normalised else 1)).max()
        assert saturation(row, variance, normalised) == pytest.approx(missed, rel=2e-2, abs=1e-8)


@pytest.mark.parametrize("name", SIX)
@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize("variance", [0.7, 2.0, 9.0])
def test_lebesgue_constant_overshoot_and_width_are_those_of_plain_sums(
    name: str, normalised: bool, variance: float
) -> None:
    rows = all_qualities(variance, normalised, SATURATION_LIMIT)
    (row,) = (row for row in rows if row.function.name == name)
    weights, _ = plain_weights(name, np.linspace(0, 1, 201), variance, normalised)
    assert row.lebesgue_constant == pytest.approx(np.abs(weights).sum(axis=1).max(), abs=1e-4)
    s, u = plain_jump(name, variance, normalised)
    assert row.overshoot == pytest.approx(max(0.0, u.max() - 1), abs=1e-4)
    assert row.width == pytest.approx(rise(s, u), abs=6e-3 * math.sqrt(variance))


@pytest.mark.parametrize("name", POSITIVE)
def test_a_positive_function_neither_overshoots_nor_amplifies(name: str) -> None:
    rows = all_qualities(2.0, True, SATURATION_LIMIT)
    (row,) = (row for row in rows if row.function.name == name)
    assert row.lebesgue_constant == pytest.approx(1, abs=1e-12)
    assert row.overshoot == 0


def test_the_jump_of_the_gaussian_is_an_error_function() -> None:
    """Of variance D/2 for many nodes. For few it is narrower: averaged over a cell (variance 1/12),
    the sum over nodes gives the integral."""
    quantile = 1.2815515655
    for variance in (2.0, 20.0):
        row = all_qualities(variance, True, SATURATION_LIMIT)[0]
        assert row.width == pytest.approx(
            2 * quantile * math.sqrt(variance / 2), rel=0.1 / variance
        )
        expected = 2 * quantile * math.sqrt(variance / 2 - 1 / 12)
        assert row.width == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("name", SIX)
def test_a_wide_jump_is_the_integral_of_psi(name: str) -> None:
    variance = 60.0
    (row,) = (r for r in all_qualities(variance, True, 1e-4) if r.function.name == name)
    x = np.linspace(0, 4, 201)
    expected = [total(name, float(a)) for a in x]
    assert row.overshoot == pytest.approx(max(0.0, max(expected) - 1), abs=2e-3)
    edge = float(brentq(lambda a: total(name, a) - 0.9, 0, x[int(np.argmax(expected))] or 4))
    assert row.width == pytest.approx(2 * edge * math.sqrt(variance), rel=1e-2)


@pytest.mark.parametrize("name", SIX)
def test_the_jump_is_odd_about_its_middle(name: str) -> None:
    s, u = jump(GENERATING_FUNCTIONS[name], 2.0, True)
    assert np.interp(0, s, u) == pytest.approx(0.5, abs=1e-12)
    places = np.linspace(0, 4, 50)
    assert np.interp(places, s, u) + np.interp(-places, s, u) == pytest.approx(
        np.ones(50), abs=1e-6
    )


@pytest.mark.parametrize("name", SIX)
@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize("limit", [1e-2, 1e-4, 1e-6])
def test_the_variance_that_is_enough_is_the_smallest_hundredth(
    name: str, normalised: bool, limit: float
) -> None:
    row = GENERATING_FUNCTIONS[name]
    enough = enough_variance(row, normalised, limit)
    assert enough is not None
    assert enough == pytest.approx(round(100 * enough) / 100, abs=1e-12)
    assert saturation(row, enough, normalised) <= limit
    assert saturation(row, enough - 0.01, normalised) > limit


def test_no_variance_gets_below_the_cut() -> None:
    assert enough_variance(GENERATING_FUNCTIONS["sech"], True, 1e-12) is None


def test_what_a_variance_refused_leaves_open() -> None:
    rows = {row.function.name: row for row in all_qualities(0.6, True, SATURATION_LIMIT)}
    refused = rows["hermite10"]
    assert (refused.saturation, refused.lebesgue_constant) == (None, None)
    assert (refused.overshoot, refused.width) == (None, None)
    assert refused.least_variance > 0.6
    assert refused.enough_variance
    assert all(row.width for name, row in rows.items() if name != "hermite10")
    with pytest.raises(quito.UsageError, match=r"sech takes 0\.2\d or more$"):
        all_qualities(0.1, True, SATURATION_LIMIT)


# The warning


def warnings_of(solution: quito.Solution) -> list[str]:
    return [text for text in solution.evidence.warnings if "saturation" in text]


def test_a_tenth_of_the_mesh_tolerance() -> None:
    assert Options.mesh_tolerance / 10 == SATURATION_LIMIT


@pytest.mark.parametrize("name", SIX)
def test_a_solve_warns_and_the_variance_it_names_is_silent_and_hardly_larger(name: str) -> None:
    """The file's bounds do not matter to normalised weights; 1 is refused by none of the six."""

    def told(variance: float) -> list[str]:
        return warnings_of(
            quito.solve("bang_bang", steps=10, generating_function=name, variance=variance)
        )

    (text,) = told(1.0)
    found = re.search(r"to (\S+) of its range .* saturation of (\w+); .* at least ([\d.]+)$", text)
    assert found
    s = np.linspace(0, 1, 101)
    weights, m = plain_weights(name, s, 1.0, True)
    error = np.abs((weights * (m - s[:, None])).sum(axis=1)).max()
    assert float(found[1]) == pytest.approx(error, rel=0.06)
    assert found[2] == name
    enough = float(found[3])
    assert told(enough) == []
    assert told(enough - 0.02) != []


def test_the_warning_is_in_the_file_the_json_and_the_summary(run: Run, tmp_path: Path) -> None:
    options = ("-N", "20", "--variance", "0.7", "--no-plot")
    code, out, err = run("solve", "alychan", *options, "--json")
    assert (code, err) == (0, "")
    (text,) = (text for text in json.loads(out)["warnings"] if "saturation" in text)
    assert text.startswith("with variance 0.7 the control is only accurate to 0.0044 of its range")
    assert warnings_of(quito.Solution.load(tmp_path / "results" / "alychan.h5")) == [text]
    assert f"Warning: {text}\n" in run("solve", "alychan", *options)[1]
    assert f"Warning: {text}\n" in run("show", "results/alychan.h5")[1]


@pytest.mark.parametrize("name", [n for n in SIX if n != "hermite10"])
def test_the_default_variance_is_enough(name: str) -> None:
    assert not warnings_of(quito.solve("bang_bang", steps=10, generating_function=name))


@pytest.mark.parametrize("control", ["piecewise-constant", "piecewise-linear"])
def test_the_classical_controls_have_no_saturation(control: str) -> None:
    assert not warnings_of(quito.solve("bang_bang", steps=10, control=control))


def test_without_a_control_there_is_no_warning() -> None:
    text = "time: {initial: 0, final: 1}\nstates: {x: {initial: 1}}\ndynamics: {x: -x}\n"
    found = quito.solve(load_text(text + "cost: {mayer: x}\n", "x.yaml"), steps=5, variance=0.5)
    assert found.success
    assert not warnings_of(found)


@pytest.mark.parametrize(
    ("lower", "upper", "leverage"),
    [
        ([-1.0], [1.0], 0.5),
        ([0.0], [3.0], 1.0),
        ([9.0], [10.0], 10.0),
        ([-10.0, -1.0], [-9.0, 1.0], 10.0),
        ([-np.inf], [np.inf], 1.0),
        ([0.0, 0.0], [np.inf, 0.5], 1.0),
        ([2.0], [2.0], 1.0),
        ([99.0, -1.0], [100.0, np.inf], 100.0),
    ],
)
def test_as_printed_a_control_far_from_zero_suffers_more(
    lower: list[float], upper: list[float], leverage: float
) -> None:
    """The error is that of the largest value, over the range."""
    row, bounds = GENERATING_FUNCTIONS["gaussian"], (np.array(lower), np.array(upper))
    enough = math.log(2 * leverage / SATURATION_LIMIT) / math.pi**2
    for variance, silent in ((enough - 0.03, False), (enough + 0.03, True)):
        text = saturation_warning(
            ControlBasis(row, 5, variance, False), *bounds, limit=SATURATION_LIMIT
        )
        assert (text is None) is silent
        if text:
            assert float(text.rsplit(" ", 1)[1]) == pytest.approx(enough, abs=0.011)
        normalised = ControlBasis(row, 5, 2.0, True)
        assert saturation_warning(normalised, *bounds, limit=SATURATION_LIMIT) is None


def test_where_no_variance_will_do_it_says_so() -> None:
    basis = ControlBasis(GENERATING_FUNCTIONS["sech"], 5, 2.0, False)
    text = saturation_warning(basis, np.array([1e7]), np.array([1e7 + 1]), SATURATION_LIMIT)
    assert text
    assert text.endswith("no variance will do: take normalised weights")


# The command


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    """Run a command in an empty folder; return exit code, what it printed, and its complaints."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["quito", *arguments])
        capsys.readouterr()
        code: Any = 0
        try:
            main()
        except SystemExit as left:
            code = left.code or 0
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return command


HEADS = ["name", "order", "saturation", "Lebesgue", "overshoot", "width", "least", "enough"]


@pytest.mark.parametrize("normalised", [True, False])
def test_the_table(run: Run, tmp_path: Path, normalised: bool) -> None:
    """Every figure, to the digits printed, by quadrature or the plain formula."""
    how = "--normalised" if normalised else "--as-printed"
    code, out, err = run("generating-functions", "--variance", "1.2", how)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    weights = "normalised" if normalised else "as printed"
    assert lines[0] == f"Generating functions, variance D = 1.2, weights {weights}"
    assert lines[2].split() == [*HEADS, "formula"]
    assert lines[-1] == "Saved results/generating-functions.png"
    s = np.linspace(0, 1, 201)
    for number, (name, line) in enumerate(zip(SIX, lines[3:9], strict=True), start=1):
        cells = re.split(r"\s{2,}", line)
        assert cells[:3] == [str(number), name, str(ORDERS[name])]
        weight, m = plain_weights(name, s, 1.2, normalised)
        error = (weight * (m - s[:, None])).sum(axis=1) if normalised else weight.sum(axis=1) - 1
        assert float(cells[3]) == pytest.approx(np.abs(error).max(), rel=0.04)
        assert float(cells[4]) == pytest.approx(np.abs(weight).sum(axis=1).max(), abs=6e-4)
        places, u = plain_jump(name, 1.2, normalised)
        assert cells[5].endswith(" %")
        assert float(cells[5][:-2]) == pytest.approx(100 * max(0, u.max() - 1), abs=0.06)
        assert float(cells[6]) == pytest.approx(rise(places, u), abs=0.011)
        at_least = plain_weights(name, s, float(cells[7]), False)[0].sum(axis=1)
        assert at_least.min() * math.sqrt(float(cells[7])) >= 0.499
        assert cells[9] == GENERATING_FUNCTIONS[name].formula
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["generating-functions.png"]


def test_the_same_for_programs(run: Run, tmp_path: Path) -> None:
    code, out, err = run("generating-functions", "--json", "--no-plot", "--variance", "0.6")
    assert (code, err, out.count("\n")) == (0, "", 1)
    found = json.loads(out)
    assert (found["variance"], found["normalised"], found["plot"]) == (0.6, True, None)
    assert found["saturation_limit"] == SATURATION_LIMIT
    rows = found["generating_functions"]
    assert [(row["number"], row["name"]) for row in rows] == list(enumerate(SIX, start=1))
    for row, known in zip(rows, all_qualities(0.6, True, SATURATION_LIMIT), strict=True):
        for key in ("order", "least_variance", "enough_variance", "saturation"):
            assert row[key] == getattr(known, key)
        for key in ("lebesgue_constant", "overshoot", "width"):
            assert row[key] == getattr(known, key)
        assert row["formula"] == known.function.formula
    assert rows[3]["saturation"] is None
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("kind", "magic"), [("png", b"\x89PNG"), ("pdf", b"%PDF-"), ("svg", b"<?xml")]
)
def test_the_picture(run: Run, tmp_path: Path, kind: str, magic: bytes) -> None:
    code, out, _ = run("generating-functions", "-o", "a/b", "--format", kind, "--json")
    path = tmp_path / "a" / "b" / f"generating-functions.{kind}"
    assert code == 0
    assert json.loads(out)["plot"] == str(path.relative_to(tmp_path))
    assert path.read_bytes().startswith(magic)
    if kind == "png":
        pixels = imread(path)
        assert pixels.shape[0] > 400
        assert pixels.std() > 0.05


def test_what_the_picture_shows() -> None:
    rows = all_qualities(0.6, True, SATURATION_LIMIT)
    shapes, jumps, errors = figure(rows, 0.6, True, SATURATION_LIMIT).axes
    names = [f"{number} {name}" for number, name in enumerate(SIX, start=1)]
    curves = {line.get_label(): line.get_xydata() for line in shapes.get_lines()}
    assert list(curves) == names
    for name, points in zip(SIX, curves.values(), strict=True):
        x, psi = np.asarray(points).T
        assert psi == pytest.approx(PSI[name](x), abs=1e-12)
    drawn = [line.get_label() for line in jumps.get_lines() if line.get_label() in names]
    assert drawn == [name for name in names if name != "4 hermite10"]  # 0.6 is too small for it
    assert errors.get_yscale() == "log"
    for line in errors.get_lines():
        if line.get_label() == "1 gaussian":
            D, error = np.asarray(line.get_xydata()).T
            seen = (D > 0.8) & (D < 1.7)
            expected = 2 * math.pi * D * np.exp(-(math.pi**2) * D)
            assert error[seen] == pytest.approx(expected[seen], rel=3e-2)


def test_quiet_and_narrow(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run("generating-functions", "-q", "--no-plot") == (0, "", "")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = run("generating-functions", "--no-plot")
    plain = re.sub(r"\x1b\[\d+m", "", out)
    assert code == 0
    assert max(map(len, plain.splitlines())) <= 80
    assert all(row.formula in plain for row in GENERATING_FUNCTIONS.values() if row.number)
    monkeypatch.setenv("COLUMNS", "160")
    assert "enough  formula" in re.sub(r"\x1b\[\d+m", "", run("generating-functions")[1])


@pytest.mark.parametrize(
    ("variance", "said"),
    [
        ("0.05", "variance 0.05 is too small for every generating function; sech takes 0.2"),
        ("0", "variance: expected a number above 0, got 0"),
        ("-1", "variance: expected a number above 0, got -1"),
        ("nan", "variance: expected a finite number, got nan"),
        ("101", "variance: expected at most 100, got 101"),
    ],
)
def test_a_variance_that_is_refused(run: Run, tmp_path: Path, variance: str, said: str) -> None:
    code, out, err = run("generating-functions", "--variance", variance)
    assert (code, out) == (2, "")
    assert err.startswith(f"quito: {said}")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written(run: Run, tmp_path: Path) -> None:
    (tmp_path / "results").write_text("a file")
    code, out, err = run("generating-functions")
    assert (code, out) == (2, "")
    assert "cannot be written" in err


# Each of the six solves


def test_by_number_it_is_the_same_as_by_name() -> None:
    in_file = quito.load("van_der_pol").text.replace(
        "options: {", "options: {generating_function: 3, "
    )
    assert "generating_function: 3" in in_file
    named = quito.solve("van_der_pol", steps=20, generating_function="laguerre6")
    for given in (
        quito.solve("van_der_pol", steps=20, generating_function=3),
        quito.solve("van_der_pol", steps=20, generating_function="3"),
        quito.solve(load_text(in_file, "van_der_pol.yaml"), steps=20),
    ):
        assert given.options["generating_function"] == "laguerre6"
        assert (given.coefficients == named.coefficients).all()


@pytest.mark.parametrize("name", SIX)
def test_each_solves_aly_chan(name: str) -> None:
    """u = −sin t, singular on all of [0, π/2], at no cost; smooth, so that no bound is passed."""
    solution = quito.solve("alychan", steps=60, generating_function=name)
    assert solution.success
    assert solution.cost == pytest.approx(0, abs=1e-8)
    assert solution.evidence.resimulated_cost == pytest.approx(0, abs=1e-8)
    t = np.linspace(0, math.pi / 2, 601)
    u = solution.control(t)[:, 0]
    assert np.abs(u).max() <= 1 + 1e-6
    inner = (t > 0.15) & (t < math.pi / 2 - 0.15)
    assert np.abs(u + np.sin(t))[inner].max() < 0.02
    assert np.abs(solution.state(t)[:, 0] - np.sin(t)).max() < 5e-3


JUMP_COST = {"gaussian": 1e-3, "sech": 5e-3}
"""What two jumps cost on a uniform mesh: those of the positive functions are wide."""


@pytest.mark.parametrize("name", SIX)
def test_each_solves_van_der_pol(name: str) -> None:
    """Two jumps, then a singular arc; the cost is that of the polished reference and a little more
    for the jumps, which fall between the nodes of a uniform mesh."""
    solution = quito.solve("van_der_pol", steps=100, generating_function=name)
    facts = json.loads((Path(__file__).parent / "reference" / "van_der_pol.json").read_text())
    assert solution.success
    excess = solution.cost - facts["cost"]
    assert -1e-8 <= excess <= JUMP_COST.get(name, 3e-4)
    assert solution.evidence.resimulated_cost == pytest.approx(solution.cost, abs=1e-6)
    t = np.linspace(0, 4, 4001)
    u = solution.control(t)[:, 0]
    assert np.abs(u).max() <= (1 + 1e-9 if name in POSITIVE else 1.005)
    with np.load(Path(__file__).parent / "reference" / "van_der_pol.npz") as samples:
        known_t, known = samples["t"], samples["u"][:, 0]
    near = [np.abs(known_t - junction) < 0.5 for junction in facts["switching_times"]]
    far = ~np.any(near, axis=0)
    assert np.abs(solution.control(known_t[far])[:, 0] - known[far]).max() < 2e-2
