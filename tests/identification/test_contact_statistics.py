"""Contact statistics against counting by hand, sines and loops whose figures are known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tolerances
from fmu_builder.errors import DataError
from identification.contact_statistics import (
    SHORTEST_ARC,
    Loss,
    agreement_of_losses,
    band_limited,
    contact_losses,
    contact_statistics,
    first_loss,
    hysteresis_width,
)

SAMPLE_TIME = 2e-3
FORCES = st.lists(st.sampled_from([0.0, -3.0, 40.0, 90.0]), min_size=40, max_size=200).map(np.array)


def test_losses_of_a_record_counted_by_hand() -> None:
    force = np.array([5.0, 0.0, 0.0, 0.0, 7.0, 0.0, 9.0, -1.0, 0.0])
    assert contact_losses(force, 0.002) == (Loss(0.002, 0.006), Loss(0.01, 0.002), Loss(0.014, 0.004))
    assert contact_losses(force, 0.002)[0].end == 0.008
    assert contact_losses(force[:1], 0.002) == ()
    assert contact_losses(force[1:3], 0.002) == (Loss(0.0, 0.004),)


def test_statistics_of_a_record_counted_by_hand() -> None:
    force = np.array([0.0] * 3 + [30.0] * 20 + [0.0] * 2 + [60.0] * 24 + [0.0])
    found = contact_statistics(force, SAMPLE_TIME)
    assert (found.loss, found.losses, found.long_losses) == (12.0, 3, 1)
    assert found.longest_loss == 3 * SAMPLE_TIME
    assert found.mean_loss == 2 * SAMPLE_TIME
    assert (found.minimum, found.maximum, found.mean) == (0.0, 60.0, 40.8)
    assert found.statistical_maximum - found.mean == pytest.approx(3.0 * found.banded_standard_deviation)
    assert found.mean - found.statistical_minimum == pytest.approx(3.0 * found.banded_standard_deviation)


@given(force=FORCES)
def test_losses_and_their_share_are_those_of_a_plain_count(force: np.ndarray) -> None:
    runs = [
        len(list(run)) for open_, run in itertools.groupby(force.tolist(), lambda one: one <= 0.0) if open_
    ]
    found = contact_statistics(force, SAMPLE_TIME)
    assert found.losses == len(runs)
    assert [round(loss.duration / SAMPLE_TIME) for loss in contact_losses(force, SAMPLE_TIME)] == runs
    assert found.long_losses == sum(one * SAMPLE_TIME >= SHORTEST_ARC for one in runs)
    assert found.loss == pytest.approx(100.0 * sum(runs) / len(force))


@given(force=FORCES, shift=st.integers(0, 30))
def test_agreement_is_symmetric_and_whole_with_itself(force: np.ndarray, shift: int) -> None:
    other = np.roll(force, shift)
    assert agreement_of_losses(force, force) == 100.0
    assert agreement_of_losses(force, other) == agreement_of_losses(other, force)


def test_agreement_of_two_losses_that_overlap_in_part() -> None:
    one, other = np.ones(10), np.ones(10)
    one[2:6] = other[4:9] = 0.0
    assert agreement_of_losses(one, other) == pytest.approx(100.0 * 2 / 7)
    assert agreement_of_losses(np.ones(10), np.ones(10)) == 100.0


def test_the_first_loss_that_counts_lasts_five_milliseconds() -> None:
    losses = (Loss(0.1, 0.004), Loss(0.3, 5 * 0.001), Loss(0.5, 0.1))
    assert first_loss(losses) == losses[1]
    assert first_loss(losses[:1]) is None
    assert first_loss(losses, 0.003) == losses[0]


def test_the_band_ends_at_twenty_hertz() -> None:
    time = np.arange(4000) * 1e-3
    slow, fast = (10.0 * np.sin(2.0 * np.pi * frequency * time) for frequency in (5.0, 60.0))
    middle = slice(500, -500)
    passed = band_limited(70.0 + slow + fast, 1e-3)[middle] - 70.0
    assert np.abs(passed - slow[middle]).max() <= tolerances.CONTACT_BAND * 10.0
    spread = contact_statistics(70.0 + slow + fast, 1e-3)
    assert spread.banded_standard_deviation == pytest.approx(10.0 / np.sqrt(2.0), rel=tolerances.CONTACT_BAND)
    assert spread.standard_deviation == pytest.approx(10.0, rel=tolerances.CONTACT_BAND)


@pytest.mark.parametrize(("rows", "sample_time"), [(10, 1e-3), (100, 0.03)])
def test_a_record_that_cannot_be_filtered_is_refused(rows: int, sample_time: float) -> None:
    with pytest.raises(DataError, match="cannot be filtered at 20 Hz"):
        contact_statistics(np.ones(rows), sample_time)


def test_the_width_of_a_loop_is_that_between_its_branches() -> None:
    rise = np.linspace(0.8, 2.0, 600)
    height = np.concatenate([rise, rise[::-1]])
    force = 70.0 + 3.0 * height + np.where(np.arange(1200) < 600, -4.0, 6.5)
    assert hysteresis_width(height, force, 1.3, 1.6) == pytest.approx(10.5)
    for bad, low in ((np.concatenate([rise, rise]), 1.3), (height, 3.0)):
        with pytest.raises(DataError, match="does not rise and fall alike"):
            hysteresis_width(bad, force, low, low + 0.3)
