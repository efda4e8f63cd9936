"""Defects planted in the C code, one FMU each: they are found, and crashes stay in their process."""

from __future__ import annotations

from pathlib import Path

import pytest

from check.defects import entries_of, finding, replaced, with_description, write
from check.planted import Changes, with_binary
from fmu_builder.check import Options, Severity, check_fmu
from fmu_builder.check.behaviour import runner
from fmu_builder.check.behaviour.worker import EXPERIMENTS
from fmu_builder.compiler import host_platform

ENDLESS = "    volatile int on = 1;\n    while (on) {\n    }\n"
BEGIN = "    const double begin = slave_position(slave, time);\n"
OUTPUTS = "    model_outputs(&slave->model, slave->values);\n"
WHILE_DUE = "    while (slave_tick_is_due(slave, end)) {\n"
ONE_MORE = "    if (begin <= 0.0) { (void)model_tick(&slave->model, time, slave->latched, message); }\n"
SHARED = "    static double last;\n    model->state[0] = first + 1e-3 * (last - first);\n    last = first;\n"
POINTER = "    *(fmi2FMUstate *)(void *)serializedState = FMUstate;\n"
FROM_POINTER = (
    "    *FMUstate = *(const fmi2FMUstate *)(const void *)bytes;\n"
    "    if (size > 0) {\n        return fmi2OK;\n    }\n"
    "    const char *trouble = snapshot_check(bytes, size);\n"
)

