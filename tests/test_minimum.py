"""The control makes H least over all admissible ones: lesser wells are found out, right ones pass.

Wells are in closed form, or found by means of their own: roots of polynomials, grids, scipy.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import pytest
from conftest import Solve
from numpy.typing import NDArray
from scipy.optimize import brute, fmin

import quito_cli as quito
from quito_cli.optimality.certificate.certificate import certify
from quito_cli.optimality.certificate.lesser import Search
from quito_cli.optimality.certificate.minimum import slopes_say_all
from quito_cli.optimality.hamiltonian import Pontryagin, pontryagin
from quito_cli.optimality.symbols.probes import Probe
from quito_cli.problem.model import Model
from quito_cli.solution.optimal import MINIMUM, Condition
from quito_cli.solution.tally import doubts

Array = NDArray[np.float64]
Build = Callable[[str], Model]

SCHEMES = ["rk4", "euler", "trapezoidal", "hermite-simpson", "radau", "lgr"]
NUMBER = r"(-?\d[\d.e+-]*)"


def failing(rows: Iterable[Condition]) -> set[str]:
    return {r.condition for r in rows if r.verdict == "fails"}


def minimum(solution: quito.Solution) -> Condition:
    return next(r for r in solution.certificate if r.condition == MINIMUM)


def said(reason: str) -> tuple[float, float, float, float]:
    """Return from when to when another control is better, where it is best, and by how much."""
    pattern = rf"H less from t = {NUMBER} to {NUMBER}: at t = {NUMBER} by {NUMBER}, "
    found = re.search(pattern, reason)
    assert found, reason
    return tuple(float(v) for v in found.groups())  # type: ignore[return-value]


def better(reason: str, control: str = "u") -> float:
    """Return the value of a control that is named as the better one."""
    found = re.search(rf"\b{control} = {NUMBER}.* instead of", reason)
    assert found, reason
    return float(found[1])


# Two wells


WELLS = """
title: Two wells
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {BOUNDS guess: START}}
dynamics: {x: u}
cost: {lagrange: (u^2 - 1)^2 + 0.4*u + 0.1*x}
"""
"""λ = 0.1 (1 − t): H_u = 4u³ − 4u + 0.4 + λ, whose outer roots are the wells."""
BOUNDED, FREE = "lower: -2, upper: 2,", ""


def wells(slope: float) -> tuple[float, float, float]:
    """Return both wells of (u² − 1)² + slope·u, the shallower last, and the difference."""
    roots = np.sort(np.roots([4, 0, -4, slope]).real)
    deep, shallow = (roots[0], roots[2]) if slope > 0 else (roots[2], roots[0])
    values = [(u**2 - 1) ** 2 + slope * u for u in (deep, shallow)]
    return float(deep), float(shallow), float(values[1] - values[0])


def two(start: float, bounds: str) -> str:
    return WELLS.replace("BOUNDS", bounds).replace("START", str(start))


@pytest.mark.parametrize("bounds", [BOUNDED, FREE], ids=["bounded", "free"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_shallower_of_two_wells_is_called_out(scheme: str, bounds: str, solve: Solve) -> None:
    steps = 15 if scheme == "lgr" else 50
    solution = solve(two(1, bounds), discretization=scheme, steps=steps)
    assert solution.success
    row = minimum(solution)
    assert row.verdict == "fails"
    start, end, time, amount = said(row.reason)
    assert (start, end) == (0, 1)
    assert time == pytest.approx(row.time, rel=1e-5)
    deep, shallow, difference = wells(0.4 + 0.1 * (1 - time))
    assert solution.control([time])[0, 0] == pytest.approx(shallow, abs=0.01)
    assert row.residual == pytest.approx(difference, rel=0.01)
    assert amount == pytest.approx(row.residual, rel=0.01)
    assert better(row.reason) == pytest.approx(deep, abs=0.01)
    assert row.scale >= row.residual / 2


@pytest.mark.parametrize("bounds", [BOUNDED, FREE], ids=["bounded", "free"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_deeper_one_passes(scheme: str, bounds: str, solve: Solve) -> None:
    steps = 15 if scheme == "lgr" else 50
    solution = solve(two(-1, bounds), discretization=scheme, steps=steps)
    assert minimum(solution).verdict.startswith("holds")
    assert not [text for text in solution.warnings if "well" in text]


@pytest.mark.parametrize("start", [-1, 1])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_wells_of_one_depth_are_both_right(scheme: str, start: int, solve: Solve) -> None:
    """H = (u² − 1)² + λu with λ = 0: nothing is gained on the other side."""
    text = two(start, BOUNDED).replace(" + 0.4*u + 0.1*x", "")
    solution = solve(text, discretization=scheme, steps=20)
    assert solution.control([0.5])[0, 0] == pytest.approx(start, abs=1e-3)
    assert minimum(solution).verdict == "holds"


@pytest.mark.parametrize("size", [1e-4, 1, 1e4])
def test_units_do_not_matter(size: float, solve: Solve) -> None:
    """The same wells of a control without bounds in other units."""
    text = two(size, FREE).replace("u^2", f"(u/{size})^2").replace("0.4*u", f"0.4*u/{size}")
    solution = solve(text.replace("x: u}", f"x: u/{size}}}"), steps=20)
    row = minimum(solution)
    assert failing(solution.certificate) == {MINIMUM}
    deep, _, difference = wells(0.4 + 0.1 * (1 - row.time))
    assert row.residual == pytest.approx(difference, rel=0.01)
    assert better(row.reason) == pytest.approx(size * deep, rel=0.01)


def test_a_well_is_lesser_for_a_part_of_the_time(solve: Solve) -> None:
    """(u² − 1)² + (t − ½)u: the well at 1 is the shallower from ½ on."""
    text = two(1, BOUNDED).replace("0.4*u + 0.1*x", "(t - 0.5)*u")
    row = minimum(solve(text, steps=100))
    start, end, time, _ = said(row.reason)
    assert start == pytest.approx(0.5, abs=0.02)
    assert end == 1
    assert time == pytest.approx(1, abs=0.01)
    assert row.residual == pytest.approx(wells(time - 0.5)[2], rel=0.01)


def test_the_warning_is_a_sentence_that_says_what_to_do(solve: Solve) -> None:
    solution = solve(two(1, BOUNDED), steps=50)
    (warning,) = [text for text in solution.warnings if "well" in text]
    assert minimum(solution).reason in warning
    assert "as `guess`" in warning
    assert not [text for text in solution.warnings if "do not all hold" in text]


def test_other_failures_are_warned_of_too() -> None:
    lesser = Condition(MINIMUM, 0.5, 1.0, 0.3, "fails", "another control is better")
    other = Condition("H is constant", 0.1, 1.0, 0.6, "fails", "H is off")
    first, second = doubts([lesser, other])
    assert first.startswith("Pontryagin's conditions do not all hold (2 conditions fail in all): ")
    assert "H is constant, by 1e-01 of its scale at t = 0.6" in first
    assert "another control is better" in second


# Constraints


CUT = two(1, BOUNDED) + "constraints: {path: {cut: 'u - x/10 >= LIMIT'}}\n"
"""x = 0.94 t about where u is in the shallower well."""


@pytest.mark.parametrize("limit", [-0.3, 0.2])
def test_a_well_that_a_constraint_excludes_is_none(limit: float, solve: Solve) -> None:
    solution = solve(CUT.replace("LIMIT", str(limit)), steps=30)
    assert failing(solution.certificate) == set()
    assert minimum(solution).verdict == "holds"


def test_a_constraint_may_cut_a_well(solve: Solve) -> None:
    """The better control is the least admissible one, −0.9 + x/10, not the well at −1.05."""
    solution = solve(CUT.replace("LIMIT", "-0.9"), steps=30)
    assert failing(solution.certificate) == {MINIMUM}
    row = minimum(solution)
    assert better(row.reason) == pytest.approx(
        -0.9 + solution.state([row.time])[0, 0] / 10, abs=1e-4
    )


CIRCLE = """
title: A direction
time: {initial: 0, final: 1}
states: {x: {initial: 0, guess: "START*t"}, y: {initial: 0}}
controls: {u: {guess: START}, v: {guess: 0}}
dynamics: {x: u, y: v}
cost: {lagrange: 0.1*y^2, mayer: final(x)}
constraints: {path: {circle: u^2 + v^2 == 1}}
"""
"""H = λ₁u + λ₂v with λ = (1, 0): stationary on the circle at u = ±1, least at −1."""


def test_a_control_on_a_curve_that_goes_the_wrong_way(solve: Solve) -> None:
    """No point that is tried is on the curve by itself."""
    wrong = solve(CIRCLE.replace("START", "1"), steps=30)
    assert wrong.cost == pytest.approx(1, abs=1e-6)
    assert failing(wrong.certificate) == {MINIMUM}
    assert minimum(wrong).residual == pytest.approx(2, rel=1e-3)
    assert better(minimum(wrong).reason) == pytest.approx(-1, abs=1e-3)
    right = solve(CIRCLE.replace("START", "-1"), steps=30)
    assert right.cost == pytest.approx(-1, abs=1e-6)
    assert failing(right.certificate) == set()


def test_a_state_constraint_does_not_excuse_a_well(solve: Solve) -> None:
    """(u² − 1)² + 0.4u under x ≤ 0.3, with a mean of u that is prescribed by nothing else.

    On the arc of the constraint u is 0, and costates have what makes H_u zero there: 0 lies between
    the wells, and is no minimum of H.
    """
    text = """
