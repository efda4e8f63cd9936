"""The trained region of a network in its FMU: in_range and the one warning."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from trained_networks import (
    CLAMP,
    EXCHANGE,
    NETWORKS,
    REFUSE,
    TICK,
    WARN,
    Built,
    advance,
    begin,
    surrogate,
    told,
)

from fmi.raw import OK
from fmu_builder.check import Options, check_fmu
from fmu_builder.llmn_fmu import identity, interface, model_card


@pytest.mark.parametrize("exchange", EXCHANGE)
def test_the_first_limit_that_is_left_is_logged_once_and_anew_after_a_reset(
    built: Callable[[str], Built], exchange: bool
) -> None:
    fmu = built("surrogate")
    slave = fmu.new(WARN, exchange)
    for _ in range(2):
        assert begin(slave, exchange) == OK
        slave.log.clear()
        assert advance(slave, 0, [1.5, 1310.9], exchange) == OK
        assert (fmu.flag(slave), told(slave)) == (1, [])
        assert advance(slave, 1, [1.5, 1800.0], exchange) == OK
        assert fmu.flag(slave) == 0
        assert advance(slave, 2, [2.9, 1310.9], exchange) == OK
        assert advance(slave, 3, [2.9, 2000.0], exchange) == OK
        texts = [text for text in told(slave) if "stability" not in text]
        what = "M_pa = 1800 is outside [1000, 1700] at t = 0.001 s: the model extrapolates (reported once)"
        assert texts == [what]
        assert slave.Reset() == OK
        assert slave.set_integer(fmu.references["out_of_range"], WARN) == OK


def test_a_value_that_no_tick_uses_leaves_nothing(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new(eta=9.0)
    assert slave.set([0], [1.5]) == OK
    assert begin(slave) == OK
    assert slave.set([1], [1e6]) == OK
    assert slave.set([1], [1300.0]) == OK
    assert slave.step(0.0, TICK) == OK
    assert (fmu.flag(slave), told(slave)) == (1, [])


def test_a_height_that_moves_faster_than_in_training(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new()
    assert begin(slave) == OK
    assert advance(slave, 0, [1.504, 1310.9]) == OK  # 4 mm, and rounded up
    assert advance(slave, 1, [1.504 + 0.9999 * 4e-3, 1310.9]) == OK
    assert advance(slave, 2, [1.504, 1310.9]) == OK
    faster = fmu.new(eta=1.5)
    assert begin(faster) == OK
    assert advance(faster, 0, [1.495, 1310.9]) == OK
    assert fmu.flag(faster) == 0
    (text,) = told(faster)
    assert text.startswith("the rate of eta = -5 is outside [-4, 4] at t = 0 s: ")
    assert advance(faster, 1, [1.495, 1310.9]) == OK
    assert fmu.flag(faster) in (0, 1)
    assert len(told(faster)) == 1


def test_an_input_held_over_a_long_step_jumps_and_a_slope_does_not(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    jumping, sloping = fmu.new(), fmu.new()
    for slave in (jumping, sloping):
        assert begin(slave) == OK
    for step in range(4):
        height = 1.5 + 0.01 * step
        assert sloping.slope([0], [1.0]) == OK
        for slave in (jumping, sloping):
            assert slave.set([0], [height]) == OK
            assert slave.step(0.01 * step, 0.01) == OK
    assert any("the rate of eta = 10 is outside" in text for text in told(jumping))
    assert not any("the rate of" in text for text in told(sloping))


def test_in_range_tells_of_all_ticks_of_a_step(built: Callable[[str], Built]) -> None:
    """The jump of a held input is in the first tick; a second later all is at rest again."""
    fmu = built("surrogate")
    slave = fmu.new()
    assert begin(slave) == OK
    for step, (height, kept) in enumerate([(1.5, 1), (1.505, 0), (1.505, 1)]):
        assert slave.set([0], [height]) == OK
        assert slave.step(float(step), 1.0) == OK
        assert fmu.flag(slave) == kept


def test_a_force_that_training_has_not_seen(built: Callable[[str], Built]) -> None:
    """The force at the beginning of the tick, of its inputs: that of a row of data."""
    fmu = built("surrogate")
    slave = fmu.new()
    assert begin(slave) == OK
    (force,) = fmu.read(slave, "F_p") or [0.0]
    assert 20.0 < force < 150.0
    height = 1.5 - (170.0 - force) / 1e5  # the wire comes down by 1 mm, well below the rate
    assert slave.set([0], [height]) == OK
    (pressed,) = fmu.read(slave, "F_p") or [0.0]
    assert pressed == pytest.approx(170.0)
    assert fmu.flag(slave) == 1  # no tick has used it yet
    assert slave.step(0.0, TICK) == OK
    assert fmu.flag(slave) == 0
    assert told(slave) == [
        "F_p = 170 is outside [20, 150] at t = 0 s: the model extrapolates (reported once)"
    ]
    for policy in (CLAMP, REFUSE):
        other = fmu.new(policy)
        assert begin(other) == OK
        assert advance(other, 0, [height, 1310.9]) == OK  # a force is the model's own answer: told, no error
        assert told(other) == told(slave)


def test_a_flight_that_training_has_not_seen_is_outside(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new(unilateral=1.0)
    assert begin(slave) == OK
    flags = []
    for tick in range(6):
        assert advance(slave, tick, [1.5 + 1e-3 * min(tick, 3), 1310.9]) == OK
        flags.append((fmu.flag(slave), (fmu.read(slave, "F_p") or [1.0])[0] > 0.0))
    assert flags[0] == (1, True)
    assert flags[-1] == (0, False)
    assert any("F_p = 0 is outside [20, 150]" in text for text in told(slave))
    assert fmu.flag(slave, "outside_certificate") == 1


@pytest.mark.parametrize("name", NETWORKS)
def test_checkers_find_nothing(built: Callable[[str], Built], name: str) -> None:
    path = built(name).path
    assert validate_fmu(str(path)) == []
    assert list(check_fmu(path, Options()).findings) == []


def test_a_set_without_a_region_watches_its_inputs_only(built: Callable[[str], Built]) -> None:
    fmu = built("unknown")
    assert fmu.network.trained_region is None
    assert identity(fmu.network) == fmu.network.model_hash()
    slave = fmu.new()
    assert begin(slave) == OK
    middle = [one.operating_point for one in fmu.network.inputs]
    for tick, height in enumerate((0.6, 2.4, 0.6)):
        assert advance(slave, tick, [middle[0], height, middle[2]]) == OK
        assert fmu.flag(slave) == 1
    assert told(slave) == []


def test_another_region_is_another_fmu_and_the_card_says_what_it_is() -> None:
    network = surrogate()
    plain, region = network.replaced(trained_region=None), network.trained_region
    assert region is not None
    others = [
        region.model_copy(update={"rate": float(np.nextafter(region.rate, 9.0))}),
        region.model_copy(update={"derived_outputs": {"F_p": (20.0, 151.0)}}),
    ]
    sets = [plain, network, *(network.replaced(trained_region=one) for one in others)]
    assert len({interface(one).guid(identity(one)) for one in sets}) == 4
    assert len({one.model_hash() for one in sets}) == 1
    banded = region.model_copy(update={"frequency_bands": {"eta": (0.2, 104.0)}})
    shown = network.replaced(trained_region=banded)
    card = model_card(shown, interface(shown))
    for part in (
        "eta moved by at most 4 m/s",
        "F_p was in 20 .. 150 N",
        "<td>F_p</td><td>N</td><td>20</td><td></td><td>150</td>",
        "<td>eta</td><td>0.2</td><td>104</td>",
        "out_of_range says what an input outside does: with warn (1)",
        *("with clamp (2)", "with error (3)"),
    ):
        assert part in card
    assert "is not known, nor at which frequencies" in model_card(plain, interface(plain))
