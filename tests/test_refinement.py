"""Meshes that follow the control: what they are made of, and what they reach.

Switching times, controls and costs are those of the files' references, which are verified apart
from quito (see test_references and test_derivations).
"""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import quito_cli as quito
from quito_cli.problem.build import build
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Known, Model
from quito_cli.refinement import monitor
from quito_cli.refinement.account import within
from quito_cli.refinement.grading import GROWTH, graded
from quito_cli.refinement.monitor import local_errors
from quito_cli.solution.junctions import junctions
from quito_cli.solvers.outcome import Status
from quito_cli.solving.on_mesh import Task
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.qualities import leading_moment

Array = NDArray[np.float64]
Reference = Callable[[str], tuple[dict[str, Any], dict[str, Array]]]

SINGULAR = ("van_der_pol", "bressan", "bang_bang", "siri", "catalyst_mixing")
SMOOTH = ("alychan", "brachistochrone", "orbit_transfer", "hanging_chain")


@cache
def refined(name: str) -> quito.Solution:
    """An adaptive solve of a bundled problem with default options."""
    return quito.solve(name, mesh="adaptive")


@cache
def known(name: str) -> tuple[Model, Known]:
    """A bundled problem, and what its file knows of the answer."""
    model = build(quito.load(name))
    assert model.known is not None
    return model, model.known


def control_error(name: str, solution: quito.Solution, times: Array) -> Array:
    """|û − u*| over the range of u*, (len(times), n_u)."""
    model, truth = known(name)
    u = Known.sample(truth.controls, model.controls, times)
    return np.asarray(np.abs(solution.control(times) - u) / np.ptp(u, axis=0))


def quadrature(solution: quito.Solution, breaks: tuple[float, ...]) -> tuple[Array, Array]:
    """Gauss points and weights between all nodes and breaks."""
    ends = np.unique(np.concatenate([solution.times, breaks]))
    h = np.diff(ends)
    points, weights = np.polynomial.legendre.leggauss(5)
    times = ends[:-1, None] + h[:, None] * (1 + points) / 2
    return times.ravel(), (h[:, None] * weights / 2).ravel()


# --- what is reached ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SINGULAR)
def test_switching_times_are_found(name: str) -> None:
    solution, (_, truth) = refined(name), known(name)
    horizon = solution.times[-1] - solution.times[0]
    assert len(solution.switching_times) == len(truth.switching_times)
    found = np.abs(np.array(solution.switching_times) - truth.switching_times) / horizon
    assert found.max() <= (5e-4 if name == "catalyst_mixing" else 1e-4)
    jumps = [j for j in solution.junctions if j.kind == "jump"]
    near = [min(abs(j.time - t) for t in truth.switching_times) for j in jumps]
    assert all(d <= j.uncertainty for d, j in zip(near, jumps, strict=True))


LARGEST = {
    "van_der_pol": 1e-3,
    "bressan": 2e-4,
    "bang_bang": 1e-5,
    "siri": 1e-3,
    "catalyst_mixing": 1e-3,
}
"""Error of the control over its range, outside ±0.1 % of the horizon around the switching times."""


@pytest.mark.parametrize(("name", "largest"), LARGEST.items())
def test_the_control_is_right(name: str, largest: float) -> None:
    solution, (_, truth) = refined(name), known(name)
    assert solution.success
    assert len(solution.times) - 1 <= 200
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) + 1 <= 10
    horizon = float(solution.times[-1] - solution.times[0])
    times, weights = quadrature(solution, truth.switching_times)
    error = control_error(name, solution, times)
    far = np.all([np.abs(times - t) > 1e-3 * horizon for t in truth.switching_times], axis=0)
    assert error[far].max() <= largest
    l2 = np.sqrt((weights[:, None] * error**2).sum(axis=0) / horizon)
    assert l2.max() <= 2e-3