# name of the defect -> (rule that must find it, experiment, changes)
DEFECTS: dict[str, tuple[str, str, Changes]] = {
    "wrong GUID accepted": (
        "wrong-guid", "wrong GUID",
        (("functions.c", "fmuGUID == NULL || !same_text(fmuGUID, MODEL_GUID)", "fmuGUID == NULL"),),
    ),
    "first output shifted: nothing before the first step": (
        "first-output", "first output",
        (("slave.c", OUTPUTS, "    if (slave->time > slave->start_time) {\n    " + OUTPUTS + "    }\n"),),
    ),
    "first output shifted: nothing before the first tick": (
        "first-output", "first output",
        (("slave.c", OUTPUTS, "    if (slave->tick > 0) {\n    " + OUTPUTS + "    }\n"),),
    ),
    "first output shifted: one tick too many at the start": (
        "first-output", "first output",
        (("slave.c", WHILE_DUE, ONE_MORE + WHILE_DUE),),
    ),
    "first output shifted: the first step does nothing": (
        "first-output", "first output", (("slave.c", "    slave->tick = 0;\n", "    slave->tick = 1;\n"),),
    ),
    "one tick per step whatever its size": (
        "step-size", "communication steps", (("slave.c", WHILE_DUE, WHILE_DUE.replace("while", "if")),),
    ),
    "multiples of the tick demanded": (
        "step-size", "communication steps",
        (("slave.c", "    } else if (step <= 0.0) {",
          "    } else if (step < 0.999 * slave->sample_time) {"),),
    ),
    "tick lost after an hour": (
        "tick-lost", "an hour",
        (("slave.c", "#define TICK_TOLERANCE 0.01\n", "#define TICK_TOLERANCE 1e-6\n"),),
    ),
    "tick lost in a time of its own": (
        "tick-lost", "an hour",
        (("slave.c", "#define TICK_TOLERANCE 0.01\n", "#define TICK_TOLERANCE 1e-6\n"),
         ("slave.c", BEGIN, "    time = slave->time;\n" + BEGIN)),
    ),
    "state with pointers": (
        "state-bytes", "state in another process",
        (("saved_states.c",
          "    snapshot_write((const Slave *)FMUstate, (unsigned char *)serializedState);\n", POINTER),
         ("saved_states.c", "    const char *trouble = snapshot_check(bytes, size);\n", FROM_POINTER)),
    ),
    "length of a state not checked": (
        "state-length", "state",
        (("saved_states.c",
          "    snapshot_write((const Slave *)FMUstate, (unsigned char *)serializedState);\n", POINTER),
         ("saved_states.c", "    const char *trouble = snapshot_check(bytes, size);\n", FROM_POINTER)),
    ),
    "state without the inputs": (
        "state", "state",
        (("saved_states.c", "    instance->slave = *(const Slave *)FMUstate;\n",
          "    instance->slave.model = ((const Slave *)FMUstate)->model;\n"),),
    ),
    "instances share memory": (
        "two-instances", "two instances", (("lti_model.c", "    model->state[0] = first;\n", SHARED),),
    ),
    "reset forgets nothing": (
        "reset", "reset",
        (("functions.c", "    slave_reset(&instance->slave);\n    for",
          "    instance->slave.mode = MODE_INSTANTIATED;\n    for"),),
    ),
    "step after terminate": (
        "step-after-terminate", "illegal calls",
        (("instance.c", "LEGAL_DoStep = ", "LEGAL_DoStep = MODE_TERMINATED | "),),
    ),
    "unknown value references read": (
        "crash", "illegal calls",
        (("instance.c", "if (vr[k] >= VARIABLE_COUNT) {", "if (vr[k] == 0 && count > 99) {"),),
    ),
    "not-a-number accepted": (
        "not-a-number", "illegal calls",
        (("instance.c", "    } else if (!is_finite(value)) {", "    } else if (causality > 99) {"),
         ("instance.c", "        if (!is_finite(instance->slave.values[vr[k]]))", "        if (vr[k] > 99)")),
    ),
    "steps of no length": (
        "step-zero", "illegal calls",
        (("slave.c", "    } else if (step <= 0.0) {", "    } else if (step < 0.0) {"),),
    ),
    "steps backwards": (
        "step-illegal", "illegal calls",
        (("slave.c", "    } else if (step <= 0.0) {", "    } else if (step < -1e300) {"),),
    ),
    "input derivatives without effect": (
        "input-derivatives", "derivatives",
        (("slave.c", "slave->input_derivative[k] * ahead;", "slave->input_derivative[k] * (0.0 * ahead);"),),
    ),
    "directional derivative doubled": (
        "directional-derivative", "derivatives",
        (("derivatives.c", "dvUnknown[k] = ", "dvUnknown[k] = 2.0 * "),),
    ),
    "setting does not store": (
        "set-get", "set and get",
        (("functions.c", "instance->slave.values[vr[k]] = as_double(value[k]); ",
          "instance->slave.values[vr[k]] = 1.5 * as_double(value[k]); "),),
    ),
    "errors without a word": (
        "no-message", "illegal calls",
        (("instance.c", "    if (instance->logger != NULL && (instance->logged & kind) != 0) {",
          "    if (instance->logger != NULL && status == fmi2OK) {"),),
    ),
    "does not return": (
        "hang", "run", (("lti_model.c", "    if (inputs[VARIABLE_drive] > 8.0) {\n",
                         ENDLESS + "    if (inputs[VARIABLE_drive] > 8.0) {\n"),),
    ),
    "ends the process": (
        "crash", "run", (("lti_model.c", "    const double determinant =",
                          "    void exit(int);\n    exit(3);\n    const double determinant ="),),
    ),
    "event indicators refused": (
        "event-indicators", "model exchange",
        (("instance.c", "LEGAL_GetEventIndicators = ONLY_MODEL_EXCHANGE | MODE_READABLE",
          "LEGAL_GetEventIndicators = ONLY_MODEL_EXCHANGE | MODE_EVENT"),),
    ),
    "event indicators that are no numbers": (
        "event-indicators", "model exchange",
        (("lti_model.c", "    indicators[1] = values",
          "    indicators[1] = 0.0 / (values[0] - values[0]) + values"),),
    ),
    "event indicators that remember": (
        "event-indicators", "model exchange",
        (("lti_model.c", "    indicators[1] = values",
          "    static double before;\n    before = 0.5 * before + model->state[0];\n"
          "    indicators[1] = before + values"),),
    ),
    "prints": (
        "prints", "run", (("lti_model.c", "    const double determinant =",
                           '    int puts(const char *);\n    puts("x");\n    const double determinant ='),),
    ),
}  # fmt: skip


ESCAPES = '"no steady state for \\033[31mdrive = \\n"'


def only(experiment: str, time_limit: float = 60.0) -> Options:
    needed = ("state", "communication steps", experiment)
    chosen = needed if experiment in ("state in another process", "an hour") else (experiment,)
    return Options(sources=False, experiments=chosen, time_limit=time_limit)


