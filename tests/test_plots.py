"""Pictures: what is drawn, with which labels, and that files come out of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import quito_cli as quito
from quito_cli.plots.figure import DEFAULT, PANELS, draw, figure
from quito_cli.problem.load import load_text

Solve = Callable[..., quito.Solution]

UNITS = """
title: Units, bounds, and a reference
time: {initial: 0, final: 1}
states:
  x: {initial: 0, final: 1, lower: -0.25, upper: 100, unit: m}
  v: {size: 2, initial: 0, unit: m/s}
controls:
  u: {lower: -0.5, upper: 50, unit: m/s²}
  w: {}
dynamics:
  x: u
  v: [u, w]
cost: {lagrange: u^2 + w^2}
reference:
  cost: 1
  state: {x: t}
  control:
    u:
      - {until: 0.5, value: 1}
      - {value: 1}
"""
"""u = 1, w = 0."""
EIGHT = "\n".join(
    [
        "time: {initial: 0, final: 1}",
        "states:",
        *(
            f"  a_rather_long_name_{i}: {{initial: {i}, lower: -10, unit: kg m^2/s^3}}"
            for i in range(8)
        ),
        "controls: {u: {lower: -1, upper: 1}, v: {lower: -1, upper: 1}}",
        "dynamics:",
        *(f"  a_rather_long_name_{i}: u*{i} + v" for i in range(8)),
        "cost: {lagrange: u^2 + v^2 + a_rather_long_name_0^2}",
    ]
)
SMALLEST = {"png": 10_000, "pdf": 5_000, "svg": 10_000}


@pytest.fixture(scope="module")
def units(solve: Solve) -> quito.Solution:
    return solve(UNITS, steps=8, tolerance=1e-11)


def by_label(drawn: Figure) -> dict[str, Axes]:
    return {axes.get_ylabel(): axes for axes in drawn.axes}


def lines(axes: Axes, label: str) -> list[Line2D]:
    return [line for line in axes.get_lines() if line.get_label() == label]


def heights(axes: Axes) -> list[float]:
    """Where the bounds are drawn."""
    return sorted(float(np.asarray(line.get_ydata())[0]) for line in lines(axes, "bound"))


def legend(drawn: Figure) -> list[str]:
    return [text.get_text() for box in drawn.legends for text in box.get_texts()]


def heading(drawn: Figure) -> str:
    return str(drawn.get_suptitle())


def test_axes_are_the_entries_in_order_with_their_units(units: quito.Solution) -> None:
    drawn = figure(units, ("states", "controls"))
    names = ["x [m]", "v[0] [m/s]", "v[1] [m/s]", "u [m/s²]", "w"]
    assert [axes.get_ylabel() for axes in drawn.axes] == names
    assert [axes.get_ylabel() for axes in figure(units, ("controls",)).axes] == names[3:]
    assert [axes.get_ylabel() for axes in figure(units, ("controls", "states")).axes] == [
        *names[3:],
        *names[:3],
    ]


def test_time_stands_under_the_last_row(units: quito.Solution) -> None:
    drawn = by_label(figure(units, ("states", "controls")))
    assert drawn["u [m/s²]"].get_xlabel() == drawn["w"].get_xlabel() == "t"
    assert drawn["x [m]"].get_xlabel() == ""


def test_curves_are_those_of_the_solution(units: quito.Solution) -> None:
    """u = 1 all the time, so that x = v[0] = t."""
    drawn = by_label(figure(units, ("states", "controls")))
    (curve,) = lines(drawn["x [m]"], "quito")
    t, x = (np.asarray(data, dtype=float) for data in curve.get_data())
    assert (t[0], t[-1]) == (0, 1)
    assert len(t) > 50
    np.testing.assert_allclose(x, t, atol=1e-6)
    (curve,) = lines(drawn["u [m/s²]"], "quito")
    np.testing.assert_allclose(np.asarray(curve.get_ydata()), 1, atol=1e-3)


def test_bounds_are_drawn_where_they_are_near_and_of_controls_farther(
    units: quito.Solution,
) -> None:
    drawn = by_label(figure(units, ("states", "controls")))
    assert heights(drawn["u [m/s²]"]) == [-0.5]
    assert heights(drawn["x [m]"]) == [-0.25]
    assert heights(drawn["w"]) == heights(drawn["v[0] [m/s]"]) == []


def test_the_reference_is_drawn_where_there_is_one(units: quito.Solution) -> None:
    drawn = by_label(figure(units, ("states", "controls")))
    known = {name: len(lines(axes, "reference")) for name, axes in drawn.items()}
    assert known == {"x [m]": 1, "v[0] [m/s]": 0, "v[1] [m/s]": 0, "u [m/s²]": 1, "w": 0}
    (curve,) = lines(drawn["x [m]"], "reference")
    t, x = (np.asarray(data, dtype=float) for data in curve.get_data())
    np.testing.assert_allclose(x, t)


def test_a_known_jump_is_drawn_as_a_jump(solve: Solve) -> None:
    """The control of Bressan's problem is -1 until T/3 = 10/3, then 1/2."""
    (axes,) = figure(solve("bressan", steps=10), ("controls",)).axes
    (curve,) = lines(axes, "reference")
    t, u = (np.asarray(data, dtype=float) for data in curve.get_data())
    assert set(u) == {-1.0, 0.5}
    assert np.all((u == -1) == (t < 10 / 3))
    assert heights(axes) == [-1, 1]


