"""Getting, setting and the life of an instance: what is served, what is refused and how that is said."""

from __future__ import annotations

import ctypes
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable

import pytest

from fmi import lti
from fmi.conftest import GUID
from fmi.lti import VR
from fmi.raw import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, OK, WARNING, Slave
from fmu_builder.fmi2 import model_description

NewSlave = Callable[..., Slave]


def test_first_outputs_are_the_steady_state_of_the_start_inputs(new_slave: NewSlave) -> None:
    slave = new_slave()
    assert slave.EnterInitializationMode() == OK
    x = lti.steady_state(lti.START)
    names = ["x_1", "x_2", "scaled", "mixed"]
    expected = [x[0], x[1], 2.5 * x[1], 4.0 * x[0] - 5.0 * x[1] + 0.5 * lti.START[1]]
    assert slave.get([VR[name] for name in names]) == expected
    assert slave.get_integer(VR["in_range"], "GetBoolean") == 1
    assert slave.ExitInitializationMode() == OK
    assert slave.get([VR[name] for name in names]) == expected


def test_start_values_set_in_initialisation_count(new_slave: NewSlave) -> None:
    slave = new_slave()
    assert slave.set_integer(VR["preset"], 2) == OK
    assert slave.EnterInitializationMode() == OK
    assert slave.get([VR["x_1"]]) == lti.steady_state(lti.START, 3.0)[:1]
    assert slave.set([VR["drive"], VR["scale"]], [-1.0, 0.5]) == OK
    x = lti.steady_state((-1.0, lti.START[1]), 3.0)
    assert slave.get([VR["x_1"], VR["scaled"]]) == [x[0], 0.5 * x[1]]
    assert slave.ExitInitializationMode() == OK
    assert slave.step(0.0, 0.001) == OK
    assert slave.get([VR["x_1"]]) == lti.tick(x, (-1.0, lti.START[1]), 3.0)[:1]


def test_setting_stores_only(new_slave: NewSlave) -> None:
    slave, plain = new_slave().start(), new_slave().start()
    for k in range(5):
        slave.set([VR["drive"]], [2.0])
        slave.get([VR["mixed"], VR["x_1"]])
        for one in (slave, plain):
            one.set([VR["drive"]], [0.1 * k])
            assert one.step(k * 0.001, 0.001) == OK
    assert slave.get([VR["x_1"], VR["x_2"]]) == plain.get([VR["x_1"], VR["x_2"]])


@pytest.mark.parametrize("guid", ["", "{00000000-0000-0000-0000-000000000000}", GUID[:-1], GUID + "x"])
def test_wrong_guid_gives_no_instance(new_slave: NewSlave, guid: str) -> None:
    slave = new_slave(guid)
    assert slave.component is None
    assert slave.log == [
        (ERROR, "logStatusError", f"fmi2Instantiate: the GUID is not that of this FMU, {GUID}")
    ]


def test_unknown_type_of_interface_gives_no_instance(new_slave: NewSlave) -> None:
    slave = new_slave(kind=2)
    assert slave.component is None
    assert "neither model exchange nor co-simulation" in slave.last_error()


def test_works_without_callbacks(new_slave: NewSlave) -> None:
    slave = new_slave(callbacks=False).start()
    assert slave.step(0.0, 0.001) == OK
    assert slave.step(5.0, 0.001) == ERROR
    assert slave.get([99]) is None


