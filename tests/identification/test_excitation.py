from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.signal import welch

from fmu_builder.errors import DataError
from identification.arrays import Array
from identification.excitation import (
    ACCEPTANCE,
    ExcitationSettings,
    aprbs,
    filtered_noise,
    operating_point_inputs,
    random_stream,
    whole_range_inputs,
    with_measurement_noise,
)
from tolerances import HALF_POWER, LEVEL_SPREAD, RMS_SCALING


def holds_of(sequence: Array) -> NDArray[np.int64]:
    changes = np.flatnonzero(np.diff(sequence)) + 1
    return np.diff(np.concatenate([[0], changes, [len(sequence)]]))


@pytest.mark.parametrize("rms", [0.0012, 3.0])
def test_rms_of_the_filtered_noise_is_exact(rms: float) -> None:
    noise = filtered_noise(random_stream(5), 42_000, 0.001, 10.0, rms)
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(rms, rel=RMS_SCALING)
    assert noise.shape == (42_000,)


@pytest.mark.parametrize("corner", [10.0, 4.0])
def test_power_is_halved_at_the_corner_and_falls_by_20_db_per_decade(corner: float) -> None:
    noise = filtered_noise(random_stream(6), 2_000_000, 0.001, corner, 1.0)
    frequency, power = welch(noise, 1000.0, nperseg=16384)
    flat = power[(frequency > 0.1) & (frequency < 0.2 * corner)].mean()
    band = (frequency > 0.9 * corner) & (frequency < 1.1 * corner)
    expected = np.mean(1.0 / (1.0 + (frequency[band] / corner) ** 2))
    assert power[band].mean() / flat == pytest.approx(expected, rel=2 * HALF_POWER)
    assert expected == pytest.approx(0.5, rel=HALF_POWER)
    high = (frequency > 9 * corner) & (frequency < 11 * corner)
    assert power[high].mean() / flat == pytest.approx(0.01, rel=0.1)


def test_noise_has_settled_before_the_first_sample() -> None:
    starts = [filtered_noise(random_stream(seed), 2000, 0.001, 10.0, 1.0)[0] for seed in range(300)]
    assert np.std(starts) == pytest.approx(1.0, rel=0.15)


def test_no_noise_asked_for() -> None:
    assert not filtered_noise(random_stream(1), 10, 0.001, 10.0, 0.0).any()


def test_aprbs_levels_and_hold_times() -> None:
    sequence = aprbs(random_stream(7), 400_000, 0.001, 75.0, 0.05, 0.2)
    holds = holds_of(sequence)[:-1]
    assert (holds.min(), holds.max()) == (50, 200)
    assert holds.mean() == pytest.approx(125.0, rel=LEVEL_SPREAD)
    assert np.abs(sequence).max() <= 75.0
    levels = sequence[np.cumsum(holds) - 1]
    assert levels.std() == pytest.approx(75.0 / np.sqrt(3.0), rel=LEVEL_SPREAD)
    assert abs(levels.mean()) < 3.0
    assert np.histogram(levels, 10, (-75.0, 75.0))[0].min() > 0.8 * levels.size / 10


def test_aprbs_of_another_sample_time() -> None:
    holds = holds_of(aprbs(random_stream(8), 5000, 0.02, 1.0, 0.06, 0.1))[:-1]
    assert set(holds) == {3, 4, 5}


def test_operating_point_recipe() -> None:
    data = operating_point_inputs(1.75, 3)
    assert data.names == ("eta", "M_pa") and data.units == ("m", "N.m") and len(data) == 42_000
    assert data.sample_time == 0.001
    deviation = data.column("eta") - 1.75
    assert np.sqrt(np.mean(deviation**2)) == pytest.approx(0.0012, rel=1e-9)
    torque = data.column("M_pa") - 1310.9
    assert 70.0 < np.abs(torque).max() <= 75.0
    assert data.header["excitation"] == ACCEPTANCE.model_dump() and data.header["seed"] == 3


