"""Arcs and certificates as a user meets them: file, summary, JSON, table, pictures, messages.

The extremals are made by hand, apart from a few: what is told is known, whatever the core finds.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

import quito_cli as quito
from quito_cli.cli import show
from quito_cli.cli.certificate import certificate_page
from quito_cli.plots.figure import DEFAULT, figure
from quito_cli.problem.load import load_text
from quito_cli.solution.optimal import (
    HAMILTONIAN,
    SWITCHING,
    Arc,
    Condition,
    Extremal,
    Kind,
    Verdict,
)
from quito_cli.solution.solution import Quantity
from quito_cli.solution.tally import verdict
from quito_cli.summary.arcs import arc_rows

Solve = Callable[..., quito.Solution]
Quito = Callable[..., tuple[int, str, str]]
NAN = math.nan

FIRST, SECOND = 1.36674, 2.46087
"""Where the control of `van_der_pol` goes from bound to bound, and on to its singular arc."""
ROUGH: Verdict = "holds to discretization accuracy"
ROWS = (
    Condition("x' = f", 2e-7, 1.2, 0.3, "holds", ""),
    Condition("dH/du = 0 on singular arcs of u", 1e-4, 1.0, 2.9, ROUGH, ""),
    Condition("Hamiltonian constant", 1e-5, 0.8, 3.1, ROUGH, ""),
    Condition("transversality at the end", NAN, NAN, NAN, "not applicable", "all ends are given"),
)
FAILED = replace(ROWS[1], residual=6e-2, scale=2.0, time=1.2, verdict="fails", reason="off by 0.06")


def arcs(of: str, *ends: tuple[Kind, float, float], start: float = 0.0) -> tuple[Arc, ...]:
    """Arcs by kind, end and its uncertainty."""
    found, before = [], (start, 0.0)
    for kind, end, uncertainty in ends:
        found.append(Arc(of, kind, before[0], end, before[1], uncertainty))
        before = end, uncertainty
    return tuple(found)


VAN_DER_POL = arcs("u", ("lower", FIRST, 4e-5), ("upper", SECOND, 1e-3), ("singular", 4.0, 0.0))


def judged(
    solution: quito.Solution,
    found: tuple[Arc, ...] = VAN_DER_POL,
    rows: tuple[Condition, ...] = ROWS,
    hamiltonian: float = 0.0047,
) -> quito.Solution:
    """The same answer with these arcs and this certificate, and curves of its costates."""
    t = np.unique(np.append(solution.dense_times, np.linspace(1.3, 1.4, 60)))
    curves = {"Hamiltonian": np.full(len(t), hamiltonian)}
    for quantity in solution.origin.controls:
        curves[f"dH/d{quantity.name}"] = solution.costate(t)[:, -1]
    return replace(solution, extremal=Extremal(found, rows, t, curves))


@pytest.fixture(scope="module")
def plain(solve: Solve) -> quito.Solution:
    """An answer without a certificate."""
    return replace(solve("van_der_pol", steps=40), extremal=None)


@pytest.fixture(scope="module")
def good(plain: quito.Solution) -> quito.Solution:
    return judged(plain)


@pytest.fixture(scope="module")
def bad(plain: quito.Solution) -> quito.Solution:
    return judged(plain, rows=(ROWS[0], FAILED, *ROWS[2:]))


def row(printed: str, label: str) -> list[str]:
    """The lines of a labelled row of the summary."""
    found = re.search(rf"^  {re.escape(label)} +(.*\n(?:   {{6,}}.*\n)*)", printed, re.MULTILINE)
    assert found, label
    return [line.strip() for line in found[1].splitlines()]


# The result file


def same(a: Any, b: Any) -> bool:
    """Equal in type and value; NaN equals NaN."""
    if isinstance(a, float):
        return type(b) is float and (a == b or (math.isnan(a) and math.isnan(b)))
    return type(a) is type(b) and bool(a == b)


def alike(ours: Extremal, theirs: Extremal | None) -> bool:
    assert theirs is not None
    values = [(asdict(a), asdict(b)) for a, b in zip(ours.arcs, theirs.arcs, strict=True)]
    rows = zip(ours.certificate, theirs.certificate, strict=True)
    values += [(asdict(a), asdict(b)) for a, b in rows]
    assert list(ours.curves) == list(theirs.curves)
    np.testing.assert_array_equal(ours.times, theirs.times)
    for name, curve in ours.curves.items():
        np.testing.assert_array_equal(curve, theirs.curves[name])
    return all(same(a[name], b[name]) for a, b in values for name in a)


CONSTRAINED = (
    *VAN_DER_POL,
    *arcs("speed ≤ ü", ("inactive", 1.0, 0.1), ("active", 2.0, 0.2), ("inactive", 4.0, 0.0)),
)


@pytest.mark.parametrize(
    ("found", "rows"),
    [
        (VAN_DER_POL, ROWS),
        (CONSTRAINED, (*ROWS, FAILED, replace(FAILED, residual=math.inf, time=NAN))),
        ((), ()),
    ],
    ids=["plain", "constraints, NaN, infinity", "nothing"],
)
def test_files_give_back_arcs_certificate_and_curves(
    found: tuple[Arc, ...], rows: tuple[Condition, ...], plain: quito.Solution, tmp_path: Path
) -> None:
    solution = judged(plain, found, rows)
    assert solution.extremal is not None
    curves = {**solution.extremal.curves, "with/slash": np.full(len(solution.extremal.times), NAN)}
    solution = replace(solution, extremal=replace(solution.extremal, curves=curves))
    assert solution.extremal is not None
    solution.save(tmp_path / "a.h5")
    loaded = quito.Solution.load(tmp_path / "a.h5")
    assert alike(solution.extremal, loaded.extremal)
    assert loaded.arcs == found
    assert len(loaded.certificate) == len(rows)


def test_an_extremal_of_nothing_is_kept(plain: quito.Solution, tmp_path: Path) -> None:
    empty = Extremal((), (ROWS[3],), np.zeros(0), {})
    replace(plain, extremal=empty).save(tmp_path / "a.h5")
    assert alike(empty, quito.Solution.load(tmp_path / "a.h5").extremal)


def test_a_file_without_one_loads_as_before(good: quito.Solution, tmp_path: Path) -> None:
    good.save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file["optimality"]
    loaded = quito.Solution.load(tmp_path / "a.h5")
    assert loaded.extremal is None
    assert loaded.arcs == ()
    assert loaded.certificate == ()
    assert loaded.cost == good.cost


def test_the_group_is_labelled(good: quito.Solution, tmp_path: Path) -> None:
    good.save(tmp_path / "a.h5")
    opened = {
        name: xarray.open_dataset(tmp_path / "a.h5", group=group, engine="h5netcdf")
        for name, group in (
            ("curves", "optimality"),
            ("arcs", "optimality/arcs"),
            ("rows", "optimality/certificate"),
        )
    }
    try:
        assert good.extremal is not None
        curve = opened["curves"]["curves"].sel(curve="dH/du")
        assert curve.dims == ("time",)
        np.testing.assert_array_equal(curve["time"], good.extremal.times)
        assert list(opened["arcs"]["kind"].values) == ["lower", "upper", "singular"]
        assert opened["rows"]["residual"].dims == opened["rows"]["verdict"].dims
        assert set(opened["rows"].data_vars) == set(Condition.__dataclass_fields__)
    finally:
        for dataset in opened.values():
            dataset.close()


@pytest.mark.parametrize(
    ("group", "name", "value"),
    [("arcs", "kind", "middling"), ("certificate", "verdict", "perhaps")],
)
def test_words_that_are_none_are_refused(
    group: str, name: str, value: str, good: quito.Solution, tmp_path: Path
) -> None:
    good.save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file[f"optimality/{group}/{name}"][0] = value
    with pytest.raises(quito.ResultFileError, match=f"damaged: {value} is none of"):
        quito.Solution.load(tmp_path / "a.h5")


def test_curves_cannot_be_changed(good: quito.Solution) -> None:
    assert good.extremal is not None
    for array in (good.extremal.times, *good.extremal.curves.values()):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


# The line of the certificate


@pytest.mark.parametrize(
    ("verdicts", "line"),
    [
        (["holds"] * 9, "all 9 conditions hold"),
        (["holds"] * 4 + [ROUGH] * 5, "all 9 conditions hold (5 to discretization accuracy)"),
        ([ROUGH] * 3, "all 3 conditions hold (to discretization accuracy)"),
        (["holds", "not applicable"], "the one condition holds"),
        ([], "no condition applies"),
        (["not applicable"] * 2, "no condition applies: it is empty"),
    ],
)
def test_a_certificate_in_a_line(verdicts: list[Verdict], line: str) -> None:
    reasons = {"not applicable": "it is empty"}
    rows = [Condition("c", 0.0, 1.0, 0.0, v, reasons.get(v, "")) for v in verdicts]
    assert verdict(rows) == line


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({}, "by 3e-02 of its scale at t = 1.2"),
        ({"time": NAN}, "by 3e-02 of its scale"),
        ({"scale": 0.0}, "by 6e-02 at t = 1.2"),
        ({"scale": NAN}, "by 6e-02 at t = 1.2"),
        ({"residual": math.inf}, "at t = 1.2"),
    ],
)
def test_a_failure_is_told_with_its_amount_and_time(change: dict[str, Any], line: str) -> None:
    """Residual 0.06 over scale 2 is 3 %."""
    text = verdict([*ROWS, replace(FAILED, **change)])
    assert text == f"FAILS: {FAILED.condition}{'' if line.startswith('at') else ','} {line}"


def test_of_several_failures_the_worst_is_told() -> None:
    """0.5 of a scale of 1 is worse than 3 of 100."""
    small = replace(FAILED, condition="small", residual=3.0, scale=100.0)
    large = replace(FAILED, condition="large", residual=0.5, scale=1.0)
    text = "FAILS: large, by 5e-01 of its scale at t = 1.2; 2 of 5 conditions fail"
    assert verdict([*ROWS, small, large]) == text


# The summary


def test_the_summary_tells_arcs_and_verdict(
    good: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    good.save(tmp_path / "a.h5")
    code, out, err = quito_("show", "a.h5")
    assert (code, err) == (0, "")
    assert row(out, "arcs") == ["u: lower to 1.36674 ± 4e-05, upper to 2.461 ± 1e-03, singular"]
    line = "all 3 conditions hold (2 to discretization accuracy)"
    assert row(out, "Pontryagin") == [line, "It certifies an extremal, not a global optimum."]
    assert "Warning" not in out


def test_a_failure_is_a_warning_and_no_failed_solve(
    bad: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    bad.save(tmp_path / "a.h5")
    assert bad.success
    code, out, _ = quito_("show", "a.h5")
    assert code == 0
    told = "dH/du = 0 on singular arcs of u, by 3e-02 of its scale at t = 1.2"
    assert row(out, "Pontryagin")[0] == f"FAILS: {told}"
    assert f"Warning: Pontryagin's conditions do not all hold: {told}. Solve again with" in out
    _, printed, _ = quito_("show", "a.h5", "--json")
    answer = json.loads(printed)
    assert answer["success"] is True
    assert [text for text in answer["warnings"] if told in text] == [bad.warnings[-1]]


def test_an_answer_without_a_certificate_says_nothing_of_it(
    plain: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    plain.save(tmp_path / "a.h5")
    _, out, _ = quito_("show", "a.h5")
    assert "Pontryagin" not in out
    assert not re.search("^  arcs", out, re.MULTILINE)
    _, printed, _ = quito_("show", "a.h5", "--json")
    assert json.loads(printed)["arcs"] is json.loads(printed)["certificate"] is None


def test_constraints_tell_when_they_are_active(
    plain: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    """One may be called as the control is; what is never active is not mentioned."""
    found = (
        *arcs("u", ("lower", 1.0, 0.0), ("active", 4.0, 0.0)),
        *arcs("u", ("inactive", 1.0, 0.01), ("active", 4.0, 0.0)),
        *arcs("speed", ("active", 0.5, 0.0), ("inactive", 2.0, 0.0), ("active", 3.0, 0.1))[:3],
        *arcs("speed", ("inactive", 4.0, 0.0), start=3.0),
        *arcs("always", ("active", 4.0, 0.0)),
        *arcs("never", ("inactive", 4.0, 0.0)),
        Arc("touch", "inactive", 0.0, 2.0, 0.0, 1e-3),
        Arc("touch", "active", 2.0, 2.0, 1e-3, 1e-3),
        Arc("touch", "inactive", 2.0, 4.0, 1e-3, 0.0),
    )
    judged(plain, found).save(tmp_path / "a.h5")
    _, out, _ = quito_("show", "a.h5")
    assert row(out, "arcs") == [
        "u: lower to 1, on a constraint",
        "u: active from 1.00 ± 1e-02",
        "speed: active to 0.5, from 2 to 3.0 ± 1e-01",
        "always: active throughout",
        "touch: active at 2.000 ± 1e-03",
    ]


def test_many_arcs_and_many_controls_are_cut_with_a_count(
    plain: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    names = [f"u[{i}]" for i in range(9)]
    controls = tuple(Quantity(name, "", -1.0, 1.0) for name in names)
    evidence = replace(plain.evidence, total_variation=(1.0,) * 9, ringing=(1.0,) * 9)
    ends: list[tuple[Kind, float, float]] = [
        ("upper" if i % 2 else "lower", (i + 1) / 10, 1e-4) for i in range(40)
    ]
    found = arcs(names[0], *ends) + tuple(Arc(n, "interior", 0, 4, 0, 0) for n in names[1:])
    solution = replace(
        plain,
        origin=replace(plain.origin, controls=controls),
        evidence=evidence,
        junctions=(),
        extremal=Extremal(found, ROWS, np.zeros(0), {}),
    )
    lines = [line for _, line in arc_rows(solution)]
    assert max(map(len, lines)) <= 90
    told = " ".join(line.strip() for line in lines[:-6])
    assert told.startswith("u[0]: lower to 0.1000 ± 1e-04, upper to 0.2000 ± 1e-04, lower to")
    assert told.endswith("upper to 0.8000 ± 1e-04, and 32 more")
    assert lines[-6:] == [
        *(f"{name}: interior throughout" for name in names[1:6]),
        "and those of 3 more controls or constraints",
    ]
    page = certificate_page(solution, None)
    assert page.count("lower to") + page.count("upper to") == 39
    assert "u[8]: interior throughout" in page


# JSON


def test_json_has_every_arc_and_condition(
    good: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    good.save(tmp_path / "a.h5")
    _, out, _ = quito_("show", "a.h5", "--json")
    answer = json.loads(out, parse_constant=pytest.fail)
    assert answer["arcs"] == [asdict(arc) for arc in VAN_DER_POL]
    assert answer["certificate"][:3] == [asdict(condition) for condition in ROWS[:3]]
    assert answer["certificate"][3] == {
        "condition": "transversality at the end",
        "residual": None,
        "scale": None,
        "time": None,
        "verdict": "not applicable",
        "reason": "all ends are given",
    }


# The table

PAGE = """\
Van der Pol oscillator with bounded control

  Pontryagin  FAILS: dH/du = 0 on singular arcs of u, by 3e-02 of its scale at t = 1.2
  arcs        u: lower to 1.36674 ± 4e-05, upper to 2.461 ± 1e-03, singular

  condition                        residual  scale    worst at t  verdict
  x' = f                           2.0e-07   1.2e+00  0.3         holds
  dH/du = 0 on singular arcs of u  6.0e-02   2.0e+00  1.2         fails
      off by 0.06
  Hamiltonian constant             1.0e-05   8.0e-01  3.1         holds to discretization accuracy

  not applicable             because
  transversality at the end  all ends are given