title: Down under a ceiling
time: {initial: 0, final: 1}
states: {x: {initial: 0, upper: 0.3}}
controls: {u: {lower: -2, upper: 2, guess: -1}}
dynamics: {x: u}
cost: {lagrange: (u^2 - 1)^2 + 0.4*u}
"""
    solution = solve(text, steps=40)
    assert failing(solution.certificate) == set()
    assert minimum(solution).verdict == "holds"


# Free times, several controls, kinks


FREE_TIME = """
title: Free final time
time: {initial: 0, final: {lower: 0.1, upper: 10, guess: 1}}
states: {x: {initial: 0, final: 1}, y: {initial: 0}}
controls: {u: {lower: -4, upper: 4, guess: START}}
dynamics: {x: u^2, y: u}
cost: {lagrange: 1 + (u^2 - 4)^2/10 + 0.05*u}
"""
"""λ_y = 0, and H = 0: λ_x = −L/u². Of ±u the negative one has less, by 0.1 |u|, and its well is
deeper still."""


def test_a_free_final_time(solve: Solve) -> None:
    wrong, right = (solve(FREE_TIME.replace("START", s), steps=30) for s in ("1.5", "-1.5"))
    assert failing(right.certificate) == set()
    assert minimum(right).verdict == "holds"
    row, u = minimum(wrong), float(wrong.control([0.1])[0, 0])
    assert failing(wrong.certificate) == {MINIMUM}
    pull = -(1 + (u**2 - 4) ** 2 / 10 + 0.05 * u) / u**2
    v = np.linspace(-4, 4, 80_001)
    h = 1 + (v**2 - 4) ** 2 / 10 + 0.05 * v + pull * v**2
    assert row.residual == pytest.approx(-h.min(), rel=1e-3)
    assert row.residual > 0.1 * u
    assert better(row.reason) == pytest.approx(v[h.argmin()], abs=0.02)
    assert said(row.reason)[:2] == pytest.approx((0, wrong.times[-1]), rel=1e-4)


PAIR = """
title: Two controls
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: -2, upper: 2, guess: START}, v: {lower: -2, upper: 2, guess: START}}
dynamics: {x: u + v}
cost: {lagrange: (u^2 - 1)^2 + (v^2 - 1)^2 - 2*u*v + 0.3*(u + v)}
"""
"""λ = 0. Either control alone does better where it is; both together, on the other side, less."""


def pair(point: Sequence[float]) -> float:
    u, v = point
    return float((u**2 - 1) ** 2 + (v**2 - 1) ** 2 - 2 * u * v + 0.3 * (u + v))


def test_two_controls_that_must_move_together(solve: Solve) -> None:
    wrong, right = (solve(PAIR.replace("START", s), steps=20) for s in ("1", "-1"))
    own = wrong.control([0.5])[0]
    alone = np.linspace(-2, 2, 401)
    assert min(pair((u, own[1])) for u in alone) > pair(own) - 1e-4
    best = brute(pair, ((-2, 2), (-2, 2)), Ns=41, finish=fmin)
    row = minimum(wrong)
    assert failing(wrong.certificate) == {MINIMUM}
    assert row.residual == pytest.approx(pair(own) - pair(best), rel=0.02)
    assert better(row.reason, "u") == pytest.approx(best[0], abs=0.05)
    assert better(row.reason, "v") == pytest.approx(best[1], abs=0.05)
    assert failing(right.certificate) == set()


def test_a_control_that_stays_is_not_named(solve: Solve) -> None:
    text = two(1, BOUNDED).replace("controls: {", "controls: {w: {lower: -1, upper: 1}, ")
    text = text.replace("+ 0.4*u", "+ 0.4*u + (w - 0.5)^2")
    row = minimum(solve(text, steps=20))
    assert row.verdict == "fails"
    assert "w =" not in row.reason


def test_wells_that_a_kink_makes(solve: Solve) -> None:
    """u² − 2|u| + 0.3u has H_uu = 2 everywhere, and wells at 0.85 and −1.15, 0.6 apart."""
    text = two(1, BOUNDED).replace("(u^2 - 1)^2 + 0.4*u + 0.1*x", "u^2 - 2*abs(u) + 0.3*u")
    solution = solve(text, steps=20)
    assert failing(solution.certificate) == {MINIMUM}
    row = minimum(solution)
    assert row.residual == pytest.approx(0.6, rel=1e-3)
    assert better(row.reason) == pytest.approx(-1.15, abs=0.01)


# Where the slopes say all


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("van_der_pol", "H is affine in the controls, so that its slopes say all"),
        ("rayleigh", "H is convex in the controls, so that its slopes say all"),
        ("rayleigh_mixed", "H is convex in the controls, so that its slopes say all"),
    ],
)
def test_nothing_is_searched_where_the_slopes_say_all(name: str, reason: str, solve: Solve) -> None:
    row = minimum(solve(name, steps=60))
    assert (row.verdict, row.reason) == ("not applicable", reason)


@pytest.mark.parametrize(
    ("cost", "constraint", "enough"),
    [
        ("u^2 + v^2 + u*v", "", True),
        ("u^2 + v", "", True),
        ("x*u", "", True),
        ("u^2 + v", "u + v*x <= 3", True),
        ("u^2 + v", "u*v <= 3", False),
        ("u*v", "", False),
        ("u^2 - 0.1*v^2", "", False),
        ("u^2 + abs(v - 0.3)", "", False),
        ("u^2 + if_else(v > 0.2, 1, 0)", "", False),
        ("u^3 + v", "", False),
        ("cos(u)", "", False),
    ],
)
def test_which_hamiltonians_have_one_well(
    cost: str, constraint: str, enough: bool, model: Build
) -> None:
    path = f"constraints: {{path: {{c: {constraint}}}}}" if constraint else ""
    system = pontryagin(
        model(f"""