def test_the_legend_has_each_kind_once_and_only_where_there_are_several(
    units: quito.Solution,
) -> None:
    names = ["bound", "interior", "quito", "reference"]
    assert sorted(legend(figure(units, ("states", "controls")))) == names
    assert legend(figure(units, ("costates",))) == []


def test_costates_and_mesh(units: quito.Solution) -> None:
    drawn = figure(units, ("costates", "mesh"))
    names = [axes.get_ylabel() for axes in drawn.axes]
    assert names == ["λ of x", "λ of v[0]", "λ of v[1]", "length of the cells"]
    axes = drawn.axes[-1]
    assert axes.get_yscale() == "log"
    (curve,) = lines(axes, "quito")
    np.testing.assert_allclose(np.asarray(curve.get_ydata()), 1 / 8)
    # J = (1 - x0)^2 has the costate ∂J/∂x0 = -2 for x all the time, and none for v.
    (curve,) = lines(by_label(drawn)["λ of x"], "quito")
    np.testing.assert_allclose(np.asarray(curve.get_ydata()), -2, atol=1e-4)


def test_the_heading_says_what_it_is(units: quito.Solution) -> None:
    assert heading(figure(units, ("states",))) == "Units, bounds, and a reference\ncost 1, 8 cells"
    untitled = UNITS.replace("title: Units, bounds, and a reference", "")
    solution = quito.solve(load_text(untitled, "some/where/cart.yaml"), steps=3)
    assert heading(figure(solution, ("states",))).startswith("cart\ncost ")


def test_a_failed_solution_is_marked() -> None:
    text = UNITS.replace("final: 1, lower", "final: 4, lower")
    solution = quito.solve(load_text(text, "far.yaml"), steps=5, max_iterations=0)
    assert not solution.success
    assert heading(figure(solution, ("states",))).startswith("NOT SOLVED: Units, bounds")


def test_infinite_and_undefined_values_are_no_crash(tmp_path: Path) -> None:
    text = UNITS.replace("lagrange: u^2 + w^2", "lagrange: u^2 + log(x - 9)")
    solution = quito.solve(load_text(text, "nan.yaml"), steps=3)
    assert not solution.success
    draw(solution, ("states", "controls", "costates", "mesh"), tmp_path / "nan.png")
    assert (tmp_path / "nan.png").stat().st_size > SMALLEST["png"]


