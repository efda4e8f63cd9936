"""The step responses of the nonlinear model have the resonances of the reference tables."""

from __future__ import annotations

import functools

import pytest
from reference import resonances

import tolerances
from fmus.wbm import parameter_sets

CELLS = [(name, *cell) for name, table in resonances.EXPECTED.items() for cell in table]


@functools.cache
def found(name: str) -> dict[tuple[str, str], list[float]]:
    return resonances.step_resonances(parameter_sets()[name])


@pytest.mark.parametrize(("name", "band", "signal"), CELLS)
def test_resonances_within_one_bin(name: str, band: str, signal: str) -> None:
    frequencies = found(name)[band, signal]
    assert len(frequencies) == len(resonances.HEIGHTS)
    computed = resonances.statistics(frequencies)
    expected = resonances.EXPECTED[name][band, signal]
    errors = [abs(a - b) for a, b in zip(computed, expected, strict=True)]
    assert max(errors) < resonances.BIN, (computed, expected)
    # the tables have three digits, two where the band is narrow: all but the rounding is reproduced
    assert max(errors) < tolerances.RESONANCE_DIGITS, (computed, expected)


@pytest.mark.parametrize(("name", "band", "signal"), sorted(resonances.WITHOUT_PEAK))
def test_where_the_reference_has_no_peak_there_is_none(name: str, band: str, signal: str) -> None:
    assert found(name)[band, signal] == []


@pytest.mark.parametrize(("name", "band", "signal"), sorted(resonances.FOUND))
def test_contact_force_shows_the_highest_mode_in_every_step(name: str, band: str, signal: str) -> None:
    assert len(found(name)[band, signal]) == len(resonances.HEIGHTS)
    if name == "A":
        low, high, *_ = resonances.statistics(found(name)[band, signal])
        assert max(abs(low - 20.81), abs(high - 24.17)) < resonances.BIN


@pytest.mark.parametrize("name", list(resonances.EXPECTED))
def test_positions_have_no_peaks_but_one_known_case(name: str) -> None:
    """Set Blow shows f_L in zeta at six heights, everything else nothing."""
    counts = {key: len(values) for key, values in found(name).items() if key[1] in ("xi", "zeta") and values}
    assert counts == ({("f_L", "zeta"): 6} if name == "Blow" else {})


def test_the_lowest_mode_rises_with_height_the_others_of_a_fall() -> None:
    low, middle, high = (found("A")[band, "xi_dot"] for band in resonances.BANDS)
    assert low[-1] > low[0]
    assert middle[-1] < middle[0]
    assert high[-1] < high[0]
