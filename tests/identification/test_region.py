"""Where training data lie: rate, derived outputs, frequency bands; what identification writes of it."""

from __future__ import annotations

from dataclasses import replace

import local_networks
import numpy as np
import pytest
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from identification import n4sid
from identification.data_set import DataSet
from identification.linear import linear_parameter_set
from identification.network import RECOMMENDED, THESIS, signals_of
from identification.region import frequency_band, trained_region
from identification.tuning import tuned_network

TICK = 2e-3
ROWS = 40_000
FORCE = local_networks.FORCE
STIFFNESS = local_networks.CONTACT_STIFFNESS


def data_of(eta: list[float], xi: list[float], tick: float = TICK, **more: list[float]) -> DataSet:
    names = ("eta", "M_pa", "xi", *more)
    units = ("m", "N.m", "m", *("N" for _ in more))
    values = np.column_stack([eta, np.arange(len(eta), dtype=float), xi, *more.values()])
    return DataSet("some", tick, names, units, values)


def white(seed: int, rows: int = ROWS) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(rows)


def test_rate_and_force_are_the_extremes_of_all_data() -> None:
    first = data_of([1.0, 1.001, 1.0005], [1.002, 1.0015, 1.0])
    second = data_of([2.0, 1.996, 1.997, 1.998], [2.0, 2.001, 1.999, 1.9985])
    found = trained_region([first, second], ("eta", "M_pa"), "eta", TICK, [FORCE])
    assert found is not None
    assert found.rate == pytest.approx(2.0, rel=1e-12)  # 4 mm in 2 ms
    low, high = found.derived_outputs["F_p"]
    assert low == pytest.approx(-0.5e-3 * STIFFNESS, rel=1e-9)
    assert high == pytest.approx(5e-3 * STIFFNESS, rel=1e-9)
    assert found.frequency_bands == {}  # three rows tell no frequencies


def test_a_column_the_network_does_not_have_is_not_looked_at() -> None:
    eta, xi = [1.0, 1.0, 1.0], [1.0, 1.1, 1.2]
    found = trained_region([data_of(eta, xi, F_p=[30.0, 8e9, -20.0])], ("eta",), "eta", TICK, [FORCE])
    assert found == trained_region([data_of(eta, xi)], ("eta",), "eta", TICK, [FORCE])
    assert found is not None and found.rate == 0.0


def test_without_data_nothing_is_known() -> None:
    assert trained_region([], ("eta",), "eta", TICK) is None


@given(st.floats(1e-6, 0.1), st.sampled_from([1e-3, 2e-3, 1e-2, 1.0 / 60.0, 0.3]))
def test_the_data_themselves_are_never_too_fast(step: float, tick: float) -> None:
    eta = [1.0, 1.0 + step, 1.0]
    found = trained_region([data_of(eta, eta, tick)], ("eta",), "eta", tick)
    assert found is not None
    moves = np.abs(np.diff(eta))
    assert found.rate * tick >= moves.max()
    assert np.nextafter(found.rate, 0.0) * tick <= moves.max()


@pytest.mark.parametrize(("low", "high"), [(2.0, 20.0), (0.5, 5.0), (30.0, 90.0)])
def test_band_limited_noise_has_its_band(low: float, high: float) -> None:
    filtered = scipy.signal.butter(8, [low, high], "bandpass", fs=1.0 / TICK, output="sos")
    found = frequency_band(1.5 + 1e-3 * scipy.signal.sosfilt(filtered, white(3)), TICK)
    # 20 dB down, where the eighth-order filter is at 0.75 of its lower and 1.33 of its upper corner at most
    assert found is not None
    assert 0.7 * low < found[0] < low
    assert high < found[1] < 1.4 * high


def test_low_passed_noise_reaches_from_the_length_of_the_data_to_a_tenth_of_the_amplitude() -> None:
    pole = np.exp(-2.0 * np.pi * 10.0 * TICK)
    noise = scipy.signal.lfilter([1.0 - pole], [1.0, -pole], white(4))
    found = frequency_band(1.5 + noise, TICK)
    assert found is not None
    assert found[0] == pytest.approx(8.5 / (ROWS * TICK), rel=1e-3)
    assert 80.0 < found[1] < 150.0  # the amplitude of 1 / (1 + s / (2 pi 10 Hz)) is a tenth at 99.5 Hz


