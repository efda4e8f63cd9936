"""The kernel watches the trained region as the specification says it, and the numbers stay as they are."""

from __future__ import annotations

import sys

import networks
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_builder.kernel import Network, simulate, specification, tables_header, tables_of
from fmu_builder.parameter_set import ParameterSet, TrainedRegion

RATE = 125.0  # 0.125 in a tick of 1 ms, exact in binary
VARIANT = ("scheduled_equilibrium", "parameter", "hat")


def trained(parameter_set: ParameterSet, rate: float = RATE, **spans: tuple[float, float]) -> ParameterSet:
    return parameter_set.replaced(trained_region=TrainedRegion(rate=rate, derived_outputs=spans))


def flags(parameter_set: ParameterSet, rows: networks.Array) -> list[bool]:
    """in_range at the start and after every tick; kernel and specification agree."""
    kernel, oracle = Network(parameter_set), specification.Network(parameter_set)
    kernel.start(rows[0])
    oracle.start(rows[0].tolist())
    found = [kernel.in_range]
    assert kernel.in_range == oracle.in_range
    for row in rows:
        kernel.tick(row)
        oracle.tick(row.tolist())
        assert kernel.in_range == oracle.in_range
        assert kernel.states.ravel().tolist() == np.ravel(oracle.x).tolist()
        found.append(kernel.in_range)
    return found


def ramp(heights: list[float]) -> networks.Array:
    rows = np.full((len(heights), 3), 1.3)
    rows[:, 1] = heights
    return rows


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(networks.VARIANTS), st.booleans(), st.integers(0, 2**32 - 1), st.floats(1.0, 60.0))
def test_specification_equals_kernel(
    variant: tuple[str, str, str], feedthrough: bool, seed: int, reach: float
) -> None:
    plain = networks.network(seed, *variant, feedthrough)
    rows = networks.inputs_of(seed, 40, 3)
    middle = np.median(simulate(plain, rows)[:, -1])
    watched = trained(plain, 50.0, sum=(middle - reach, middle + reach))
    flags(watched, rows)
    assert simulate(watched, rows).tobytes() == simulate(plain, rows).tobytes()


def test_the_longest_move_of_training_is_inside_and_the_next_number_is_not() -> None:
    plain = networks.network(1, *VARIANT)
    up = ramp([1.0, 1.0, 1.125, 1.25, 1.125])
    assert all(flags(trained(plain), up))
    slower = trained(plain, float(np.nextafter(RATE, 0.0)))
    assert flags(slower, up) == [True, True, True, False, False, False]
    down = ramp([1.25, float(np.nextafter(1.125, 0.0)), 1.125])
    assert flags(trained(plain), down) == [True, True, False, True]


def test_moves_beyond_the_range_count_too() -> None:
    """What is watched is the input, not the clipped variable of the certificate."""
    network = trained(networks.network(1, *VARIANT))
    kernel = Network(network)
    kernel.start([1.3, 2.5, 1.3])
    kernel.tick([1.3, 3.5, 1.3])
    assert not kernel.in_range
    kernel.tick([1.3, 2.5, 1.3])
    assert not kernel.in_range  # 1 m down
    kernel.tick([1.3, 2.5, 1.3])
    assert kernel.in_range


@pytest.mark.parametrize("feedthrough", [False, True])
def test_derived_outputs_are_those_of_the_row_with_which_the_tick_begins(feedthrough: bool) -> None:
    """As in a row of data: inputs set, outputs read, then the step."""
    plain = networks.network(7, *VARIANT, feedthrough=feedthrough)
    rows = networks.inputs_of(2, 50, 3) * 0.1 + [1.2, 1.3, 1.4]
    outputs = simulate(plain, rows)
    low, high = np.quantile(outputs[:, -2], (0.2, 0.7))
    inside = (outputs[:, -2] >= low) & (outputs[:, -2] <= high)
    assert 10 < inside.sum() < 40
    assert flags(trained(plain, 1e4, force=(low, high)), rows) == [bool(inside[0]), *inside.tolist()]


def test_without_a_region_only_the_inputs_are_watched() -> None:
    plain = networks.network(1, *VARIANT)
    assert all(flags(plain, ramp([0.5, 2.5, 0.5])))
    assert flags(plain, ramp([1.0, 2.6, 1.0])) == [True, True, False, True]
    tables = tables_of(plain)
    assert (tables.sizes["watched"], tables.numbers["trained_move"]) == (0, sys.float_info.max)
    assert "TABLES_WATCHED = 0" in tables_header(tables)
    assert "TABLES_WATCHED = 1" in tables_header(tables_of(trained(plain, sum=(0.0, 1.0))))
    assert tables_of(trained(plain)).sizes["watched"] == 0


def test_the_scheduling_input_is_limited_by_its_own_limits_and_by_the_range() -> None:
    plain = networks.network(1, *VARIANT)
    first, height, last = plain.inputs
    network = plain.replaced(inputs=(first, height.model_copy(update={"minimum": 0.9}), last))
    tables = tables_of(network)
    assert (tables.arrays["input_minimum"][1], tables.arrays["input_maximum"][1]) == (0.9, networks.HIGH)
    assert flags(network, ramp([1.0, 0.8, 2.5, 2.6])) == [True, True, False, True, False]


def test_a_rate_beyond_all_numbers_per_tick_is_no_limit_and_a_number_in_c() -> None:
    slow = trained(networks.network(43, *VARIANT).replaced(sample_time=2.0), rate=1.7e308)
    assert tables_of(slow).numbers["trained_move"] == sys.float_info.max
    assert "inf" not in tables_header(tables_of(slow))
