"""The height from modes: analytic mode paths, records of known scatter, and where it cannot work."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from fmu_builder.errors import DataError, IdentificationError
from identification.height import ModeTable, height_from_modes
from tolerances import FREQUENCY_SCATTER, HEIGHT_SCATTER, SPLINE_HEIGHT

HEIGHTS = np.linspace(0.4, 2.2, 31)
DURATION = 20.0
TURN = 1.0


def paths(heights: np.ndarray) -> np.ndarray:
    """Three modes: one rises, one turns round at `TURN`, one stands still."""
    h = np.asarray(heights)
    return np.stack([3.0 + 0.3 * h**2, 12.0 - (h - TURN) ** 2, 22.0 + 0.0 * h], axis=-1)


TABLE = ModeTable(HEIGHTS, paths(HEIGHTS), np.tile((0.05, 0.03, 0.02), (HEIGHTS.size, 1)))


@given(st.floats(0.4, 2.2))
def test_the_height_of_exact_modes_is_found(height: float) -> None:
    found = height_from_modes(TABLE, paths(np.array(height)), DURATION)
    assert abs(found.height - height) < SPLINE_HEIGHT
    assert found.cost < SPLINE_HEIGHT


def test_a_mode_that_turns_round_gives_two_heights_and_another_mode_decides() -> None:
    exact = paths(np.array(0.7))
    alone = height_from_modes(TABLE, np.array([np.nan, exact[1], np.nan]), DURATION)
    assert np.allclose(sorted((alone.height, *alone.others)), (0.7, 2 * TURN - 0.7), atol=1e-5)
    both = height_from_modes(TABLE, np.array([exact[0], exact[1], np.nan]), 42.0 * DURATION)
    assert both.others == () and abs(both.height - 0.7) < SPLINE_HEIGHT


def test_a_mode_that_stands_still_tells_nothing() -> None:
    still = np.array([False, False, True])
    assert np.all(TABLE.height_deviations(HEIGHTS, DURATION, still) > 1e6)
    moving = TABLE.height_deviations(np.array([1.7]), DURATION, ~still)
    assert moving == pytest.approx(TABLE.height_deviations(np.array([1.7]), DURATION))


def test_the_scatter_of_the_height_is_the_one_foretold() -> None:
    random, truth = np.random.default_rng(5), 1.7
    sigma = np.sqrt(np.array([0.05, 0.03, 0.02]) * paths(np.array(truth)) / (2.0 * np.pi * 500.0))
    found = [
        height_from_modes(TABLE, paths(np.array(truth)) + sigma * random.standard_normal(3), 500.0)
        for _ in range(400)
    ]
    scatter = np.std([one.height for one in found])
    slope = np.array([0.6 * truth, -2.0 * (truth - TURN), 0.0])
    expected = 1.0 / np.sqrt(np.sum((slope / sigma) ** 2))
    assert scatter == pytest.approx(expected, rel=HEIGHT_SCATTER)
    assert found[0].deviation == pytest.approx(expected, rel=HEIGHT_SCATTER)


def test_identified_frequencies_scatter_as_foretold() -> None:
    """Second-order autoregressions, fitted by least squares to what they made of white noise."""
    sample_time, samples, frequency, damping = 0.01, 4000, 3.2, 0.05
    size = 2.0 * np.pi * frequency * sample_time
    pole = np.exp(size * (-damping + 1j * np.sqrt(1.0 - damping**2)))
    random, found = np.random.default_rng(7), []
    for _ in range(400):
        y = lfilter([1.0], np.poly([pole, pole.conj()]).real, random.standard_normal(samples + 500))[500:]
        past = np.column_stack([y[1:-1], y[:-2]])
        fitted = np.roots(np.r_[1.0, -np.linalg.lstsq(past, y[2:], rcond=None)[0]])
        found.append(abs(np.log(fitted[np.argmax(fitted.imag)])) / (2.0 * np.pi * sample_time))
    heights = np.linspace(0.5, 2.5, 5)
    table = ModeTable(heights, np.full((5, 1), frequency), np.full((5, 1), damping))
    (expected,) = table.deviations_at(np.array([1.0]), samples * sample_time)[0]
    assert np.std(found) == pytest.approx(expected, rel=FREQUENCY_SCATTER)


def test_modes_are_named_by_their_range_and_the_least_damped_counts() -> None:
    def pole(frequency: float, damping: float) -> complex:
        s = 2.0 * np.pi * frequency * (-damping + 1j * np.sqrt(1.0 - damping**2))
        return complex(np.exp(0.001 * s))

    poles = [pole(11.5, 0.02), pole(3.4, 0.05), pole(12.5, 0.3), pole(60.0, 0.01), 0.9 + 0.0j]
    both = np.array([*poles, *np.conj(poles)])
    named = TABLE.named(both, 0.001)
    assert named[:2] == pytest.approx((3.4, 11.5)) and np.isnan(named[2])


def test_modes_beyond_the_table_are_told() -> None:
    assert height_from_modes(TABLE, np.array([6.0, 10.0, 22.0]), DURATION).at_end
    assert not height_from_modes(TABLE, paths(np.array(1.2)), DURATION).at_end


@pytest.mark.parametrize(
    ("frequencies", "duration"), [((3.0, 12.0), 1.0), ((np.nan,) * 3, 1.0), ((3.0, 12.0, 22.0), 0.0)]
)
def test_what_cannot_be_compared_is_refused(frequencies: tuple[float, ...], duration: float) -> None:
    with pytest.raises(IdentificationError, match="one of them finite"):
        height_from_modes(TABLE, np.array(frequencies), duration)


def test_a_table_that_contradicts_itself_is_refused_with_all_problems() -> None:
    crossed = paths(HEIGHTS)[:, ::-1]
    with pytest.raises(DataError) as caught:
        ModeTable(HEIGHTS[::-1], crossed, np.full(crossed.shape, 0.1))
    assert [problem.place for problem in caught.value.problems] == ["heights", "modes"]
    with pytest.raises(DataError, match="between 0 and 1"):
        ModeTable(HEIGHTS, paths(HEIGHTS), np.full(crossed.shape, 1.0))
    with pytest.raises(DataError, match="one row for each"):
        ModeTable(HEIGHTS, paths(HEIGHTS)[1:], np.full((30, 3), 0.1))
