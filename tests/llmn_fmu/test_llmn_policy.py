"""The parameter out_of_range of a network: inputs that warn, are held at their limits, or are refused."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import fmpy
import numpy as np
import pytest
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
    rows_of,
    told,
)

from fmi.raw import ERROR, OK, Slave
from fmu_builder.kernel import specification


@pytest.mark.parametrize("exchange", EXCHANGE)
@pytest.mark.parametrize("policy", [WARN, CLAMP])
@pytest.mark.parametrize("name", NETWORKS)
def test_outputs_and_in_range_have_the_bits_of_the_specification(
    built: Callable[[str], Built], name: str, policy: int, exchange: bool
) -> None:
    fmu = built(name)
    rows = rows_of(fmu.network, 4)
    oracle = specification.Network(fmu.network, limited=policy == CLAMP)
    oracle.start(rows[0].tolist())
    start = dict(zip(fmu.network.input_names, rows[0].tolist(), strict=True))
    slave = fmu.new(policy, exchange, **start)
    assert begin(slave, exchange) == OK
    flags = []
    for tick, row in enumerate(rows):
        flags.append(oracle.in_range)
        assert fmu.flag(slave) == int(oracle.in_range), tick
        assert advance(slave, tick, row.tolist(), exchange) == OK
        oracle.tick(row.tolist())
        assert fmu.read(slave) == oracle.outputs(row.tolist())
    assert 5 < sum(flags) < len(flags) - 5
    assert len(told(slave)) - sum("stability is proved" in text for text in told(slave)) == 1


@pytest.mark.parametrize("name", NETWORKS)
def test_data_inside_have_the_same_bits_under_every_policy(built: Callable[[str], Built], name: str) -> None:
    """Up and down as fast as in training."""
    fmu = built(name)
    region, network = fmu.network.trained_region, fmu.network
    index = network.scheduling_index
    step = 0.01 if region is None else region.rate * TICK
    middle = [one.operating_point for one in network.inputs]
    runs = []
    for policy in (WARN, CLAMP, REFUSE):
        slave = fmu.new(policy, **dict(zip(network.input_names, middle, strict=True)))
        assert begin(slave) == OK
        values, row = [], list(middle)
        for tick in range(80):
            row[index] += step * (1 if tick % 40 < 20 else -1) * 0.99999
            assert advance(slave, tick, row) == OK
            values.append(fmu.read(slave))
        runs.append(values)
    assert runs[0] == runs[1] == runs[2]


def test_the_start_counts(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new(eta=2.55)  # within the input's own limits, beyond the range
    assert begin(slave) == OK
    assert fmu.flag(slave) == 0
    what = "eta = 2.55 is outside [0.5, 2.5] at t = 0 s"
    assert told(slave) == [f"{what}: the model extrapolates (reported once)"]
    clamped, inside = fmu.new(CLAMP, eta=2.55), fmu.new(eta=2.5)
    assert begin(clamped) == begin(inside) == OK
    assert fmu.read(clamped) == fmu.read(inside)
    assert (fmu.flag(clamped), fmu.flag(inside)) == (0, 1)
    assert told(clamped) == [f"{what}: the limit acts in its place (reported once)"]
    refused = fmu.new(REFUSE, eta=2.55)
    assert begin(refused) == ERROR
    mend = "keep to what was trained, or set out_of_range to warn or clamp"
    assert refused.last_error() == f"fmi2ExitInitializationMode: {what}: {mend}"
    assert refused.set([0], [1.5]) == OK and refused.ExitInitializationMode() == OK
    later = fmu.new(eta=2.55)
    assert later.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(7.25), 0, ctypes.c_double(0)) == OK
    assert later.EnterInitializationMode() == OK and later.ExitInitializationMode() == OK
    assert "at t = 7.25 s" in told(later)[0]


def test_clamped_inputs_are_limited_and_the_height_follows_at_the_rate_of_training(
    built: Callable[[str], Built],
) -> None:
    fmu = built("surrogate")
    given, allowed = fmu.new(CLAMP), fmu.new(WARN)
    assert begin(given) == begin(allowed) == OK
    step, height = fmu.network.trained_region.rate * TICK, 1.5  # type: ignore[union-attr]
    for tick in range(40):
        height = height + step if 1.6 - height > step else 1.6
        assert advance(given, tick, [1.6, 9999.0]) == OK
        assert advance(allowed, tick, [height, 1700.0]) == OK
        assert fmu.read(given) == fmu.read(allowed) or tick < 25
        assert fmu.read(given, "xi", "zeta") == fmu.read(allowed, "xi", "zeta")
        assert fmu.flag(given) == 0  # it tells of what was given
        assert fmu.flag(given, "outside_certificate") == 0  # and this of what acts
    (force,) = fmu.read(given, "F_p") or [0.0]
    assert abs(force) < 1e4
    assert given.set([0], [9.0]) == OK
    (jump,) = fmu.read(given, "F_p") or [0.0]
    assert jump == pytest.approx(force - step * 1e5, rel=1e-9)  # k_E (xi - eta as it acts), not 740 kN


@pytest.mark.parametrize("exchange", EXCHANGE)
def test_an_error_says_what_and_leaves_the_states_of_before(
    built: Callable[[str], Built], exchange: bool
) -> None:
    fmu = built("surrogate")
    slave = fmu.new(REFUSE, exchange)
    assert begin(slave, exchange) == OK
    assert advance(slave, 0, [1.501, 1310.9], exchange) == OK
    saved, before = slave.save(), fmu.read(slave, "xi", "xi_dot", "zeta", "zeta_dot")
    assert advance(slave, 1, [1.501, 1700.1], exchange) == ERROR
    call = "fmi2NewDiscreteStates" if exchange else "fmi2DoStep"
    mend = "keep to what was trained, or set out_of_range to warn or clamp"
    assert slave.last_error() == f"{call}: M_pa = 1700.1 is outside [1000, 1700] at t = 0.001 s: {mend}"
    assert fmu.read(slave, "xi", "xi_dot", "zeta", "zeta_dot") == before
    assert slave.SetFMUstate(saved) == OK
    assert advance(slave, 1, [1.6, 1310.9], exchange) == ERROR
    assert f"the rate of eta = 99 is outside [-4, 4] at t = 0.001 s: {mend}" in slave.last_error()
    assert slave.Reset() == OK
    assert begin(slave, exchange) == OK  # out_of_range is warn again
    assert advance(slave, 0, [1.6, 1310.9], exchange) == OK
    assert fmu.flag(slave) == 0


def test_a_saved_state_brings_back_what_was_left_and_where_moves_count_from(
    built: Callable[[str], Built],
) -> None:
    fmu = built("surrogate")
    for policy in (WARN, CLAMP):
        slave = fmu.new(policy)
        assert begin(slave) == OK
        assert advance(slave, 0, [1.52, 1310.9]) == OK
        content = slave.to_bytes(slave.save())
        runs = []
        for other in (slave, fmu.new(WARN)):
            state = other.from_bytes(content)
            assert state is not None and other.SetFMUstate(state) == OK
            values = [(fmu.flag(other), fmu.read(other))]
            for tick, height in enumerate((1.52, 1.522, 1.524), start=1):
                assert advance(other, tick, [height, 1310.9]) == OK
                values.append((fmu.flag(other), fmu.read(other)))
            runs.append(values)
        assert runs[0] == runs[1]
        assert runs[0][0][0] == 0


@pytest.mark.parametrize("name", NETWORKS)
def test_directional_derivatives_under_clamp_are_those_of_differences(
    built: Callable[[str], Built], name: str
) -> None:
    fmu = built(name)
    network, index = fmu.network, fmu.network.scheduling_index
    names = [*network.output_names, *(f"validity_{k}" for k in range(1, 5))]
    unknown = [fmu.references[one] for one in names]
    middle = [one.operating_point for one in network.inputs]
    beyond = [one.maximum + 0.3 for one in network.inputs]
    places = [middle, beyond, [*middle[:index], beyond[index], *middle[index + 1 :]]]

    def derivative(slave: Slave, column: int) -> np.ndarray:
        count, result = ctypes.c_size_t(len(unknown)), (ctypes.c_double * len(unknown))()
        vr, known = (ctypes.c_uint * len(unknown))(*unknown), (ctypes.c_uint * 1)(column)
        one = (ctypes.c_double * 1)(1.0)
        assert slave.GetDirectionalDerivative(vr, count, known, ctypes.c_size_t(1), one, result) == OK
        return np.array(result)

    def differences(read: Callable[[float], list[float] | None], size: float) -> np.ndarray:
        ends = [np.array(read(sign * 1e-6 * size)) for sign in (1.0, -1.0)]
        return np.asarray((ends[0] - ends[1]) / (2e-6 * size))

    for place in places:
        start = fmu.new(CLAMP)
        assert start.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0)) == OK
        assert start.EnterInitializationMode() == OK
        running = fmu.new(CLAMP)
        assert begin(running) == OK
        assert advance(running, 0, middle) == OK
        for slave in (start, running):
            for column, one in enumerate(network.inputs):

                def read(
                    change: float, slave: Slave = slave, column: int = column, place: list[float] = place
                ) -> list[float] | None:
                    row = list(place)
                    row[column] += change
                    assert slave.set(range(len(row)), row) == OK
                    return slave.get(unknown)

                expected = differences(read, one.maximum - one.minimum)
                read(0.0)
                found = derivative(slave, column)
                scale = np.abs(expected).max() + 1.0
                assert np.abs(found - expected).max() < 2e-4 * scale
                if place[column] > one.maximum:
                    assert not found.any()


def test_limits_come_before_the_contact(built: Callable[[str], Built]) -> None:
    """The pan-head may leave the wire where limits hold it; moves count before the contact."""
    fmu = built("surrogate")
    network = fmu.network
    rows = rows_of(network, 8, 200)
    oracle = specification.Network(network, unilateral=True, limited=True)
    oracle.start(rows[0].tolist())
    start = dict(zip(network.input_names, rows[0].tolist(), strict=True))
    slave = fmu.new(CLAMP, unilateral=1.0, **start)
    assert begin(slave) == OK
    seen = set()
    for tick, row in enumerate(rows):
        assert advance(slave, tick, row.tolist()) == OK
        oracle.tick(row.tolist())
        assert fmu.read(slave) == oracle.outputs(row.tolist())
        assert fmu.flag(slave) == int(oracle.in_range)
        seen.add((oracle.in_range, (fmu.read(slave, "F_p") or [1.0])[0] == 0.0))
    assert len(seen) >= 3  # inside and outside, off the wire and on it


def test_policy_is_fixed_and_has_three_items(built: Callable[[str], Built]) -> None:
    fmu = built("surrogate")
    slave = fmu.new()
    reference = fmu.references["out_of_range"]
    assert slave.set_integer(reference, 4) == ERROR
    assert slave.set_integer(reference, 0) == ERROR
    assert slave.set_integer(reference, CLAMP) == OK
    assert slave.get_integer(reference) in (None, CLAMP)
    assert begin(slave) == OK
    assert slave.get_integer(reference) == CLAMP
    assert slave.set_integer(reference, WARN) == ERROR
    description = fmpy.read_model_description(str(fmu.path))
    (variable,) = [v for v in description.modelVariables if v.name == "out_of_range"]
    assert (variable.type, variable.start, variable.variability) == ("Enumeration", "1", "fixed")
    assert [item.name for item in variable.declaredType.items] == ["warn", "clamp", "error"]