def test_without_instance_every_call_is_an_error(lti_library: ctypes.CDLL) -> None:
    for name in ("Reset", "Terminate", "EnterInitializationMode", "DoStep", "GetFMUstate", "CancelStep"):
        zero = ctypes.c_double(0)
        assert getattr(lti_library, "fmi2" + name)(None, zero, zero, 0) == ERROR
    lti_library.fmi2FreeInstance(None)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda s: s.set([VR["drive"]], [math.nan]), "fmi2SetReal: drive must be a finite number"),
        (lambda s: s.set([VR["load"]], [-math.inf]), "fmi2SetReal: load must be a finite number"),
        (lambda s: s.set([77], [1.0]), "fmi2SetReal: unknown value reference 77"),
        (lambda s: s.set([VR["mixed"]], [1.0]), "mixed is neither an input nor a parameter"),
        (lambda s: s.set([VR["scale"]], [1.0]), "scale is a fixed parameter"),
        (lambda s: s.set([VR["preset"]], [1.0]), "preset has another type"),
        (lambda s: s.set_integer(VR["preset"], 2), "fmi2SetInteger: preset is a fixed parameter"),
        (lambda s: s.set_integer(VR["drive"], 2), "drive has another type"),
        (lambda s: s.SetReal(None, ctypes.c_size_t(1), None), "an array is missing"),
        (
            lambda s: s.SetString((ctypes.c_uint * 1)(0), ctypes.c_size_t(1), (ctypes.c_char_p * 1)(b"")),
            "another type",
        ),
        (lambda s: ERROR if s.get([13]) is None else OK, "fmi2GetReal: unknown value reference 13"),
        (lambda s: ERROR if s.get([4000000000]) is None else OK, "unknown value reference 4000000000"),
        (lambda s: ERROR if s.get([VR["in_range"]]) is None else OK, "in_range has another type"),
        (lambda s: s.step(0.0, 0.0), "the communication step size must be positive, not 0 s"),
        (lambda s: s.step(0.0, -0.001), "must be positive, not -0.001 s"),
        (lambda s: s.step(0.0, math.nan), "is not a finite number"),
        (lambda s: s.step(math.inf, 0.001), "is not a finite number"),
        (lambda s: s.step(0.0, 1e300), "too long to count"),
        (lambda s: s.step(0.25, 0.001), "the communication point is 0.25 s, but the last step ended at 0 s"),
        (lambda s: s.slope([VR["x_1"]], [1.0]), "x_1 is not an input"),
        (lambda s: s.slope([VR["drive"]], [1.0], order=2), "only the first derivative"),
        (lambda s: s.slope([VR["drive"]], [math.nan]), "drive: the derivative must be a finite number"),
        (lambda s: s.CancelStep(), "fmi2CancelStep: not allowed between communication steps"),
        (lambda s: s.ExitInitializationMode(), "fmi2ExitInitializationMode: not allowed between"),
    ],
)
def test_illegal_input_is_refused_with_its_name_and_changes_nothing(
    new_slave: NewSlave, act: Callable[[Slave], int], words: str
) -> None:
    slave = new_slave().start()
    before = slave.to_bytes(slave.save())
    assert act(slave) == ERROR
    assert words in slave.last_error()
    assert slave.log[-1][1] == "logStatusError"
    assert slave.to_bytes(slave.save()) == before
    assert slave.step(0.0, 0.001) == OK