@pytest.mark.parametrize("ending", SMALLEST)
@pytest.mark.parametrize("panels", [("states", "controls"), ("costates", "mesh")])
def test_files(units: quito.Solution, tmp_path: Path, ending: str, panels: tuple[str, ...]) -> None:
    path = tmp_path / "new" / f"picture.{ending}"
    draw(units, panels, path)
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    assert path.stat().st_size > SMALLEST[ending]


@pytest.mark.parametrize("ending", ["png", "pdf"])
def test_the_same_picture_has_the_same_bytes(
    units: quito.Solution, tmp_path: Path, ending: str
) -> None:
    for name in ("one", "two"):
        draw(units, ("states",), tmp_path / f"{name}.{ending}")
    one, two = ((tmp_path / f"{name}.{ending}").read_bytes() for name in ("one", "two"))
    assert one == two


def test_an_svg_is_xml_and_names_no_date(units: quito.Solution, tmp_path: Path) -> None:
    draw(units, ("states",), tmp_path / "picture.svg")
    text = (tmp_path / "picture.svg").read_text(encoding="utf-8")
    assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
    assert "dc:date" not in text


def test_an_older_picture_stays_where_a_new_one_cannot_be_drawn(
    units: quito.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(b"older")

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    with pytest.raises(quito.ResultFileError, match="No space left on device"):
        draw(units, ("states",), path)
    assert path.read_bytes() == b"older"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("panels", [("states", "controls"), ("costates",), tuple(PANELS)])
def test_eight_states_lay_out(solve: Solve, tmp_path: Path, panels: tuple[str, ...]) -> None:
    """Warnings are errors here: matplotlib warns where a layout does not fit."""
    solution = solve(EIGHT, steps=6)
    drawn = figure(solution, panels)
    draw(solution, panels, tmp_path / "eight.png")
    drawn.draw_without_rendering()
    counts = {"states": 8, "controls": 2, "costates": 8, "mesh": 1, "plan": 0}
    counts["switching"] = 0 if solution.extremal is None else len(solution.extremal.curves)
    assert len(drawn.axes) == sum(counts[panel] for panel in panels)
    boxes = [axes.get_position() for axes in drawn.axes]
    for i, one in enumerate(boxes):
        assert min(one.width, one.height) > 0.02
        for other in boxes[:i]:
            apart = (
                one.x0 >= other.x1 or other.x0 >= one.x1 or one.y0 >= other.y1 or other.y0 >= one.y1
            )
            assert apart


def test_a_constant_is_no_shape(solve: Solve) -> None:
    """w = 1 but for rounding: the axis does not blow that up."""
    text = UNITS.replace("u^2 + w^2", "u^2 + (w - 1)^2")
    (axes,) = (a for a in figure(solve(text, steps=8), ("controls",)).axes if a.get_ylabel() == "w")
    low, high = axes.get_ylim()
    assert high - low > 1e-4
    assert math.isfinite(high - low)


@pytest.mark.parametrize(
    "text", ["between $5 and $6", "$\\frac{1}$", "100 % {x} _a^b", "更快", "a\nb"]
)
def test_free_text_is_no_mathematics(text: str, tmp_path: Path) -> None:
    problem = load_text(UNITS, "text.yaml").model_copy(update={"title": text})
    unit = problem.states["x"].model_copy(update={"unit": text})
    problem = problem.model_copy(update={"states": {**problem.states, "x": unit}})
    solution = quito.solve(problem, steps=3)
    draw(solution, ("states",), tmp_path / "text.svg")
    assert (tmp_path / "text.svg").stat().st_size > SMALLEST["svg"]


def test_nothing_to_draw_is_said(solve: Solve) -> None:
    text = "time: {initial: 0, final: 1}\nstates: {x: {initial: 1}}\ndynamics: {x: -x}\n"
    solution = solve(text + "cost: {mayer: x}\n", steps=4)
    assert len(figure(solution, ("states", "controls")).axes) == 1
    with pytest.raises(quito.UsageError, match="no controls"):
        figure(solution, ("controls",))


PLANS = """
constants: {c: [0.5, 0.25], r: 0.1}
time: {initial: 0, final: 1}
states:
  x: {size: 2, initial: 0, final: [1, 1]}
  z: {initial: 2}
controls: {u: {size: 3}}
parameters: {p: {lower: 3, upper: 3}}
dynamics: {x: "[u[0], u[1]]", z: "u[2]"}
cost: {lagrange: "dot(u, u) + p^2"}
plots:
  plan:
    title: Seen from above
    curves: {there: x, "$back$": ["1 - x[0]", "x[1]^2"]}
    circles: [{centre: c, radius: r}, {centre: [9, 9], radius: 2*r}]
    boxes: [{centre: [0.5, 2*r], half: 0.05}]
  space:
    curves: {path: ["x[0]", z + p, t]}
    labels: [east, up, time]
    spheres: [{centre: [1, 2, 3], radius: 0.5}]
    boxes: [{centre: 0, half: [1, 2, 3]}]
"""
"""x = (t, t), z = 2, p = 3."""


def test_a_plan_shows_what_the_file_says(solve: Solve) -> None:
    solution = solve(PLANS, steps=8)
    plan, space = solution.drawings
    t = solution.dense_times
    assert plan.curves["there"] == pytest.approx(np.column_stack([t, t]), abs=1e-7)
    assert plan.curves["$back$"] == pytest.approx(np.column_stack([1 - t, t**2]), abs=1e-7)
    assert space.curves["path"] == pytest.approx(np.column_stack([t, 0 * t + 5, t]), abs=1e-7)
    assert (plan.title, plan.labels) == ("Seen from above", ("x[0]", "x[1]"))
    assert (space.title, space.labels) == ("space", ("east", "up", "time"))
    assert [(b.centre, b.radius) for b in plan.balls] == [((0.5, 0.25), 0.1), ((9.0, 9.0), 0.2)]
    assert [(b.centre, b.half) for b in plan.blocks] == [((0.5, 0.2), (0.05, 0.05))]
    assert [(b.centre, b.half) for b in space.blocks] == [((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))]


def test_a_plan_is_drawn_with_its_obstacles_and_equal_units(solve: Solve) -> None:
    drawn = figure(solve(PLANS, steps=8), DEFAULT)
    plan, space = drawn.axes[-2:]
    assert plan.get_aspect() == 1.0
    assert [type(patch).__name__ for patch in plan.patches] == ["Circle", "Rectangle"]
    bounds = plan.patches[1].get_bbox().extents  # type: ignore[attr-defined]
    assert bounds == pytest.approx([0.45, 0.15, 0.55, 0.25])
    start, end = plan.lines[1:3]
    assert start.get_xydata() == pytest.approx(np.zeros((1, 2)), abs=1e-7)
    assert end.get_xydata() == pytest.approx(np.ones((1, 2)), abs=1e-7)
    legend = plan.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["there", r"\$back\$"]
    low, high = plan.get_xlim()
    assert -0.5 < low < 0.0  # a far obstacle does not push the path aside
    assert 1.0 < high < 1.5
    assert space.name == "3d"
    assert space.get_ylabel() == "up"
    drawn.draw_without_rendering()


def test_a_plan_of_its_own(solve: Solve, tmp_path: Path) -> None:
    solution = solve(PLANS, steps=8)
    assert len(figure(solution, ("plan",)).axes) == 2
    draw(solution, ("plan",), tmp_path / "plan.png")
    with pytest.raises(quito.UsageError, match="the problem has no plan to draw"):
        figure(solve(UNITS), ("plan",))


@pytest.mark.parametrize(
    ("count", "rows"), [(1, [1]), (3, [3]), (4, [2, 2]), (5, [3, 2]), (8, [3, 3, 2])]
)
def test_rows_of_plots_are_balanced(solve: Solve, count: int, rows: list[int]) -> None:
    names = [f"x{i}" for i in range(count)]
    text = f"""
time: {{initial: 0, final: 1}}
states: {{{", ".join(f"{name}: {{initial: 0}}" for name in names)}}}
controls: {{u: {{}}}}
dynamics: {{{", ".join(f"{name}: u - 1" for name in names)}}}
cost: {{lagrange: u^2}}
"""
    drawn = figure(solve(text, steps=4), ("states",))
    tops = [axes.get_subplotspec().rowspan.start for axes in drawn.axes]  # type: ignore[union-attr]
    assert [tops.count(row) for row in range(len(rows))] == rows


def test_many_entries_share_plots_by_vector(solve: Solve) -> None:
    text = """
time: {initial: 0, final: 1}
states:
  x: {size: 12, initial: 0, unit: m}
  y: {initial: 0}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: "[u, 2*u, 0, 0, 0, 0, 0, 0, 0, 0, 0, t]", y: u}
cost: {lagrange: (u - t)^2}
"""
    drawn = by_label(figure(solve(text, steps=6), ("states", "controls")))
    assert sorted(drawn) == ["u", "x [m]", "y"]
    legend = drawn["x [m]"].get_legend()
    assert legend is not None
    assert [entry.get_text() for entry in legend.get_texts()] == [f"x[{i}]" for i in range(12)]
    costates = by_label(figure(solve(text, steps=6), ("costates",)))
    assert sorted(costates) == ["λ of x", "λ of y"]


ODD = """
time: {{initial: 0, final: 1}}
states: {{x: {{initial: 0}}, v: {{initial: 1}}}}
controls: {{u: {{lower: -1, upper: 1}}}}
dynamics: {{x: v, v: u}}
cost: {{lagrange: u^2}}
plots: {{p: {plot}}}
"""


@pytest.mark.parametrize(
    "plot",
    [
        "{curves: {a: ['log(-1 - x^2)', v]}, circles: [{centre: 0, radius: 1}]}",
        "{curves: {a: ['exp(1000 + x)', v]}, circles: [{centre: 0, radius: 1}]}",
        "{curves: {a: [x, v]}, circles: [{centre: 1, radius: 1e300}]}",
        "{curves: {a: [x, v]}, circles: [{centre: [1e12, 0], radius: 1e12}]}",
        "{curves: {a: ['1e300*x', v, u]}, spheres: [{centre: 0, radius: 1}]}",
        "{curves: {a: [x, v, t]}, boxes: [{centre: 0, half: 1e300}], spheres: []}",
    ],
)
def test_odd_plots_end_in_a_picture(plot: str, solve: Solve, tmp_path: Path) -> None:
    draw(solve(ODD.format(plot=plot), steps=4), ("plan",), tmp_path / "odd.png")
    assert (tmp_path / "odd.png").stat().st_size > 5000


def test_obstacles_are_cut_at_the_frame(solve: Solve) -> None:
    plot = "{curves: {a: [x, v]}, boxes: [{centre: [0.5, 0], half: [0.1, 50]}]}"
    (axes,) = figure(solve(ODD.format(plot=plot), steps=4), ("plan",)).axes
    (box,) = axes.patches
    low, high = axes.get_ylim()
    extents = box.get_bbox().extents  # type: ignore[attr-defined]
    assert extents == pytest.approx([0.4, low, 0.6, high])
    far = plot.replace("[0.5, 0]", "[90, 0]")
    assert not figure(solve(ODD.format(plot=far), steps=4), ("plan",)).axes[0].patches


def test_a_curve_may_be_called_as_it_likes(solve: Solve) -> None:
    plot = "{curves: {_one: [x, v], two: ['2*x', v]}}"
    (axes,) = figure(solve(ODD.format(plot=plot), steps=4), ("plan",)).axes
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["_one", "two"]