def test_a_torque_held_for_fifty_to_two_hundred_milliseconds() -> None:
    random = np.random.default_rng(5)
    steps = [np.full(random.integers(25, 101), random.uniform(-75.0, 75.0)) for _ in range(ROWS // 25)]
    found = frequency_band(1310.9 + np.concatenate(steps)[:ROWS], TICK)
    # holds of T give E(T^2 sinc^2(f T)), beyond 1/T about 1 / (2 pi^2 f^2): 1 % of E(T^2) at 17 Hz
    assert found is not None
    assert found[0] == pytest.approx(8.5 / (ROWS * TICK), rel=1e-3)
    assert 13.0 < found[1] < 22.0


def test_a_ramp_that_turns_hides_nothing_and_is_nothing() -> None:
    time = np.arange(ROWS) * TICK
    ramp = 1.5 + 0.9 * scipy.signal.sawtooth(2.0 * np.pi * time / 70.0, 0.5)
    filtered = scipy.signal.butter(8, [2.0, 20.0], "bandpass", fs=1.0 / TICK, output="sos")
    small = 1e-3 * scipy.signal.sosfilt(filtered, white(6))
    assert frequency_band(ramp + small, TICK) == pytest.approx(frequency_band(small, TICK), rel=0.1)
    for still in (ramp, np.full(ROWS, 1.3), 1.3 + 0.01 * time):
        assert frequency_band(still, TICK) is None


def test_an_input_that_stands_still_has_no_band_and_bands_of_several_data_are_one() -> None:
    slow, fast = (
        scipy.signal.sosfilt(scipy.signal.butter(8, edges, "bandpass", fs=500.0, output="sos"), white(7))
        for edges in ([1.0, 4.0], [10.0, 40.0])
    )
    sets = [data_of((1.5 + one).tolist(), np.zeros(ROWS).tolist()) for one in (slow, fast)]
    sets = [replace(one, values=one.values * [1.0, 0.0, 1.0] + [0.0, 7.0, 0.0]) for one in sets]
    found = trained_region(sets, ("eta", "M_pa"), "eta", TICK)
    assert found is not None
    assert list(found.frequency_bands) == ["eta"]
    low, high = found.frequency_bands["eta"]
    assert 0.7 < low < 1.0 and 40.0 < high < 55.0


def test_identification_writes_the_region_of_all_its_data_and_leaves_the_hash_alone() -> None:
    local = local_networks.local_models((0.8, 1.0, 1.1, 1.3))
    plain = n4sid.network("found", local, RECOMMENDED, [FORCE])
    assert plain.trained_region is None  # made by hand, without data
    data = local_networks.recorded(plain, 3)
    faster = replace(data, values=data.values[::3])
    trained = replace(local, training=(data,)).trained_on([faster])
    found = n4sid.network("found", trained, RECOMMENDED, [FORCE])
    region = trained_region([data, faster], ("eta", "M_pa"), "eta", found.sample_time, [FORCE])
    assert found.trained_region == region
    assert set(region.derived_outputs) == {"F_p"} and set(region.frequency_bands) == {"eta", "M_pa"}
    assert found.model_hash() == found.replaced(trained_region=None).model_hash()
    tuned = tuned_network("found", local, [data], THESIS.model_copy(update={"k_sigma": "tuned"}), [FORCE])
    alone = trained_region([data], ("eta", "M_pa"), "eta", found.sample_time, [FORCE])
    assert tuned.parameter_set.trained_region == alone


def test_a_linearisation_carries_the_region_of_the_data_its_limits_come_from() -> None:
    local = local_networks.local_models((1.0, 1.0, 1.0, 1.0))
    model = local.models[0]
    data = local_networks.recorded(n4sid.network("found", local, RECOMMENDED), 3)
    signals = signals_of(
        [data], model.inputs, model.outputs, local_networks.POINT, model.output_operating_point
    )
    found = linear_parameter_set(
        "linear", model, "eta", (0.5, 2.5), signals, [FORCE], training=[data]
    ).trained_region
    assert found == trained_region([data], ("eta", "M_pa"), "eta", model.sample_time, [FORCE])


@pytest.mark.parametrize("frequency", [3.0, 11.0, 40.0])
def test_the_highest_frequency_of_a_sine_lies_at_most_two_lines_too_high(frequency: float) -> None:
    """What docs/region.md promises: lines of 32.5 over the length."""
    seconds = 15.0
    found = frequency_band(np.sin(2.0 * np.pi * frequency * np.arange(0.0, seconds, TICK)), TICK)
    assert found is not None
    assert frequency <= found[1] <= frequency + 2.0 * 32.5 / seconds
    assert frequency - 2.0 * 8.5 / seconds <= found[0] <= frequency