It certifies an extremal, not a global optimum.
quito show PROBLEM --pontryagin derives the conditions.
"""


def test_the_table_shows_every_condition(
    bad: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    bad.save(tmp_path / "a.h5")
    assert quito_("show", "a.h5", "--certificate") == (0, PAGE, "")


@pytest.mark.parametrize("room", [70, 80, 100, 140])
def test_the_table_fits_a_terminal(room: int, bad: quito.Solution) -> None:
    reason = "a sentence of some length that says in several words what is off, where and how far"
    long = ROWS[1].condition * 3
    rows = (*bad.certificate, replace(FAILED, reason=reason, condition=long))
    rows += (replace(ROWS[3], reason=reason, condition=long),)
    page = certificate_page(judged(bad, rows=rows), room)
    tables = re.sub(r"\x1b\[\d+m", "", page).split("\n\n")[2:4]
    assert max(len(line) for table in tables for line in table.splitlines()) <= room
    assert " ".join(reason.split()) in " ".join(tables[0].split())


def test_rows_that_fail_are_red(bad: quito.Solution) -> None:
    lines = certificate_page(bad, 100).splitlines()
    red = [line for line in lines if line.startswith("\x1b[31m")]
    assert [re.sub(r"\x1b\[\d+m", "", line).split()[0] for line in red] == ["dH/du", "off"]


def test_text_of_a_file_does_not_steer_the_terminal(plain: quito.Solution) -> None:
    evil = replace(FAILED, condition="a\x1b[2Jb", reason="c\x1b[2Jd\x07")
    found = tuple(replace(arc, of="u\x1b[2J") for arc in VAN_DER_POL)
    page = certificate_page(judged(plain, found, (evil,)), None)
    assert "\x1b[2J" not in page
    assert "\x07" not in page


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("van_der_pol", "--certificate"),
            "van_der_pol is no result: --certificate takes the file of one, such as "
            "results/van_der_pol.h5; quito show van_der_pol --pontryagin says what the conditions "
            "of a problem are",
        ),
        (
            ("mine.yaml", "--certificate"),
            "mine.yaml is no result: --certificate takes the file of one, such as results/mine.h5; "
            "quito show mine.yaml --pontryagin says what the conditions of a problem are",
        ),
        (("there_is_none.h5", "--certificate"), "there is no file there_is_none.h5"),
        (
            ("old.h5", "--certificate"),
            "old.h5 has no certificate: it is older than certificates, or was not solved; solve "
            "it again",
        ),
        *(
            (
                ("old.h5", "--certificate", other),
                "--certificate goes with no other option; --json without it has the certificate "
                "too",
            )
            for other in ("--json", "--latex", "--yaml", "--pontryagin")
        ),
    ],
)
def test_refusals_say_what_to_do(
    arguments: tuple[str, ...], message: str, plain: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    plain.save(tmp_path / "old.h5")
    code, out, err = quito_("show", *arguments)
    assert (code, out, " ".join(err.split())) == (2, "", f"quito: {message}")


def test_without_a_terminal_nothing_is_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: False, raising=False)
    assert show._room() is None


# Pictures


def spans(axes: Axes) -> list[tuple[str, float, float, float]]:
    """Labels, start, end and height (of the plot) of what is drawn over stretches of time."""
    found = []
    for patch in axes.patches:
        box = patch.get_path().get_extents(patch.get_patch_transform())
        found.append((str(patch.get_label()), box.x0, box.x1, box.height))
    return [one for one in found if one[0] and one[0] != "_nolegend_"]


def by_label(solution: quito.Solution, *panels: str) -> dict[str, Axes]:
    return {axes.get_ylabel(): axes for axes in figure(solution, panels).axes}


SHADES = [
    ("at lower bound", 0.0, FIRST, 1.0),
    ("at upper bound", FIRST, SECOND, 1.0),
    ("singular", SECOND, 4.0, 1.0),
]


def test_costates_come_with_switching_functions_and_hamiltonian(good: quito.Solution) -> None:
    drawn = by_label(good, "costates", "switching")
    assert list(drawn) == ["λ of x1", "λ of x2", "dH/du", "Hamiltonian"]
    assert spans(drawn["dH/du"]) == SHADES
    curve, zero = drawn["dH/du"].get_lines()
    assert good.extremal is not None
    np.testing.assert_array_equal(np.asarray(curve.get_xdata()), good.extremal.times)
    np.testing.assert_array_equal(np.asarray(curve.get_ydata()), good.extremal.curves["dH/du"])
    assert list(np.asarray(zero.get_ydata())) == [0, 0]
    assert spans(drawn["λ of x1"]) == spans(drawn["Hamiltonian"]) == []


def test_a_constant_hamiltonian_looks_constant(plain: quito.Solution) -> None:
    """Its terms are of size one: a wave of 1e-5 is no shape."""
    solution = judged(plain)
    assert solution.extremal is not None
    t = solution.extremal.times
    curves = {"Hamiltonian": 0.3 + 1e-5 * np.sin(40 * t)}
    solution = replace(solution, extremal=replace(solution.extremal, curves=curves))
    low, high = by_label(solution, "switching")["Hamiltonian"].get_ylim()
    assert high - low > 100 * 2e-5
    assert low < 0.3 < high


def test_switching_functions_share_the_horizon_with_costates(good: quito.Solution) -> None:
    """Curves may be sampled inside cells only."""
    assert good.extremal is not None
    inside = (good.extremal.times > 0.2) & (good.extremal.times < 3.9)
    curves = {name: values[inside] for name, values in good.extremal.curves.items()}
    extremal = replace(good.extremal, times=good.extremal.times[inside], curves=curves)
    drawn = by_label(replace(good, extremal=extremal), "costates", "switching")
    assert {axes.get_xlim() for axes in drawn.values()} == {drawn["λ of x1"].get_xlim()}


def test_zero_is_drawn_where_it_is_near(plain: quito.Solution) -> None:
    for value, lines in ((0.0, 2), (50.0, 1)):
        drawn = by_label(judged(plain, hamiltonian=value), "switching")
        assert len(drawn["Hamiltonian"].get_lines()) == lines


def test_active_constraints_are_shaded_as_one(plain: quito.Solution) -> None:
    found = (
        *VAN_DER_POL,
        *arcs("a", ("inactive", 1.0, 0.1), ("active", 2.0, 0.1), ("inactive", 4.0, 0.0)),
        *arcs("b", ("inactive", 1.5, 0.1), ("active", 3.0, 0.1), ("inactive", 4.0, 0.0)),
    )
    drawn = by_label(judged(plain, found), "costates", "switching")
    for name in ("λ of x1", "λ of x2", "Hamiltonian"):
        assert spans(drawn[name]) == [("on a constraint", 1.0, 3.0, 1.0)]
    assert spans(drawn["dH/du"]) == SHADES


def test_arcs_are_a_bar_below_the_control(good: quito.Solution) -> None:
    """It is thinner than the margin between the axis and the lowest value."""
    axes = by_label(good, *DEFAULT)["u"]
    bars = spans(axes)
    assert [one[:3] for one in bars] == [one[:3] for one in SHADES]
    low, high = axes.get_ylim()
    assert max(one[3] for one in bars) < (-1 - low) / (high - low) + 1e-9
    bodies = [patch for patch in axes.patches if patch.get_alpha() is None]
    assert len({to_hex(patch.get_facecolor()) for patch in bodies}) == len(bodies) == 3


def test_a_legend_is_no_wider_than_its_picture(good: quito.Solution) -> None:
    drawn = figure(good, DEFAULT)
    drawn.draw_without_rendering()
    (legend,) = drawn.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names[-3:] == ["at lower bound", "at upper bound", "singular"]
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= drawn.bbox.x1


def test_many_switching_functions_share_plots(solve: Solve) -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {size: 13, initial: 1}}
controls: {u: {size: 13, lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: "dot(x, x)"}
"""
    solution = replace(solve(text, steps=4), extremal=None)
    found = tuple(Arc(f"u[{i}]", "lower", 0.0, 1.0, 0.0, 0.0) for i in range(13))
    drawn = by_label(judged(solution, found), "switching")
    assert list(drawn) == ["dH/du", "Hamiltonian"]
    assert len(drawn["dH/du"].get_lines()) == 14
    assert spans(drawn["dH/du"]) == []