def test_whole_range_goes_up_and_down_without_steps() -> None:
    data = whole_range_inputs(3)
    eta = data.column("eta")
    assert len(data) == 120_000
    path = whole_range_inputs(3, settings=ExcitationSettings(noise_rms=0.0)).column("eta")
    assert (path[0], path[60_000], path.min(), path.max()) == (0.6, 2.4, 0.6, 2.4)
    assert np.abs(np.diff(path)).max() < 3.1e-5
    assert np.all(np.diff(path[:60_001]) > 0) and np.all(np.diff(path[60_000:]) < 0)
    assert np.sqrt(np.mean((eta - path) ** 2)) == pytest.approx(0.0012, rel=1e-9)
    assert eta.min() > 0.59 and eta.max() < 2.41


@pytest.mark.parametrize("slew_rate", [0.02, 0.05, 0.37])
def test_a_slew_rate_is_kept_all_the_way_and_turns_at_the_ends(slew_rate: float) -> None:
    still = ExcitationSettings(noise_rms=0.0)
    path = whole_range_inputs(3, (), 40.0, 0.7, 1.9, still, slew_rate=slew_rate).column("eta")
    travelled = np.arange(len(path)) * still.sample_time * slew_rate
    assert path[0] == 0.7 and path.min() >= 0.7 and path.max() <= 1.9
    unfolded = np.arccos(np.cos(np.pi * travelled / 1.2)) / np.pi  # an independent triangle of period 2.4 m
    assert np.allclose(path, 0.7 + 1.2 * unfolded, rtol=0.0, atol=1e-6)


def test_the_noise_is_the_same_at_every_slew_rate() -> None:
    still = ExcitationSettings(noise_rms=0.0)
    first, second = (
        whole_range_inputs(3, (2,), 10.0, slew_rate=rate).column("eta")
        - whole_range_inputs(3, (2,), 10.0, settings=still, slew_rate=rate).column("eta")
        for rate in (0.03, 0.2)
    )
    assert np.allclose(first, second, rtol=0.0, atol=1e-12) and np.std(first) > 1e-3


def test_a_slew_rate_that_makes_no_sense_is_refused() -> None:
    for wrong in (0.0, -0.1, float("nan"), float("inf"), 1800.0):
        with pytest.raises(DataError, match="slew rate"):
            whole_range_inputs(3, duration=1.0, slew_rate=wrong)


def test_same_seed_same_bits_other_seed_or_stream_independent() -> None:
    first = operating_point_inputs(1.0, 3, (0, 1), 10.0)
    again = operating_point_inputs(1.0, 3, (0, 1), 10.0)
    assert first.values.tobytes() == again.values.tobytes()
    others = [
        operating_point_inputs(1.0, 4, (0, 1), 10.0),
        operating_point_inputs(1.0, 3, (0, 2), 10.0),
        operating_point_inputs(1.0, 3, (1, 1), 10.0),
        operating_point_inputs(1.0, 3, (), 10.0),
    ]
    for other in others:
        for name in ("eta", "M_pa"):
            correlation = np.corrcoef(first.column(name), other.column(name))[0, 1]
            assert abs(correlation) < 0.35
            assert not np.any(np.diff(first.column(name)) == np.diff(other.column(name))) or name == "M_pa"


def test_settings_are_refused_where_they_make_no_sense() -> None:
    for wrong in (
        {"hold_maximum": 0.01},
        {"corner_frequency": 500.0},
        {"noise_rms": -1.0},
        {"nois_rms": 1.0},
    ):
        with pytest.raises(ValidationError):
            ExcitationSettings(**wrong)
    with pytest.raises(DataError, match="duration"):
        operating_point_inputs(1.0, 1, duration=0.0)


def test_measurement_noise_only_where_asked() -> None:
    clean = operating_point_inputs(1.0, 3, duration=10.0)
    noisy = with_measurement_noise(clean, {"eta": 0.5}, 9)
    assert (noisy.column("eta") - clean.column("eta")).std() == pytest.approx(0.5, rel=0.05)
    assert np.array_equal(noisy.column("M_pa"), clean.column("M_pa"))
    assert noisy.header["measurement_noise"]["eta"] == 0.5
    with pytest.raises(DataError, match="xi"):
        with_measurement_noise(clean, {"xi": 0.5}, 9)