def test_one_bad_value_stores_none(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    assert slave.set([VR["drive"], VR["load"]], [0.5, math.nan]) == ERROR
    assert slave.get([VR["drive"], VR["load"]]) == list(lti.START)


def test_empty_lists_are_no_error(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    for name in ("GetReal", "GetInteger", "GetBoolean", "GetString", "SetReal", "SetInteger", "SetString"):
        assert getattr(slave, name)(None, ctypes.c_size_t(0), None) == OK


def test_parameter_outside_its_limits_is_refused(new_slave: NewSlave) -> None:
    slave = new_slave()
    assert slave.set([VR["scale"]], [4.5]) == ERROR
    assert "scale = 4.5 is outside [0.5, 4]" in slave.last_error()
    assert slave.set_integer(VR["preset"], 3) == ERROR
    assert slave.set_integer(VR["preset"], 0) == ERROR


def test_input_outside_its_limits_is_served_with_one_warning(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    assert slave.set([VR["drive"]], [3.5]) == OK
    assert slave.set([VR["drive"]], [4.5]) == OK
    assert slave.step(0.0, 0.001) == OK
    assert slave.get_integer(VR["in_range"], "GetBoolean") == 0
    text = "fmi2SetReal: drive = 3.5 is outside [-2, 3]: the model extrapolates (reported once)"
    assert slave.log == [(WARNING, "logStatusWarning", text)]
    assert slave.Reset() == OK
    assert slave.set([VR["drive"]], [3.5]) == OK
    assert slave.log == 2 * [(WARNING, "logStatusWarning", text)]


def test_output_that_is_not_finite_is_an_error_not_a_number(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    assert slave.set([VR["load"]], [0.0]) == OK
    assert slave.get([VR["reciprocal"]]) is None
    assert "reciprocal is not a finite number" in slave.last_error()
    assert slave.get([VR["mixed"]]) is not None


def test_start_the_model_refuses_can_be_mended(new_slave: NewSlave) -> None:
    slave = new_slave()
    assert slave.EnterInitializationMode() == OK
    assert slave.set([VR["drive"]], [6.0]) == OK
    assert slave.get([VR["x_1"]]) is None
    assert slave.ExitInitializationMode() == ERROR
    assert slave.last_error() == "fmi2ExitInitializationMode: no steady state for drive = 6"
    assert slave.set([VR["drive"]], [1.0]) == OK
    assert slave.ExitInitializationMode() == OK


def test_error_of_the_model_ends_the_run_until_reset(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    assert slave.step(0.0, 0.003) == OK
    saved = slave.save()
    slave.set([VR["drive"]], [9.0])
    assert slave.step(0.003, 0.002) == ERROR
    assert slave.last_error() == "fmi2DoStep: drive hits the stop at 9"
    time, status = ctypes.c_double(-1), ctypes.c_int(-1)
    assert slave.GetRealStatus(2, ctypes.byref(time)) == OK
    assert time.value == pytest.approx(0.003, abs=0)
    assert slave.GetStatus(0, ctypes.byref(status)) == OK
    assert status.value == ERROR
    assert slave.step(0.003, 0.002) == ERROR
    assert "after an error of the model" in slave.last_error()
    assert slave.SetFMUstate(saved) == OK
    assert slave.step(0.003, 0.002) == OK
    assert slave.Reset() == OK
    slave.start()
    assert slave.get([VR["x_1"]]) == lti.steady_state(lti.START)[:1]


def test_stop_time_is_kept(new_slave: NewSlave) -> None:
    slave = new_slave()
    number = ctypes.c_double
    assert slave.SetupExperiment(0, number(0), number(1.0), 1, number(0.5)) == ERROR
    assert slave.SetupExperiment(0, number(0), number(math.nan), 0, number(0.5)) == ERROR
    assert slave.SetupExperiment(0, number(0), number(0.0), 1, number(0.01)) == OK
    slave.EnterInitializationMode()
    slave.ExitInitializationMode()
    assert slave.step(0.0, 0.01) == OK
    assert slave.step(0.01, 0.001) == ERROR
    assert "beyond the stop time 0.01 s" in slave.last_error()


def _derivative(slave: Slave, unknown: list[str], known: list[str], seed: list[float]) -> list[float] | None:
    result = (ctypes.c_double * len(unknown))(*([-99.0] * len(unknown)))
    status = slave.GetDirectionalDerivative(
        (ctypes.c_uint * len(unknown))(*[VR[name] for name in unknown]),
        ctypes.c_size_t(len(unknown)),
        (ctypes.c_uint * len(known))(*[VR[name] for name in known]),
        ctypes.c_size_t(len(known)),
        (ctypes.c_double * len(seed))(*seed),
        result,
    )
    return list(result) if status == OK else None


def test_directional_derivatives_come_from_the_model(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    rows = ["der_x_1", "der_x_2"]
    columns = ["x_1", "x_2", "drive", "load"]
    for column, name in enumerate(columns):
        expected = [(*lti.A[row], *lti.B[row])[column] for row in (0, 1)]
        assert _derivative(slave, rows, [name], [1.0]) == expected
    assert _derivative(slave, ["der_x_2"], ["x_1", "load"], [2.0, 10.0]) == [2.0 * -41.0 + 10.0 * -7.0]
    assert _derivative(slave, ["mixed", "x_2"], ["drive"], [1.0]) == [0.0, 0.0]
    assert _derivative(slave, ["mixed", "x_2", "scaled"], ["x_2"], [2.0]) == [-10.0, 2.0, 5.0]
    assert _derivative(slave, ["x_1"], ["load", "load"], [1.0, 2.0]) == [0.0]
    assert _derivative(slave, ["mixed"], ["load", "load"], [1.0, 2.0]) == [1.5]


@pytest.mark.parametrize(
    ("unknown", "known", "words"),
    [
        ("drive", "load", "no derivative of drive, which is not calculated"),
        ("scale", "load", "no derivative of scale, which is not calculated"),
        ("mixed", "scale", "no derivative with respect to scale, which is neither an input nor"),
        ("mixed", "scaled", "no derivative with respect to scaled, which is neither"),
        ("in_range", "load", "in_range has another type"),
        ("mixed", "preset", "preset has another type"),
    ],
)
def test_derivatives_that_do_not_exist_are_refused(
    new_slave: NewSlave, unknown: str, known: str, words: str
) -> None:
    slave = new_slave().start()
    assert _derivative(slave, ["x_1", unknown], ["drive", known], [1.0, 1.0]) is None
    assert words in slave.last_error()


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
def test_in_initialisation_derivatives_are_those_of_the_steady_state(new_slave: NewSlave, kind: int) -> None:
    slave = new_slave(kind=kind)
    assert slave.set_integer(VR["preset"], 2) == OK
    assert slave.EnterInitializationMode() == OK
    assert slave.set([VR["drive"]], [2.0]) == OK
    rows = ["x_1", "x_2", "mixed", "der_x_1", "der_x_2"]
    for known, inputs in (("drive", (1.0, 0.0)), ("load", (0.0, 1.0))):
        x = lti.steady_state(inputs, 3.0)
        expected = [*x, 4.0 * x[0] - 5.0 * x[1] + 0.5 * inputs[1], 0.0, 0.0]
        assert _derivative(slave, rows, [known], [1.0]) == expected
    x = lti.steady_state((2.0, lti.START[1]), 3.0)
    assert _derivative(slave, ["scaled", "x_2"], ["scale"], [2.0]) == [2.0 * x[1], 0.0]
    assert _derivative(slave, ["scaled"], ["x_1"], [1.0]) is None
    assert "no derivative with respect to x_1, which is neither an input nor a par" in slave.last_error()
    slave.set([VR["drive"]], [4.5])
    assert _derivative(slave, ["scaled"], ["load"], [1.0]) is None
    assert slave.last_error() == "fmi2GetDirectionalDerivative: no derivative at this drive"


def test_a_derivative_that_is_no_number_is_an_error(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    assert slave.set([VR["load"]], [0.0]) == OK
    assert _derivative(slave, ["mixed", "reciprocal"], ["load"], [1.0]) is None
    assert "reciprocal: the derivative is not a finite number" in slave.last_error()
    assert _derivative(slave, ["mixed"], ["load"], [1.0]) == [0.5]


def test_output_derivatives_are_not_provided(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    one = (ctypes.c_int * 1)(1)
    status = slave.GetRealOutputDerivatives(
        (ctypes.c_uint * 1)(VR["x_1"]), ctypes.c_size_t(1), one, (ctypes.c_double * 1)()
    )
    assert status == ERROR


def test_status_questions_that_have_no_answer_are_discarded(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    number, text, flag = ctypes.c_int(), ctypes.c_char_p(), ctypes.c_int(7)
    assert slave.GetIntegerStatus(0, ctypes.byref(number)) == DISCARD
    assert slave.GetRealStatus(0, ctypes.byref(ctypes.c_double())) == DISCARD
    assert slave.GetStringStatus(1, ctypes.byref(text)) == OK
    assert slave.GetBooleanStatus(3, ctypes.byref(flag)) == OK
    assert flag.value == 0
    assert slave.GetStatus(0, None) == ERROR


def test_every_log_category_of_the_description_is_known(new_slave: NewSlave) -> None:
    root = ET.fromstring(model_description(lti.INTERFACE, GUID))
    listed = [category.get("name", "") for category in root.iter("Category")]
    assert len(listed) == 5
    names = (ctypes.c_char_p * len(listed))(*[name.encode() for name in listed])
    assert new_slave().SetDebugLogging(1, ctypes.c_size_t(len(listed)), names) == OK


def test_log_categories(new_slave: NewSlave) -> None:
    quiet, loud = new_slave().start(), new_slave(logging=True).start()
    assert quiet.log == []
    assert [entry[1] for entry in loud.log] == ["logEvents"]
    names = (ctypes.c_char_p * 1)(b"logStatusError")
    assert quiet.SetDebugLogging(0, ctypes.c_size_t(1), names) == OK
    assert quiet.step(0.0, -1.0) == ERROR
    assert quiet.log == []
    assert quiet.SetDebugLogging(1, ctypes.c_size_t(1), names) == OK
    assert quiet.step(0.0, -1.0) == ERROR
    assert len(quiet.log) == 1
    names[0] = b"logNoise"
    assert quiet.SetDebugLogging(1, ctypes.c_size_t(1), names) == ERROR
    assert "unknown log category logNoise" in quiet.last_error()


def alarms(slave: Slave) -> list[str]:
    """The functions that said it."""
    said = ": x_1 has gone beyond 40 (reported once)"
    found = [(status, category, text) for status, category, text in slave.log if said in text]
    assert all(one[:2] == (WARNING, "logStatusWarning") for one in found)
    return [text.removesuffix(said) for *_, text in found]


def test_an_alarm_of_the_model_is_logged_once_and_the_steps_go_on(new_slave: NewSlave) -> None:
    slave = new_slave()
    for times in (1, 2):
        slave.start(v1=-200.0)
        assert slave.set([VR["load"]], [-1e5]) == OK
        assert [slave.step(0.001 * k, 0.001) for k in range(50)] == [OK] * 50
        assert alarms(slave) == ["fmi2DoStep"] * times
        assert slave.Reset() == OK


def test_an_alarm_in_model_exchange_is_logged_once(new_sampled: NewSlave) -> None:
    slave = new_sampled(kind=MODEL_EXCHANGE).start(v1=-200.0).run()
    for k in range(1, 50):
        slave.event(0.001 * k, [VR["load"]], [-1e5])
    assert alarms(slave) == ["fmi2NewDiscreteStates"]


def test_an_alarm_at_the_start_is_logged_when_initialisation_ends(new_slave: NewSlave) -> None:
    slave = new_slave().start(v1=-260.0)
    assert [slave.step(0.001 * k, 0.001) for k in range(3)] == [OK, OK, OK]
    assert alarms(slave) == ["fmi2ExitInitializationMode"]