def test_plot_draws_them_with_the_costates(
    good: quito.Solution, plain: quito.Solution, tmp_path: Path, quito_: Quito
) -> None:
    good.save(tmp_path / "a.h5")
    plain.save(tmp_path / "b.h5")
    for name in "ab":
        code, out, _ = quito_("plot", f"{name}.h5", "--costates", "--format", "svg")
        assert (code, out) == (0, f"Saved {name}-costates.svg\n")
    sizes = [(tmp_path / f"{name}-costates.svg").stat().st_size for name in "ab"]
    assert sizes[0] > 1.3 * sizes[1]


def test_a_problem_without_controls_has_a_hamiltonian(tmp_path: Path) -> None:
    text = "time: {initial: 0, final: 1}\nstates: {x: {initial: 1}}\ndynamics: {x: -x}\n"
    solution = quito.solve(load_text(text + "cost: {mayer: x}\n", "none.yaml"), steps=4)
    solution = judged(solution, (), ROWS)
    solution.save(tmp_path / "none.h5")
    assert quito.Solution.load(tmp_path / "none.h5").arcs == ()
    assert list(by_label(solution, "switching")) == ["Hamiltonian"]


# A solve, from end to end


def test_a_solve_ends_with_arcs_and_certificate(
    tmp_path: Path, quito_: Quito, solve: Solve
) -> None:
    """The control of Bressan's problem is −1 until T/3 = 10/3, then 1/2."""
    code, out, err = quito_("solve", "bressan", "-N", "120", "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    first, second = answer["arcs"]
    assert [first["of"], first["kind"], first["start"]] == ["u", "lower", 0]
    assert [second["of"], second["kind"], second["end"]] == ["u", "singular", 10]
    assert first["end"] == second["start"]
    assert abs(first["end"] - 10 / 3) <= first["end_uncertainty"] < 0.5
    verdicts = {row["verdict"] for row in answer["certificate"]}
    assert verdicts == {"holds", ROUGH, "not applicable"}
    assert all((row["residual"] is None) == (row["verdict"] == "not applicable") for row in
               answer["certificate"])  # fmt: skip
    code, out, _ = quito_("show", "results/bressan.h5", "--certificate")
    assert code == 0
    for condition in answer["certificate"]:
        assert re.search(rf"^  {re.escape(condition['condition'])} ", out, re.MULTILINE)
    loaded = quito.Solution.load(tmp_path / "results" / "bressan.h5")
    assert loaded.extremal is not None
    assert list(loaded.extremal.curves) == [HAMILTONIAN, f"{SWITCHING}u"]
    drawn = by_label(loaded, "switching")
    kinds = [(name, start, end) for name, start, end, _ in spans(drawn["dH/du"])]
    assert kinds == [
        ("at lower bound", 0, first["end"]),
        ("singular", second["start"], 10),
    ]


def test_an_answer_that_is_none_has_no_verdict(tmp_path: Path, quito_: Quito) -> None:
    code, out, _ = quito_("solve", "van_der_pol", "-N", "20", "--max-iterations", "3")
    assert code == 1
    assert row(out, "Pontryagin")[0].startswith("no condition applies: ")
    assert "Pontryagin's conditions do not all hold" not in out
    code, out, _ = quito_("show", "results/van_der_pol.h5", "--certificate")
    assert code == 0
    assert "not applicable" in out


def test_a_mesh_too_coarse_to_judge_is_no_good_word() -> None:
    """On fifteen cells a jump takes as long as the arcs beside it."""
    found = verdict(quito.solve("bressan", steps=15).certificate or ())
    assert found.startswith("nothing is known of the control")
    assert "--mesh adaptive" in found
