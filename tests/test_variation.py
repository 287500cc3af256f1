"""Total variation and the ringing index, on signals whose values are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from quito_cli.solution.variation import FLOOR, ringing_index, total_variation

Array = NDArray[np.float64]
WIDTH, CELLS = 4, 400
T = np.linspace(0, 1, CELLS * WIDTH, endpoint=False)
SMOOTH = np.sin(5 * T)
STEP = np.where(T < 0.37, -1.0, np.where(T < 0.72, 1.0, 0.2 * np.cos(4 * T)))


def noise(amplitude: float) -> Array:
    """Up and down from cell to cell."""
    return amplitude * np.repeat((-1.0) ** np.arange(CELLS), WIDTH)


# Total variation


def test_total_variation_of_a_monotone_control_is_its_rise() -> None:
    samples = np.column_stack([np.linspace(-1, 3, 50) ** 3, np.full(50, 2.0)])
    assert total_variation(samples) == pytest.approx([28, 0], abs=1e-12)


def test_total_variation_of_waves_and_jumps() -> None:
    t = np.linspace(0, 4 * np.pi, 4001)
    samples = np.column_stack([np.cos(t), np.sign(np.sin(t[:] + 0.1))])
    assert total_variation(samples) == pytest.approx([8, 8], abs=1e-5)


def test_total_variation_of_nothing() -> None:
    assert total_variation(np.zeros((1, 3))).tolist() == [0, 0, 0]
    assert total_variation(np.zeros((5, 0))).shape == (0,)


# Ringing


@pytest.mark.parametrize("samples", [np.full(400, 0.3), np.zeros(1), np.zeros(2)])
def test_a_constant_does_not_ring(samples: Array) -> None:
    assert ringing_index(samples, WIDTH) == 0


@pytest.mark.parametrize("samples", [SMOOTH, T, T**2, np.exp(-3 * T), STEP, np.sign(T - 0.4)])
def test_a_control_that_is_smooth_between_its_jumps_stays_at_about_one(samples: Array) -> None:
    assert ringing_index(samples, WIDTH) <= 1.2
    assert ringing_index(samples, WIDTH, samples) <= 1.2


@pytest.mark.parametrize("true", [SMOOTH, STEP])
def test_ringing_is_seen_with_and_without_a_reference(true: Array) -> None:
    rung = true + noise(0.05)
    assert ringing_index(rung, WIDTH) > 50
    assert ringing_index(rung, WIDTH, true) > 50


def test_the_index_grows_with_the_square_of_the_amplitude() -> None:
    small, large = (ringing_index(SMOOTH + noise(a), WIDTH, SMOOTH) for a in (0.01, 0.02))
    assert large / small == pytest.approx(4, rel=0.1)


def test_the_index_does_not_depend_on_unit_or_offset() -> None:
    rung = STEP + noise(0.01)
    here, there = ringing_index(rung, WIDTH), ringing_index(1e6 * rung - 3e5, WIDTH)
    assert there == pytest.approx(here, rel=1e-6)


def test_the_energy_is_that_of_second_differences() -> None:
    """Without jumps, with a reference: by the definition, in two lines."""
    rung = SMOOTH + 0.01 * np.random.default_rng(0).normal(size=len(T))
    floor = (len(T) - 2) * (FLOOR * np.ptp(rung)) ** 2
    energy = [float(np.sum((a[2:] - 2 * a[1:-1] + a[:-2]) ** 2)) for a in (rung, SMOOTH)]
    assert ringing_index(rung, WIDTH, SMOOTH) == pytest.approx(energy[0] / max(energy[1], floor))


def test_what_nobody_sees_is_no_ringing() -> None:
    line = T + 1e-5 * np.repeat((-1.0) ** np.arange(CELLS), WIDTH)
    assert ringing_index(line, WIDTH, T) <= 1.2


@pytest.mark.parametrize("true", [1.0, -40.0])
@pytest.mark.parametrize("known", [True, False])
def test_the_noise_of_a_constant_is_no_ringing_but_waves_that_are_seen_are(
    true: float, known: bool
) -> None:
    constant = np.full(len(T), true)
    reference = constant if known else None
    for amplitude in (1e-9, 1e-7, 5e-6):
        quiet = constant + noise(amplitude * abs(true))
        assert ringing_index(quiet, WIDTH, reference, 2 * abs(true)) <= 1.2
    assert ringing_index(constant + noise(0.01 * abs(true)), WIDTH, reference) > 100


def test_the_noise_of_a_zero_control_is_no_ringing_within_its_bounds() -> None:
    zero = np.zeros(len(T))
    assert ringing_index(noise(5e-9), WIDTH, zero, 1.0) <= 1.2
    assert ringing_index(noise(5e-8), WIDTH, zero, 1.0) <= 1.2
    assert ringing_index(noise(1e-2), WIDTH, zero, 1.0) > 100
    ends = zero.copy()
    ends[::4], ends[16:] = 5e-6, 0.0
    assert ringing_index(ends, WIDTH, None, 1.0) <= 1.2, "noise at an end stays an end"
    assert ringing_index(0.5 + noise(0.1), WIDTH, 0.5 + zero, 1e3) > 100


def test_a_jump_of_the_reference_is_left_out_and_beside_it_nothing_is() -> None:
    near, far = STEP.copy(), STEP.copy()
    jump = int(np.argmax(T >= 0.37))
    near[jump - 2 : jump + 2] += [0.3, -0.3, 0.3, -0.3]
    far[jump + 60 : jump + 64] += [0.3, -0.3, 0.3, -0.3]
    assert ringing_index(near, WIDTH, STEP) <= 1.2
    assert ringing_index(far, WIDTH, STEP) > 100


@pytest.mark.parametrize("cells", [20, 40, 100])
def test_ringing_is_seen_on_coarse_meshes_too(cells: int) -> None:
    """A ramp over all cells has no jump to be left out: 5 % up and down on it is ringing."""
    ramp = np.linspace(0, 1, cells * WIDTH)
    rung = ramp + 0.05 * np.repeat((-1.0) ** np.arange(cells), WIDTH)
    assert ringing_index(rung, WIDTH, ramp) > 50


@pytest.mark.parametrize("points", [1, 2, 3, 5, 17])
@pytest.mark.parametrize("width", [1, 2, 4])
def test_few_points_give_a_number(points: int, width: int) -> None:
    samples = np.random.default_rng(points).normal(size=points)
    assert np.isfinite(ringing_index(samples, width))
    assert np.isfinite(ringing_index(samples, width, np.zeros(points)))