@pytest.mark.parametrize("name", SINGULAR)
def test_the_control_does_not_ring(name: str) -> None:
    solution, (model, truth) = refined(name), known(name)
    exact = Known.sample(truth.controls, model.controls, solution.dense_times)
    variation = np.abs(np.diff(exact, axis=0)).sum(axis=0)
    assert np.all(np.array(solution.evidence.total_variation) <= 1.2 * variation)


@pytest.mark.parametrize("name", ["rayleigh", "rayleigh_mixed", "van_der_pol_state"])
def test_costs_of_constrained_problems(name: str) -> None:
    solution, (_, truth) = refined(name), known(name)
    assert truth.cost is not None
    assert abs(solution.evidence.resimulated_cost - truth.cost) <= 1e-6 * truth.cost


def test_kinks_are_found_where_a_bound_ends() -> None:
    solution, (_, truth) = refined("rayleigh"), known("rayleigh")
    assert [j.kind for j in solution.junctions] == ["kink"] * 3
    found = np.array([j.time for j in solution.junctions]) - truth.switching_times
    assert np.all(np.abs(found) <= [j.uncertainty for j in solution.junctions])


@pytest.mark.parametrize("name", SMOOTH)
def test_a_smooth_control_has_no_jumps(name: str) -> None:
    assert not [j for j in refined(name).junctions if j.kind == "jump"]


def test_layers_of_a_tracking_problem_are_no_jumps() -> None:
    """Its control follows the sine with layers a hundredth of a unit wide, and no jump."""
    assert not [j for j in refined("double_integrator_tracking").junctions if j.kind == "jump"]


SAMPLED = ("rayleigh", "rayleigh_mixed", "van_der_pol_state", "inverted_pendulum", "bryson_denham")
"""Those whose control is known by samples only."""
FLOOR = 1e-6
"""Of the range: smaller errors, and estimates of them, are the solver's tolerance."""


def test_the_estimate_of_the_error_is_honest(reference: Reference) -> None:
    """A factor of 10 in the median and 30 at worst, over all problems whose control is known."""
    factors = {}
    for name in sorted({p.name for p in map(quito.load, CLOSED)} | set(SAMPLED)):
        solution = refined(name)
        assert solution.refinement is not None
        account = solution.refinement.account
        if account is None:
            continue
        if name in SAMPLED:
            samples = reference(name)[1]
            times, u = samples["t"], samples["u"].reshape(len(samples["t"]), -1)
            error = np.abs(solution.control(times) - u) / np.ptp(u, axis=0)
        else:
            times, _ = quadrature(solution, known(name)[1].switching_times)
            error = control_error(name, solution, times)
        true = float(error[~within(times, account.left_out)].max())
        factor = max(account.control, FLOOR) / max(true, FLOOR)
        factors[name] = max(factor, 1 / factor)
    assert len(factors) >= 15
    assert np.median(list(factors.values())) <= 10, factors
    assert max(factors.values()) <= 30, factors


def test_an_answer_that_is_not_the_last_is_held_against_a_later_one() -> None:
    """u = tanh(200 (t − 0.4)) makes the cost zero; the first mesh misses it by far."""
    text = ONE_CONTROL.replace("INTEGRAND", "(u - tanh(200*(t - 0.4)))^2").replace(
        "{lower: 0, upper: 1}", "{}"
    )
    solution = quito.solve(load_text(text, "steep.yaml"), mesh="adaptive")
    how = solution.refinement
    assert how is not None
    assert how.account is not None
    assert (how.kept, len(how.rounds)) == (1, 3)
    t = np.linspace(0, 1, 20_001)
    error = np.abs(solution.control(t)[:, 0] - np.tanh(200 * (t - 0.4))) / 2
    true = error[~within(t, how.account.left_out)].max()
    assert true / 30 <= how.account.control <= 30 * max(true, FLOOR)