title: One well or more
time: {{initial: 0, final: 1}}
states: {{x: {{initial: 0}}}}
controls: {{u: {{lower: -1, upper: 1}}, v: {{lower: -1, upper: 1}}}}
dynamics: {{x: u + v}}
cost: {{lagrange: "{cost}"}}
{path}
""")
    )
    one, two_ = np.ones((1, 1)), np.array([[0.3, -0.4]])
    curvature = system.along(np.zeros(1), one, one, two_, np.zeros(0)).curvature
    assert bool(slopes_say_all(system, Probe(system), curvature)) == enough


def test_a_problem_without_controls_says_so(solve: Solve) -> None:
    text = """
title: A free initial value
time: {initial: 0, final: 1}
states: {x: {}}
dynamics: {x: -x}
cost: {mayer: (x - 1)^2}
"""
    assert minimum(solve(text, steps=4)).reason == "there is no control"


# The search


def searched(system: Pontryagin, u: Array, value: Callable[[Array], Array]) -> Array:
    """Return the controls that a search finds for a value of controls, (n, n_u)."""

    def evaluate(tried: int, controls: Array) -> list[Array]:
        none = np.zeros((len(controls), 0))
        return [value(controls)[:, None], none, none]

    return Search(system, u, evaluate).found(np.zeros(u.shape[1])).least.controls


@pytest.mark.parametrize("bounds", ["lower: -2, upper: 2,", "lower: -2,", ""])
@pytest.mark.parametrize("well", [-1.7, -0.83, 0.9])
def test_a_narrow_well_is_found_to_a_hundredth_of_its_range(
    bounds: str, well: float, model: Build
) -> None:
    """Of width 0.25 and depth 2 below a parabola about 0.2."""
    system = pontryagin(model(two(0, bounds)))

    def value(u: Array) -> Array:
        return np.asarray((u[:, 0] - 0.2) ** 2 - 6 * np.exp(-(((u[:, 0] - well) / 0.25) ** 2)))

    found = searched(system, np.array([[0.2], [-0.35], [0.5]]), value)
    fine = np.linspace(-2, 2, 400_001)
    assert found == pytest.approx(np.full((3, 1), fine[value(fine[:, None]).argmin()]), abs=0.01)


def test_what_is_not_finite_is_not_better(model: Build) -> None:
    system = pontryagin(model(two(0, BOUNDED)))

    def value(u: Array) -> Array:
        return np.where(u[:, 0] < -0.5, -np.inf, np.where(u[:, 0] > 0.7, np.nan, u[:, 0] ** 2))

    assert searched(system, np.zeros((2, 1)), value) == pytest.approx(np.zeros((2, 1)))


def test_a_hamiltonian_too_long_to_probe_is_searched(
    model: Build, solve: Solve, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = pontryagin(model("rayleigh"))
    monkeypatch.setattr("quito_cli.optimality.symbols.probes.MOST_OPERATIONS", 1)
    assert not slopes_say_all(system, Probe(system), np.ones((1, 1, 1)))


def test_a_polished_answer_is_judged_too(solve: Solve) -> None:
    solution = solve(two(-1, BOUNDED), polish=True)
    assert solution.polished
    assert minimum(solution).verdict == "holds"


def test_an_answer_given_another_tilt_fails(solve: Solve, model: Build) -> None:
    """What was the deeper well is the shallower one of the other problem."""
    solution: Any = solve(two(-1, BOUNDED).replace("0.4*u + 0.1*x", "0.01*u"), steps=40)
    other = two(-1, BOUNDED).replace("0.4*u + 0.1*x", "(-0.01)*u")
    found = certify(model(other), solution)
    assert MINIMUM in failing(found.certificate)