def test_nothing_is_found_on_the_right_fmu(right_fmu: Path) -> None:
    report = check_fmu(right_fmu, Options(sources=False, time_limit=600.0))
    assert report.findings == (), report.text()
    assert set(EXPERIMENTS) <= set(report.checked)


@pytest.mark.parametrize("defect", DEFECTS)
def test_planted_defect_is_found(defect: str, right_fmu: Path, tmp_path: Path) -> None:
    rule, experiment, changes = DEFECTS[defect]
    options = only(experiment, 5.0 if rule == "hang" else 60.0)
    found = finding(with_binary(right_fmu, tmp_path, changes), rule, options)
    assert found.what and found.mend and "FMI 2.0.4" in found.paragraph


def test_after_a_crash_the_other_calls_are_still_made(right_fmu: Path, tmp_path: Path) -> None:
    """NULL is dereferenced by four calls, and steps backwards are accepted: all five are said."""
    changes = (
        ("instance.c", "(count > 0 && (vr == NULL || values == NULL))", "(count > 99 && values == NULL)"),
        ("slave.c", "    } else if (step <= 0.0) {", "    } else if (step < -1e300) {"),
    )
    report = check_fmu(with_binary(right_fmu, tmp_path, changes), only("illegal calls"))
    crashes = {item.place: item.severity for item in report.findings if item.rule == "crash"}
    assert set(crashes) == {
        f"fmi2{verb}Real with {what} NULL"
        for verb in ("Get", "Set")
        for what in ("value references", "values")
    }
    assert set(crashes.values()) == {Severity.WARNING}
    assert any(item.rule == "step-illegal" for item in report.findings)


def test_an_hour_that_would_take_too_long_is_cut_and_said(right_fmu: Path, monkeypatch) -> None:
    monkeypatch.setattr(runner, "_BUDGET_SHARE", 0.0)
    found = finding(right_fmu, "hour-cut", only("an hour"))
    assert found.severity is Severity.NOTE and "0 s of model time" in found.what


def test_an_input_that_acts_at_once_without_being_named_is_found(right_fmu: Path, tmp_path: Path) -> None:
    change = replaced('index="5" dependencies="2 3 8"', 'index="5" dependencies="3 8"')
    fmu = with_description(right_fmu, tmp_path / "lti_test.fmu", change)
    found = finding(fmu, "hidden-feedthrough", only("set and get"))
    assert "'mixed'" in found.place and "'load'" in found.what


def test_a_state_that_acts_without_being_named_is_found(right_fmu: Path, tmp_path: Path) -> None:
    change = replaced('index="4" dependencies="8"', 'index="4" dependencies=""')
    fmu = with_description(right_fmu, tmp_path / "lti_test.fmu", change)
    found = finding(fmu, "hidden-dependency", only("model exchange"))
    assert "'scaled'" in found.place and "'x_2'" in found.what


def test_a_description_of_another_binary_is_found(right_fmu: Path, tmp_path: Path) -> None:
    fmu = with_description(right_fmu, tmp_path / "a.fmu", replaced('guid="{', 'guid="{0'))
    found = finding(fmu, "instantiate", only("run"))
    assert "GUID is not that of this FMU" in found.what


def test_a_terminal_does_not_obey_what_an_fmu_says(right_fmu: Path, tmp_path: Path) -> None:
    changes = (
        ("lti_model.c", '"no steady state for drive = "', ESCAPES),
        (
            "lti_model.c",
            "    if (inputs[VARIABLE_drive] > 5.0) {",
            "    if (inputs[VARIABLE_drive] > -5.0) {",
        ),
    )
    report = check_fmu(with_binary(right_fmu, tmp_path, changes), only("run"))
    assert not report.passed
    (line,) = [line for line in report.text().splitlines() if "no steady state" in line]
    assert r"\x1b[31mdrive = \n" in line and "\x1b" not in line


def test_without_a_binary_for_this_machine_that_is_said(right_fmu: Path, tmp_path: Path) -> None:
    gone = f"binaries/{host_platform()}/"
    entries = {name: c for name, c in entries_of(right_fmu).items() if not name.startswith(gone)}
    fmu = write(tmp_path / "lti_test.fmu", entries.items())
    assert finding(fmu, "not-run", Options(sources=False)).severity is Severity.NOTE