CLOSED = (
    "alychan",
    "bang_bang",
    "brachistochrone",
    "bressan",
    "catalyst_mixing",
    "double_integrator_tracking",
    "hypersensitive",
    "minimum_time",
    "moon_lander",
    "robot_arm",
    "siri",
    "strongest_column",
    "van_der_pol",
)
"""Those whose control is known in closed form."""


def test_a_uniform_mesh_needs_many_more_nodes() -> None:
    """The same L² error of the control takes more than 20 times the nodes on a uniform mesh.

    A jump in a cell of length h costs √h in L², so that four times the nodes halve the error: three
    meshes tell how many it would take.
    """
    _, truth = known("van_der_pol")

    def error(solution: quito.Solution) -> float:
        times, weights = quadrature(solution, truth.switching_times)
        e = control_error("van_der_pol", solution, times)[:, 0]
        return float(np.sqrt((weights * e**2).sum() / 4))

    cells = np.array([100, 400, 1600])
    uniform = [error(quito.solve("van_der_pol", steps=int(n))) for n in cells]
    slope, offset = np.polyfit(np.log(cells), np.log(uniform), 1)
    assert -0.75 < slope < -0.3
    solution = refined("van_der_pol")
    needed = math.exp((math.log(error(solution)) - offset) / slope)
    assert needed > 20 * (len(solution.times) - 1)


# --- the loop -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {"control": "piecewise-constant"},
        {"control": "piecewise-linear"},
        {"discretization": "euler"},
        {"discretization": "trapezoidal"},
        {"discretization": "hermite-simpson"},
        {"discretization": "radau"},
        {"generating_function": "laguerre4"},
        {"generating_function": "sech"},
        {"variance": 4.0},
        {"normalised": False, "variance": 4.0},
    ],
    ids=str,
)
def test_any_control_and_scheme(options: dict[str, Any]) -> None:
    """Each finds both jumps of a bang-bang control far more closely than the cells of the start."""
    solution = quito.solve("bang_bang", mesh="adaptive", mesh_steps=60, **options)
    assert solution.success
    jumps = [j.time for j in solution.junctions if j.kind == "jump"]
    closely = 5e-3 if solution.options["discretization"] == "euler" else 1 / 60 / 20
    assert jumps == pytest.approx(known("bang_bang")[1].switching_times, abs=closely)


def test_a_smooth_control_takes_one_mesh_and_a_check() -> None:
    solution = refined("brachistochrone")
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) == 1
    assert solution.refinement.account is not None
    assert solution.refinement.account.control < 1e-4


def test_rounds_are_recorded() -> None:
    solution = refined("van_der_pol")
    refinement = solution.refinement
    assert refinement is not None
    kept = refinement.rounds[refinement.kept]
    assert np.array_equal(kept.nodes, solution.times)
    assert kept.cost == solution.cost
    assert len(refinement.rounds[0].nodes) == 101
    assert math.isnan(refinement.rounds[0].change)
    assert solution.statistics.iterations is not None
    assert solution.statistics.iterations > sum(r.iterations for r in refinement.rounds)


def test_points_in_time_stay_nodes() -> None:
    text = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 0}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: -x}
