"""The kernel watches how far the scheduling variable moves, as the specification says it."""

from __future__ import annotations

import networks
import numpy as np
import pytest

from fmu_builder.kernel import Network, specification, tables_header, tables_of
from fmu_builder.parameter_set import ParameterSet

MOVE = 0.125


def first_outside(parameter_set: ParameterSet, rows: networks.Array, move: float = MOVE) -> int | None:
    """The tick that raises the flag, which then stays; kernel and specification agree at every tick."""
    kernel = Network(tables_of(parameter_set, move))
    oracle = specification.Network(parameter_set, certified_move=move)
    kernel.start(rows[0])
    oracle.start(rows[0].tolist())
    raised = None
    for tick, row in enumerate(rows):
        kernel.tick(row)
        oracle.tick(row.tolist())
        assert kernel.outside == oracle.outside
        assert kernel.states.ravel().tolist() == np.ravel(oracle.x).tolist()
        if kernel.outside and raised is None:
            raised = tick
        assert kernel.outside == (raised is not None)
    return raised


def ramp(heights: list[float]) -> networks.Array:
    rows = np.full((len(heights), 3), 0.3)
    rows[:, 1] = heights
    return rows


@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
@pytest.mark.parametrize("seed", range(3))
def test_specification_equals_kernel(variant: tuple[str, str, str], seed: int) -> None:
    parameter_set, random = networks.network(seed, *variant), np.random.default_rng(seed)
    heights = 1.5 + np.cumsum(random.uniform(-0.13, 0.13, 60))
    first_outside(parameter_set, ramp(heights.tolist()))


def test_the_longest_move_that_is_certified_is_inside_and_the_next_number_is_not() -> None:
    parameter_set = networks.network(1, "scheduled_equilibrium", "parameter", "hat")
    up = ramp([1.0, 1.0, 1.125, 1.25, 1.125])
    assert first_outside(parameter_set, up) is None
    assert first_outside(parameter_set, up, float(np.nextafter(MOVE, 0.0))) == 2
    down = ramp([1.25, 1.25, 1.25, float(np.nextafter(1.125, 0.0))])
    assert first_outside(parameter_set, down) == 3


def test_beyond_the_ends_nothing_moves() -> None:
    parameter_set = networks.network(1, "scheduled_equilibrium", "parameter", "hat")
    high = networks.HIGH
    assert (
        first_outside(parameter_set, ramp([high, high + 5.0, high + 0.01, high - 0.125, high + 9.0])) is None
    )
    assert first_outside(parameter_set, ramp([high + 5.0, high - 0.126])) == 1


def test_the_deviation_in_the_schedule_counts() -> None:
    content = networks.network(2, "scheduled_equilibrium", "parameter", "hat").model_dump()
    content["partition"] |= {"deviation_output": "y_2", "deviation_gain": 0.05}
    still = ramp([1.5] * 12)
    still[4:, 0] = 9.0
    assert first_outside(ParameterSet(**content), still, 1e-3) is not None
    content["partition"] |= {"deviation_gain": 0.0}
    assert first_outside(ParameterSet(**content), still, 1e-3) is None


def test_the_low_pass_moves_less_than_the_height() -> None:
    parameter_set = networks.network(3, "low_pass", "parameter", "hat")
    assert first_outside(parameter_set, ramp([1.0, 1.0, 2.0])) is None


def test_without_a_certificate_nothing_is_outside() -> None:
    parameter_set = networks.network(1, "scheduled_equilibrium", "parameter", "hat")
    assert first_outside(parameter_set, ramp([0.6, 2.4, 0.6]), 0.0) is None
    assert "TABLES_CERTIFIED = 0" in tables_header(tables_of(parameter_set))
    assert "TABLES_CERTIFIED = 1" in tables_header(tables_of(parameter_set, MOVE))
