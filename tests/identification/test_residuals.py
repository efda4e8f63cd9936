"""Error bands of predictions, against what is known without them: gains, delays, noise of known size."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import local_networks as plants
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import identification.residuals
import tolerances
from fmu_builder.errors import DataError, IdentificationError, SettingsError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet, ResidualBands
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import whole_range_inputs
from identification.n4sid import network
from identification.network import AUTOMATIC
from identification.residuals import (
    ResidualSettings,
    counted_rows,
    inside,
    residual_bands,
    split,
    total_bound,
)

TS = 0.001
EDGES = (0.0, 1.0, 5.0, 15.0, 500.0)
TONES = np.array([0.75, 3.25, 11.0, 23.5])
"""One per band, each a line of segments of 4 s [Hz]."""


@pytest.fixture(scope="module")
def plant() -> ParameterSet:
    """Two inputs, four outputs and F_p; the same three masses at every height."""
    settings = AUTOMATIC.model_copy(
        update={"blending": "parameter", "validity": "hat", "coordinates": "aligned"}
    )
    return network("plant", plants.local_models((1.0,) * 4), settings, (plants.FORCE,))


def measured(plant: ParameterSet, inputs: DataSet) -> DataSet:
    """What the plant itself says, outputs and F_p as columns."""
    outputs = simulate(plant, inputs.matrix(plants.INPUTS))
    return inputs.with_columns(plant.output_names, ("m", "m/s", "m", "m/s", "N"), outputs)


@pytest.fixture(scope="module")
def data(plant: ParameterSet) -> DataSet:
    return measured(plant, whole_range_inputs(3, duration=60.0))


def with_force(data: DataSet, force: Array) -> DataSet:
    values = data.values.copy()
    values[:, data.names.index("F_p")] = force
    return replace(data, values=values)


def bands_of(plant: ParameterSet, *data: DataSet, **settings: object) -> ResidualBands:
    (found,) = residual_bands(plant, data, ResidualSettings.model_validate(settings))
    return found


def numbers(entries: object) -> Array:
    return np.array(entries, dtype=np.float64)


def test_a_perfect_model_is_off_by_nothing(plant: ParameterSet, data: DataSet) -> None:
    found = bands_of(plant, data)
    assert found.output == "F_p" and found.held_out == (data.name,)
    assert found.frequencies == EDGES and found.positions == (0.5, 1.0, 1.5, 2.0, 2.5)
    assert np.all(numbers(found.bound) == 0.0) and np.all(numbers(found.total) == 0.0)
    assert np.all(numbers(found.amplitude) == 1.0) and np.all(numbers(found.phase) == 0.0)
    assert sum(found.seconds) == pytest.approx(60.0 - 5.0, abs=0.02)
    assert plant.replaced(residual_bands=(found,)).residual_bands == (found,)


def test_a_known_gain_is_found_as_amplitude_and_as_error(plant: ParameterSet, data: DataSet) -> None:
    force = data.column("F_p")
    found = bands_of(plant, with_force(data, force / 0.8))
    assert np.abs(numbers(found.amplitude) - 0.8).max() < tolerances.FOUR_DIGITS
    assert np.abs(numbers(found.phase)).max() < tolerances.FOUR_DIGITS
    rows = counted_rows(len(force), TS)
    parts = split(0.25 * force, EDGES, TS)[rows]
    where = np.digitize(data.column("eta")[rows], found.positions) - 1
    for height in range(4):
        rms = np.sqrt(np.mean(parts[where == height] ** 2, axis=0))
        assert np.abs(numbers(found.rms)[height] / rms - 1.0).max() < tolerances.FOUR_DIGITS


def test_a_known_delay_is_found_as_phase_with_its_sign(plant: ParameterSet) -> None:
    """A force of one line per band; the reference runs ahead of the model by 7 ms."""
    plain = whole_range_inputs(3, duration=60.0, settings=plants_quiet())
    tones = 40.0 * np.sum(np.sin(2.0 * np.pi * np.outer(TONES, plain.time)), axis=0)
    values = plain.values.copy()
    values[:, 1] += tones
    data = measured(plant, replace(plain, values=values))
    found = bands_of(plant, with_force(data, np.roll(data.column("F_p"), -7)))
    for height in (1, 2):  # the turning point of the ramp, and the jump of what was rolled, lie elsewhere
        assert (
            np.abs(numbers(found.phase[height]) + 2.0 * np.pi * TONES * 0.007).max() < tolerances.TONE_PHASE
        )
        assert np.abs(numbers(found.amplitude[height]) - 1.0).max() < tolerances.TONE_PHASE


def plants_quiet() -> plants.ExcitationSettings:
    return plants.ExcitationSettings(noise_rms=0.0, torque_amplitude=0.0)


def test_white_noise_of_known_size_fills_every_band_by_its_share(plant: ParameterSet) -> None:
    """The bound is 1.96 sigma times the root of the noise's share in the band, by Butterworth's formula."""
    sigma = 3.0
    data = measured(plant, whole_range_inputs(5, duration=240.0))
    noise = sigma * np.random.default_rng(11).standard_normal(len(data))
    found = bands_of(plant, with_force(data, data.column("F_p") - noise), heights=1)
    lines = np.linspace(0.0, 500.0, 200_001)[1:-1]
    lows = [1.0 / (1.0 + (np.tan(np.pi * lines * TS) / np.tan(np.pi * f * TS)) ** 8) for f in EDGES[1:-1]]
    weights = np.diff([np.zeros_like(lines), *lows, np.ones_like(lines)], axis=0)
    shares = np.sqrt(np.mean(weights**2, axis=1))
    assert found.total[0] == pytest.approx(1.959964 * sigma, rel=tolerances.NOISE_QUANTILE[-1])
    for index, scatter in enumerate(tolerances.NOISE_QUANTILE[:-1]):
        assert found.bound[0][index] == pytest.approx(1.959964 * sigma * shares[index], rel=scatter)
        assert found.rms[0][index] == pytest.approx(sigma * shares[index], rel=scatter)


@given(st.integers(0, 2**31), st.integers(1, 3000), st.lists(st.floats(0.3, 400.0), max_size=4, unique=True))
def test_bands_add_up(seed: int, rows: int, edges: list[float]) -> None:
    signal = 1e3 * np.random.default_rng(seed).standard_normal(rows)
    parts = split(signal, (0.0, *sorted(edges), 500.0), TS)
    assert parts.shape == (rows, len(edges) + 1)
    assert np.abs(parts.sum(axis=1) - signal).max() < tolerances.BANDS_ADD_UP * max(1.0, np.abs(parts).max())


def test_a_tone_stays_where_it_is_in_time() -> None:
    time = np.arange(20_000) * TS
    tone = np.sin(2.0 * np.pi * 2.3 * time + 0.4)
    parts = split(tone, EDGES, TS)[5000:-5000]
    expected = 1.0 / (1.0 + (2.3 / 5.0) ** 8) - 1.0 / (1.0 + 2.3**8)
    assert np.abs(parts[:, 1] - expected * tone[5000:-5000]).max() < tolerances.TONE_SHARE


def test_heights_without_data_tell_nothing(plant: ParameterSet) -> None:
    data = measured(plant, whole_range_inputs(3, duration=40.0, low=0.6, high=1.4))
    found = bands_of(plant, data)
    assert found.seconds[2:] == (0.0, 0.0) and found.total[2:] == (None, None)
    for entries in (found.rms, found.bound, found.amplitude, found.phase):
        assert entries[2:] == ((None,) * 4,) * 2 and None not in entries[0] + entries[1]


def test_a_reference_at_rest_has_no_amplitude_to_match(plant: ParameterSet, data: DataSet) -> None:
    found = bands_of(plant, with_force(data, np.full(len(data), 70.1)))
    assert {value for entries in (*found.amplitude, *found.phase) for value in entries} == {None}
    assert None not in found.total


@pytest.mark.parametrize("rows", [1, 2, 50, 3000])
def test_short_data_tell_what_they_can(plant: ParameterSet, data: DataSet, rows: int) -> None:
    found = bands_of(plant, data.rows(0, rows))
    assert all(value is None for row in found.amplitude for value in row)
    told = [value is not None for value in found.total]
    assert told == [rows == 3000, False, False, False]
    assert plant.replaced(residual_bands=(found,)).residual_bands


def test_segments_that_cross_heights_tell_nothing_of_amplitude_and_phase(plant: ParameterSet) -> None:
    data = measured(plant, whole_range_inputs(3, duration=20.0))  # 0.18 m/s, ranges of 0.5 m
    lowest, *others = bands_of(plant, data, segment=1.0).amplitude[1]
    assert lowest is None and None not in others  # no line of one second lies below 1 Hz but its mean
    found = bands_of(plant, data)  # 4 s move 0.7 m, but where the ramp turns
    assert found.amplitude[1:3] == found.phase[1:3] == ((None,) * 4,) * 2
    assert None not in found.total


def test_a_segment_longer_than_any_record_tells_nothing(plant: ParameterSet, data: DataSet) -> None:
    found = bands_of(plant, data, segment=1e12)  # whose lines fit into no memory
    assert np.isnan(numbers(found.amplitude)).all() and np.isfinite(numbers(found.bound)).all()


def test_several_records_count_by_their_length(plant: ParameterSet, data: DataSet) -> None:
    force = data.column("F_p")
    off = [with_force(replace(data, name=str(size)), force + size) for size in (2.0, 1.0, 1.0)]
    found = bands_of(plant, *off, frequencies=(), coverage=0.6)
    assert found.total == (1.0,) * 4 and found.held_out == ("2.0", "1.0", "1.0")
    assert found.rms[0][0] == pytest.approx(math.sqrt(2.0), rel=tolerances.FOUR_DIGITS)
    assert bands_of(plant, *off, frequencies=(), coverage=0.7).total == (2.0,) * 4


def test_a_bound_stays_one_when_it_is_rounded(plant: ParameterSet, data: DataSet) -> None:
    force = data.column("F_p")
    error = np.random.default_rng(2).standard_normal(len(data)) * (1.0 + data.column("eta"))
    noisy = with_force(data, force - error)
    found = bands_of(plant, noisy)
    shares = inside(found, TS, data.column("eta"), force - error, force)
    assert shares.whole >= 0.95 and np.all(shares.total >= 0.95) and np.all(shares.bands >= 0.95)
    assert shares.whole < 0.951 and np.all(shares.bands < 0.953)
    limit = total_bound(found, np.array([0.5, 1.2, 2.5, 2.6]))
    assert limit[:3].tolist() == [found.total[0], found.total[1], found.total[3]] and np.isnan(limit[3])
    other = inside(found, TS, data.column("eta"), force - 2.0 * error, force)
    assert other.whole < 0.8


def test_what_lies_beyond_the_range_is_judged_by_nobody(plant: ParameterSet, data: DataSet) -> None:
    found = bands_of(plant, data)
    shares = inside(found, TS, data.column("eta") + 10.0, data.column("F_p"), data.column("F_p"))
    assert np.isnan(shares.whole) and np.isnan(shares.total).all() and np.all(shares.seconds == 0.0)


def test_frequencies_beyond_nyquist_are_left_out(plant: ParameterSet, data: DataSet) -> None:
    slow = plant.replaced(sample_time=0.05)
    found = bands_of(slow, replace(data, sample_time=0.05))
    assert found.frequencies == (0.0, 1.0, 5.0, 10.0)


@pytest.mark.parametrize(("sample_time", "shown"), [(0.05, 3), (0.2, 2), (1.0, 1)])
def test_data_sampled_slowly_are_judged_up_to_what_they_show(
    plant: ParameterSet, data: DataSet, sample_time: float, shown: int
) -> None:
    """Nyquist at 10 Hz, 2.5 Hz and 0.5 Hz below edges at 1, 5 and 15 Hz."""
    error = np.random.default_rng(2).normal(0.0, 1.0, len(data))
    found = bands_of(plant, with_force(data, data.column("F_p") + error))
    assert found.frequencies == EDGES
    rows = slice(None, None, round(sample_time / TS))
    force = data.column("F_p")[rows]
    shares = inside(found, sample_time, data.column("eta")[rows], force + error[rows], force)
    assert 0.85 < shares.whole <= 1.0
    assert np.all(np.isnan(shares.bands[:, shown:]))
    heights = np.isfinite(shares.total)
    assert heights.any() and np.all(np.isfinite(shares.bands[heights, :shown]))


def test_the_bands_are_small_in_a_file(plant: ParameterSet) -> None:
    data = measured(plant, whole_range_inputs(7))
    noisy = with_force(data, data.column("F_p") * 1.0371 + np.sin(data.time))
    text = json.dumps(bands_of(plant, noisy).model_dump(), separators=(",", ":"))
    assert len(text) < 1500


def test_what_is_wanted_is_computed_where_it_was_not_recorded(plant: ParameterSet, data: DataSet) -> None:
    bare = data.select(name for name in data.names if name != "F_p")
    assert bands_of(plant, bare).total == (0.0,) * 4
    with pytest.raises(DataError, match="'xi'"):
        bands_of(plant, bare.select(name for name in bare.names if name != "xi"))
    chosen = residual_bands(plant, [data], ResidualSettings(outputs=("zeta", "xi")))
    assert [one.output for one in chosen] == ["zeta", "xi"]
    without = plant.replaced(derived_outputs=())
    assert [one.output for one in residual_bands(without, [data])] == ["xi", "xi_dot", "zeta", "zeta_dot"]


def test_what_makes_no_sense_is_refused(
    plant: ParameterSet, data: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(DataError, match="there are none"):
        residual_bands(plant, [])
    with pytest.raises(SettingsError, match="nobody"):
        bands_of(plant, data, outputs=("nobody",))
    with pytest.raises(DataError, match="sample time"):
        bands_of(plant, replace(data, sample_time=0.002))
    edges: tuple[tuple[float, ...], ...] = ((5.0, 1.0), (0.0,), (1e-300, 15.0))
    for wrong in (*({"frequencies": one} for one in edges), {"coverage": 1.0}, {"heights": 0}):
        with pytest.raises(ValidationError):
            ResidualSettings.model_validate(wrong)
    with pytest.raises(DataError, match="not finite"):
        with_force(data, np.full(len(data), np.nan))
    monkeypatch.setattr(identification.residuals, "simulate", lambda *_: np.full((len(data), 5), np.inf))
    with pytest.raises(IdentificationError, match="runs away"):
        bands_of(plant, data)
