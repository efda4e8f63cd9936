"""The tick rule: which inputs a tick uses and when it runs, for any communication step."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmi import lti
from fmi.conftest import GUID
from fmi.lti import VR
from fmi.raw import ERROR, OK, Slave, load
from fmu_builder.compiler import host_platform
from fmu_builder.fmi2 import C_FOLDER
from tolerances import BITS

STATES = [VR["x_1"], VR["x_2"]]
INPUTS = [VR["drive"], VR["load"]]
MILLISECONDS = (1.0, 0.5, 0.25, 2.0, 5.0, 10.0, 0.7, 1000.0 / 60.0)

Step = tuple[float, float, tuple[float, float], tuple[float, float]]


def run(slave: Slave, steps: list[Step]) -> list[list[float]]:
    """Return the states after every communication step."""
    slave.start()
    history = []
    for time, step, inputs, slopes in steps:
        assert slave.set(INPUTS, inputs) == OK
        assert slave.slope(INPUTS, slopes) == OK
        assert slave.step(time, step) == OK
        history.append(slave.get(STATES))
    return history


def steps_of(
    lengths: list[float], inputs: Callable[[int], tuple[float, float]], slope: float = 0.0
) -> list[Step]:
    """Chain communication steps of these lengths (s), the next time being the sum so far."""
    steps, time = [], 0.0
    for k, length in enumerate(lengths):
        steps.append((time, length, inputs(k), (slope, -2.0 * slope)))
        time += length
    return steps


def wavy(k: int) -> tuple[float, float]:
    return (0.3 + 0.1 * (k % 7), -1.0 + 0.25 * (k % 5))


def check_against_definition(library: ctypes.CDLL) -> None:
    """Compare with the words of the rule, over the steps that users take; raises AssertionError."""
    for milliseconds in MILLISECONDS:
        for slope in (0.0, 3.0):
            steps = steps_of([milliseconds / 1000.0] * 40, wavy, slope)
            slave = Slave(library, GUID)
            try:
                assert run(slave, steps) == lti.run_by_definition(steps), (milliseconds, slope)
            finally:
                slave.free()


def test_follows_the_rule_for_every_step_size(lti_library: ctypes.CDLL) -> None:
    check_against_definition(lti_library)


@given(
    lengths=st.lists(st.floats(1e-5, 0.006), min_size=1, max_size=30),
    slope=st.sampled_from([0.0, 1.5]),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_follows_the_rule_for_uneven_steps(
    lti_library: ctypes.CDLL, lengths: list[float], slope: float
) -> None:
    steps = steps_of(lengths, wavy, slope)
    slave = Slave(lti_library, GUID)
    assert run(slave, steps) == lti.run_by_definition(steps)
    slave.free()


@pytest.mark.parametrize("milliseconds", MILLISECONDS)
def test_constant_inputs_give_the_same_bits_for_every_step(
    milliseconds: float, new_slave: Callable[..., Slave]
) -> None:
    inputs = (0.5, 2.0)
    expected = lti.steady_state(lti.START)
    by_tick = [expected]
    for _ in range(400):
        by_tick.append(lti.tick(by_tick[-1], inputs))
    step = milliseconds / 1000.0
    slave = new_slave().start()
    slave.set(INPUTS, inputs)
    for k in range(int(0.4 / step)):
        assert slave.step(k * step, step) == OK
        ticks = int((k + 1) * step / lti.SAMPLE_TIME + 0.01)
        got = slave.get(STATES)
        assert max(abs(a - b) for a, b in zip(got, by_tick[ticks], strict=True)) <= BITS


def test_master_that_adds_up_its_time_loses_no_tick_in_an_hour(new_slave: Callable[..., Slave]) -> None:
    """The sum of 3.6 million steps of 1 ms is off by far more than rounding; still every step is one tick."""
    times = [0.0]
    for _ in range(3_600_000):
        times.append(times[-1] + 0.001)
    assert 1e-6 < abs(times[-1] - 3600.0) / lti.SAMPLE_TIME < 0.01
    slave = new_slave().start()
    done = 0
    for first in range(299_900, 3_600_000, 300_000):
        assert slave.step(times[done], times[first] - times[done]) == OK
        for k in range(first, first + 100):
            inputs = wavy(k)
            before = slave.get(STATES)
            slave.set(INPUTS, inputs)
            assert slave.step(times[k], times[k + 1] - times[k]) == OK
            assert slave.get(STATES) == lti.tick(before, inputs), k
        done = first + 100
    assert done == 3_600_000


def test_start_time_shifts_the_grid(new_slave: Callable[..., Slave]) -> None:
    slave, shifted = new_slave(), new_slave()
    number = ctypes.c_double
    slave.start()
    assert shifted.SetupExperiment(0, number(0), number(7.0004), 0, number(0)) == OK
    assert shifted.EnterInitializationMode() == OK
    assert shifted.ExitInitializationMode() == OK
    for k in range(20):
        for one, start in ((slave, 0.0), (shifted, 7.0004)):
            one.set(INPUTS, wavy(k))
            assert one.step(start + k * 0.0007, 0.0007) == OK
        assert slave.get(STATES) == shifted.get(STATES)


def test_between_ticks_outputs_hold_but_follow_the_input_set_last(new_slave: Callable[..., Slave]) -> None:
    slave = new_slave().start()
    x = slave.get(STATES)
    slave.set([VR["load"]], [4.0])
    assert slave.step(0.0, 0.0004) == OK
    assert slave.get(STATES) == x
    assert slave.get([VR["mixed"]]) == [4.0 * x[0] - 5.0 * x[1] + 0.5 * 4.0]


FAULTS = {
    "one tick too many at the start": (
        "    while (slave_tick_is_due(slave, end)) {\n",
        "    if (begin <= 0.0) { (void)model_tick(&slave->model, time, slave->latched, message); }\n"
        "    while (slave_tick_is_due(slave, end)) {\n",
    ),
    "two ticks for one": ("    ++slave->tick;\n", "    slave->tick += 2;\n"),
    "tick uses the inputs of the step in which it ends": (
        "    if (begin <= (double)slave->tick + TICK_TOLERANCE) {\n",
        "    if (begin <= LARGEST_NUMBER) {\n",
    ),
    "inputs are latched once only": (
        "    if (begin <= (double)slave->tick + TICK_TOLERANCE) {\n",
        "    if (begin < 0.0) {\n",
    ),
    "no tolerance for rounding": ("#define TICK_TOLERANCE 0.01\n", "#define TICK_TOLERANCE 0.0\n"),
    "input derivatives without effect": (
        "input_derivative[k] * ahead",
        "input_derivative[k] * (0.0 * ahead)",
    ),
    "input derivatives kept for the next step": ("        slave->input_derivative[k] = 0.0;", "        "),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_fault_is_caught(fault: str, tmp_path: Path) -> None:
    right, wrong = FAULTS[fault]
    folder = tmp_path / "c"
    shutil.copytree(C_FOLDER, folder)
    text = (folder / "slave.c").read_text()
    assert text.count(right) == 1
    (folder / "slave.c").write_text(text.replace(right, wrong))
    library = load(lti.build(tmp_path / "lti_test.fmu", [host_platform()], folder), tmp_path)
    with pytest.raises(AssertionError):
        check_against_definition(library)
        check_derivatives_last_one_step(library)


def check_derivatives_last_one_step(library: ctypes.CDLL) -> None:
    slave = Slave(library, GUID).start()
    assert slave.slope(INPUTS, [10.0, 10.0]) == OK
    assert slave.step(0.0, 0.001) == OK
    before = slave.get(STATES)
    assert slave.step(0.001, 0.002) == OK
    after = slave.get(STATES)
    slave.free()
    assert after == lti.tick(lti.tick(before, lti.START), lti.START)


def test_a_derivative_out_of_the_range_of_numbers_is_refused(new_slave: Callable[..., Slave]) -> None:
    slave = new_slave().start()
    assert slave.slope([VR["load"]], [-1e308]) == OK
    assert slave.step(0.0, 0.5) == OK
    assert slave.set([VR["load"]], [1.0]) == OK
    assert slave.slope([VR["load"]], [1e308]) == OK
    assert slave.step(0.5, 2.0) == ERROR
    assert "the derivative of load leads out of the range of numbers" in slave.last_error()
    assert slave.slope([VR["load"]], [0.0]) == OK
    assert slave.step(0.5, 2.0) == OK


def test_input_derivatives_last_one_step(lti_library: ctypes.CDLL) -> None:
    check_derivatives_last_one_step(lti_library)
