"""Peaks of spectra: damped sinusoids whose transform is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from identification.resonances import amplitudes, highest_peak, spread

SAMPLE_TIME, SAMPLES = 0.002, 8192
BIN = 1.0 / (SAMPLES * SAMPLE_TIME)


def damped(frequency: float, damping: float) -> np.ndarray:
    """exp(-d w t) sin(w_d t), decayed at the end of the record."""
    t, w = np.arange(SAMPLES) * SAMPLE_TIME, 2.0 * np.pi * frequency
    return np.exp(-damping * w * t) * np.sin(w * np.sqrt(1.0 - damping**2) * t)


@pytest.mark.parametrize(("frequency", "damping"), [(3.3, 0.07), (12.1, 0.03), (22.4, 0.15)])
def test_a_damped_sinusoid_peaks_at_w_sqrt_1_minus_2_d2(frequency: float, damping: float) -> None:
    found = highest_peak(amplitudes(damped(frequency, damping)), BIN, (0.5, 40.0))
    assert found is not None
    assert abs(found - frequency * np.sqrt(1.0 - 2.0 * damping**2)) < BIN


def test_the_highest_peak_of_its_own_band_counts_and_small_ones_do_not() -> None:
    spectrum = amplitudes(5.0 * damped(3.3, 0.02) + damped(4.8, 0.02) + 0.04 * damped(12.0, 0.02))
    assert highest_peak(spectrum, BIN, (2.0, 6.0)) == pytest.approx(3.3, abs=BIN)
    assert highest_peak(spectrum, BIN, (4.0, 6.0)) == pytest.approx(4.8, abs=BIN)
    assert highest_peak(spectrum, BIN, (8.0, 16.0)) is None
    # it sits on the slope of the others, which moves it by a bin or two
    assert highest_peak(spectrum, BIN, (8.0, 16.0), prominence=1e-5) == pytest.approx(12.0, abs=3 * BIN)


def test_a_large_mean_hides_peaks() -> None:
    values = damped(3.3, 0.02)
    assert highest_peak(amplitudes(values + 100.0), BIN, (2.0, 6.0)) is None


def test_statistics_are_those_of_the_table() -> None:
    found = spread([3.1, 3.3, 3.2, 3.3, 3.1, 3.6])
    assert found is not None
    assert (found.min, found.max, found.mode) == (3.1, 3.6, 3.1)
    assert (found.mean, found.median) == pytest.approx((3.2666666666666666, 3.25))
    lonely = spread([3.1, 3.2])
    assert lonely is not None and lonely.mode is None
    assert spread([]) is None