constraints: {point: {third: {at: 0.3, holds: x <= 0.1}}}
"""
    solution = quito.solve(load_text(text, "points.yaml"), mesh="adaptive", mesh_steps=20)
    assert solution.success
    assert np.abs(solution.times - 0.3).min() < 1e-15


def test_a_failure_half_way_keeps_the_best_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    again = Task.again

    def fails(self: Task, mesh: Mesh, substeps: int, earlier: quito.Solution) -> quito.Solution:
        from dataclasses import replace

        found = again(self, mesh, substeps, earlier)
        late = len(found.times) > 130
        return replace(found, status=Status.ITERATION_LIMIT) if late else found

    monkeypatch.setattr(Task, "again", fails)
    solution = quito.solve("van_der_pol", mesh="adaptive")
    assert solution.success
    assert solution.refinement is not None
    assert solution.refinement.account is None
    assert len(solution.refinement.rounds) == 2
    assert "on mesh 3" in solution.refinement.outcome
    assert any("not refined to the end" in warning for warning in solution.evidence.warnings)


def test_an_interrupted_refinement_is_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    again = Task.again
    monkeypatch.setattr(
        Task, "again", lambda *given: replace(again(*given), status=Status.INTERRUPTED)
    )
    solution = quito.solve("van_der_pol", mesh="adaptive")
    assert solution.status is Status.INTERRUPTED
    assert len(solution.times) == 101


def test_more_substeps_where_the_integrator_does_not_see_the_control() -> None:
    """With two substeps the control of this problem rings on a graded mesh (DESIGN 3.2)."""
    solution = refined("catalyst_mixing")
    assert solution.refinement is not None
    assert next(r.substeps for r in solution.refinement.rounds) == 2
    assert solution.options["substeps"] > 2


ONE_CONTROL = """
time: {initial: 0, final: 1}
states: {x: {initial: 0}}
controls: {u: {lower: 0, upper: 1}}
dynamics: {x: u}
cost: {lagrange: INTEGRAND}
"""


def test_a_control_that_is_zero_has_no_jumps_and_little_error() -> None:
    """u = 0 is the only minimiser of ∫u; what a solver leaves of it is no range to judge it by."""
    solution = quito.solve(
        load_text(ONE_CONTROL.replace("INTEGRAND", "u"), "zero.yaml"), mesh="adaptive"
    )
    assert not solution.junctions
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) <= 3
    assert solution.refinement.account is not None
    assert solution.refinement.account.control < 1e-6


def test_a_jump_within_the_first_cell_is_found() -> None:
    """u = 1 from 0.003 on: on the first cells, of 0.01 each, û looks like a constant."""
    solution = quito.solve(
        load_text(ONE_CONTROL.replace("INTEGRAND", "u*(0.003 - t)"), "early.yaml"), mesh="adaptive"
    )
    assert [j.kind for j in solution.junctions] == ["jump"]
    assert solution.switching_times == pytest.approx([0.003], abs=1e-5)
    assert solution.evidence.resimulated_cost == pytest.approx(-(0.997**2) / 2, abs=1e-9)


def test_jumps_that_the_cells_allowed_cannot_sharpen_are_told() -> None:
    text = ONE_CONTROL.replace("INTEGRAND", "u*sin(20*t)")
    solution = quito.solve(load_text(text, "many.yaml"), mesh="adaptive", mesh_steps=60)
    how = solution.refinement
    assert how is not None
    assert len(solution.switching_times) == 6  # at k π / 20
    assert how.rounds[-1].blur > 1e-3
    assert how.outcome.endswith("With more cells, its jumps would be sharper.")


def test_no_more_meshes_than_allowed() -> None:
    """With this scheme the check for waves asks for more substeps once seven meshes are done."""
    solution = quito.solve("van_der_pol", mesh="adaptive", discretization="trapezoidal")
    assert solution.refinement is not None
    assert len(solution.refinement.rounds) <= 8


def test_a_solver_that_does_not_tell_its_iterations_may_take_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from dataclasses import replace

    allowed: list[int] = []
    on, again = Task.on, Task.again

    def noted(self: Task, *given: Any) -> quito.Solution:
        allowed.append(self.max_iterations)
        return on(self, *given)

    def untold(self: Task, mesh: Mesh, substeps: int, earlier: quito.Solution) -> quito.Solution:
        unknown = replace(earlier, statistics=replace(earlier.statistics, iterations=None))
        return again(self, mesh, substeps, unknown)

    monkeypatch.setattr(Task, "on", noted)
    monkeypatch.setattr(Task, "again", untold)
    quito.solve("brachistochrone", mesh="adaptive", max_iterations=700)
    assert allowed == [700, 700]


# --- graded meshes --------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(1e-6, 1.0), min_size=4, max_size=40),
    st.integers(50, 400),
    st.lists(st.floats(0.02, 0.98), max_size=3, unique=True),
)
def test_graded_meshes(wanted: list[float], most: int, points: list[float]) -> None:
    mesh = Mesh.uniform(len(wanted))
    found = graded(mesh, np.array(wanted), 1e-6, most, np.array(sorted(points)))
    assert found.fractions[0] == 0.0
    assert found.fractions[-1] == 1.0
    assert found.cells <= most
    assert np.all(found.steps > 0)
    for point in points:
        assert np.abs(found.fractions - point).min() == 0.0


def test_neighbours_grow_no_faster_than_they_may() -> None:
    wanted = np.full(100, 0.02)
    wanted[50] = 1e-5
    steps = graded(Mesh.uniform(100), wanted, 1e-7, 10_000, np.array([])).steps
    ratio = steps[1:] / steps[:-1]
    assert max(ratio.max(), 1 / ratio.min()) < math.exp(GROWTH) * 1.05
    assert steps.min() == pytest.approx(1e-5, rel=0.2)
    assert steps.max() == pytest.approx(0.02, rel=0.05)


def test_many_cells_are_graded_within_little_memory() -> None:
    """A table of all cells over all places would take 25 GB."""
    wanted = np.full(20_000, 1e-3)
    wanted[7_000] = 1e-6
    tracemalloc.start()
    steps = graded(Mesh.uniform(20_000), wanted, 1e-7, 50_000, np.array([0.3])).steps
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 100e6
    assert steps.min() == pytest.approx(1e-6, rel=0.2)


def test_the_shortest_cell_is_bounded() -> None:
    wanted = np.full(50, 0.02)
    wanted[20] = 1e-12
    assert graded(Mesh.uniform(50), wanted, 1e-4, 10_000, np.array([])).steps.min() > 0.9e-4


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.05, 1.0), min_size=3, max_size=12))
def test_the_index_map_rises_and_has_no_corners(steps: list[float]) -> None:
    """û on a graded mesh with coefficients of a line in s is s(t) itself, away from the ends."""
    nodes = np.append(0.0, np.cumsum(np.array([0.5] * 9 + steps + [0.5] * 9)))
    mesh = Mesh(nodes / nodes[-1])
    basis = ControlBasis(GENERATING_FUNCTIONS["gaussian"], mesh.cells, 2.0, True).on(mesh)
    cells = np.repeat(np.arange(8, mesh.cells - 8), 21)
    offsets = np.tile(np.linspace(0, 1, 21), mesh.cells - 16)
    s = basis.evaluate(basis.centres[:, None], cells, offsets)[:, 0]
    assert np.all(np.diff(s) > -1e-7)  # the cut of ψ
    places = basis._index_offsets(cells, offsets)
    assert np.allclose(s, cells + places, atol=1e-6)
    h, d = mesh.steps, 1e-6
    inner = np.arange(8, mesh.cells - 9)
    left = (1 - basis._index_offsets(inner, np.full(len(inner), 1 - d))) / (d * h[inner])
    right = basis._index_offsets(inner + 1, np.full(len(inner), d)) / (d * h[inner + 1])
    assert np.allclose(left, right, rtol=1e-4)


def test_equal_steps_need_no_index_map() -> None:
    assert Mesh.uniform(30).index_slopes is None
    basis = ControlBasis(GENERATING_FUNCTIONS["hat"], 3, 1.0, True)
    assert basis.on(Mesh(np.array([0.0, 0.1, 0.4, 1.0]))).index_slopes is None  # linear in t


# --- jumps and kinks ------------------------------------------------------------------------------


def fitted(mesh: Mesh, u: Callable[[Array], Array]) -> tuple[ControlBasis, Array]:
    """A quasi-interpolant on equal cells with the values of u at its nodes for coefficients."""
    basis = ControlBasis(GENERATING_FUNCTIONS["gaussian"], mesh.cells, 2.0, True).on(mesh)
    return basis, u(basis.centres / mesh.cells)[:, None]


@settings(max_examples=50, deadline=None)
@given(st.floats(0.15, 0.85), st.floats(0.1, 2.0), st.booleans(), st.integers(60, 300))
def test_a_jump_is_found_where_it_is(at: float, height: float, down: bool, cells: int) -> None:
    sign = -1.0 if down else 1.0
    mesh = Mesh.uniform(cells)
    basis, c = fitted(mesh, lambda t: 0.3 * t + sign * height * (t > at))
    (found,) = junctions(basis, mesh, c, (0.0, 1.0), np.zeros(1))
    assert found.kind == "jump"
    assert abs(found.time - at) <= 1.0 / cells
    assert found.uncertainty <= 8.0 / cells
    assert found.after - found.before == pytest.approx(sign * height, abs=0.1 * height + 0.05)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.2, 0.8), st.floats(1.5, 10.0), st.integers(80, 300))
def test_a_kink_is_found_where_it_is(at: float, slope: float, cells: int) -> None:
    mesh = Mesh.uniform(cells)
    basis, c = fitted(mesh, lambda t: np.sin(t) + slope * np.maximum(t - at, 0.0))
    (found,) = junctions(basis, mesh, c, (0.0, 1.0), np.zeros(1))
    assert found.kind == "kink"
    assert abs(found.time - at) <= 3.0 / cells


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 6), st.floats(0.0, 6.3), st.floats(-2.0, 2.0), st.integers(60, 300))
def test_smooth_controls_have_neither(waves: int, phase: float, trend: float, cells: int) -> None:
    mesh = Mesh.uniform(10 * waves + cells)
    basis, c = fitted(mesh, lambda t: np.sin(2 * waves * t + phase) + trend * t)
    assert not junctions(basis, mesh, c, (0.0, 1.0), np.zeros(1))


def test_jumps_of_several_controls_have_their_own_times() -> None:
    solution = refined("siri")
    found = {solution.origin.controls[j.control].name: round(j.time, 3) for j in solution.junctions}
    assert found == {"u2": 2.083, "u1": 6.210, "u3": 7.431}


# --- the figures of the account -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "order", "moment"),
    [("gaussian", 2, 0.5), ("hat", 2, 1 / 6), ("sech", 2, math.pi**2 / 4)],
)
def test_leading_moments(name: str, order: int, moment: float) -> None:
    """∫x²e^(−x²)/√π = 1/2; ∫x²(1−|x|) = 1/6; ∫x² sech(x)/π = π²/4."""
    found = leading_moment(GENERATING_FUNCTIONS[name])
    assert found[0] == order
    assert found[1] == pytest.approx(moment, rel=1e-3)


@pytest.mark.parametrize(("scheme", "order"), [("euler", 1), ("trapezoidal", 2), ("rk4", 4)])
def test_local_errors_fall_with_their_order(scheme: str, order: int, lq: str) -> None:
    """Twice the cells, and each errs 2^(p+1) times less."""
    problem = load_text(lq, "lq.yaml")
    found = [
        local_errors(
            build(problem),
            quito.solve(problem, steps=n, tolerance=1e-12, discretization=scheme, substeps=1),
        )
        for n in (8, 16)
    ]
    inner = [errors[len(errors) // 4 : -len(errors) // 4].max() for errors in found]
    assert order + 0.5 < math.log2(inner[0] / inner[1]) < order + 2.5  # rk4 does better here


def test_shares_are_shares() -> None:
    rng = np.random.default_rng(1)
    middle = rng.normal(size=(40, 2))
    for share in (monitor._variation(middle), monitor._curvature(middle)):
        assert share.shape == (40,)
        assert share.sum() == pytest.approx(1.0)
        assert np.all(share >= 0)


def test_a_constant_control_asks_for_equal_cells() -> None:
    shares = monitor._variation(np.ones((20, 1))), monitor._curvature(np.ones((20, 1)))
    for share in shares:
        assert np.allclose(share, 1 / 20)
