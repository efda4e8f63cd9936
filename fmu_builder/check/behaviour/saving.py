"""Setting, saving and restoring: what comes back is what was there, in this process and in another."""

from __future__ import annotations

import base64
import ctypes

from fmu_builder.check.behaviour.comparing import Rows, difference, spans
from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.instance import STATUS_NAMES, WARNING, Instance, Library
from fmu_builder.check.behaviour.plan import Plan
from fmu_builder.check.finding import Severity, practice, standard

_VALUES = standard("2.1.7")
_STATE = standard("2.1.8")
_STRUCTURE = standard("2.2.8")
_BEFORE, _AFTER = 37, 40
_LONGEST_STATE = 256 << 20


def set_get(plan: Plan, diary: Diary) -> None:
    """Setting an input only stores it: read it back, set another, set the first again."""
    library = Library(plan)
    diary.doing("setting and getting inputs", _VALUES)
    instance, twin = Instance(library), Instance(library)
    for one in (instance, twin):
        one.begin()
        one.set_inputs(plan.moved())
    if instance.run(5, plan.step) is None or twin.run(5, plan.step) is None:
        return
    before = instance.get_outputs()
    for variable, wanted in zip(plan.inputs, plan.moved(0.5), strict=True):
        instance.set(variable, wanted)
        status, value = instance.get(variable)
        if status > WARNING or value != wanted:
            what = f"reads {value!r} after {wanted!r} was set"
            place, mend = f"input {variable.name!r}", "Return what was set"
            diary.find(Severity.ERROR, "set-get", place, what, _VALUES, mend)
    if before is not None:
        _direct_effects(library, diary, before)
    instance.get_outputs()
    instance.set_inputs(plan.moved())
    again = instance.get_outputs()
    if before is not None and again != before:
        what = "do not return when inputs are set away and back without a step"
        mend = "Let fmi2SetReal store only, and compute outputs from what stands"
        diary.find(Severity.ERROR, "set-get", "outputs", what, _VALUES, mend)
    if instance.run(20, plan.step, 5) != twin.run(20, plan.step, 5):
        what = "goes on otherwise after inputs were set away and back without a step"
        mend = "Use the inputs that stand when fmi2DoStep is called"
        diary.find(Severity.ERROR, "set-get", "fmi2DoStep", what, _VALUES, mend)


def _direct_effects(library: Library, diary: Diary, before: list[float]) -> None:
    """Outputs that move when an input is set must name it among their dependencies."""
    plan = library.plan
    for k, variable in enumerate(plan.inputs):
        diary.doing(f"what setting {variable.name!r} does at once", _STRUCTURE)
        instance = Instance(library)
        instance.begin()
        instance.set_inputs(plan.moved())
        if instance.run(5, plan.step) is None:
            return
        values = plan.moved()
        values[k] = variable.moved(0.6 * float(plan.found.get("scale", 0.0)))
        instance.set_inputs(values)
        at_once = instance.get_outputs()
        instance.free()
        if at_once is None:
            continue
        for output, old, new in zip(plan.outputs, before, at_once, strict=True):
            named = output.depends_on
            if old != new and named is not None and variable.name not in named:
                what = f"follows the input {variable.name!r} at once, but its dependencies do not name it"
                mend = "Name every input that acts without a step: masters order FMUs by it"
                diary.find(
                    Severity.ERROR, "hidden-feedthrough", f"output {output.name!r}", what, _STRUCTURE, mend
                )


def _path(library: Library) -> Instance | None:
    """Return an instance in the middle of a run, the same in every process."""
    plan = library.plan
    instance = Instance(library)
    instance.begin()
    instance.set_inputs(plan.moved())
    return None if instance.run(_BEFORE, plan.step) is None else instance


def _rest(instance: Instance) -> Rows | None:
    plan = instance.plan
    rows = []
    for k in range(_BEFORE, _BEFORE + _AFTER):
        instance.set_inputs(plan.moved(0.5 + 0.1 * (k % 5)))
        if instance.step(k * plan.step, plan.step) > WARNING:
            return None
        values = instance.get_outputs()
        if values is None:
            return None
        rows.append(values)
    return rows


def _differs(plan: Plan, diary: Diary, rule: str, how: str, expected: Rows, found: Rows | None) -> bool:
    if found == expected:
        return False
    if found is None:
        what = f"cannot go on {how}"
    else:
        gap, name = difference(expected, found, plan.outputs, spans(plan.outputs, expected))
        what = f"goes on otherwise {how}: {name!r} differs by {100 * gap:.2g} % of its movement"
    mend = "Save everything that later values depend on, as values and not as addresses"
    diary.find(Severity.ERROR, rule, "FMU state", what, _STATE, mend)
    return True


def state(plan: Plan, diary: Diary) -> None:
    """Save, go on, restore, go on: the same bits; then the state as bytes."""
    if "canGetAndSetFMUstate" not in plan.abilities:
        return
    library = Library(plan)
    diary.doing("fmi2GetFMUstate", _STATE)
    instance = _path(library)
    if instance is None:
        return
    saved = instance.save()
    expected = _rest(instance)
    if saved is None or expected is None:
        _refused(diary, instance, "fmi2GetFMUstate")
        return
    diary.doing("fmi2SetFMUstate", _STATE)
    if library.SetFMUstate(instance.component, saved) > WARNING:
        _refused(diary, instance, "fmi2SetFMUstate")
        return
    _differs(plan, diary, "state", "after fmi2SetFMUstate", expected, _rest(instance))
    if "canSerializeFMUstate" in plan.abilities:
        _serialise(plan, diary, instance, saved, expected)
    diary.doing("fmi2FreeFMUstate", _STATE)
    library.FreeFMUstate(instance.component, ctypes.byref(saved))
    if saved.value:
        what, mend = "does not set its argument to NULL", "Set it: a caller may free it twice"
        diary.find(Severity.WARNING, "state", "fmi2FreeFMUstate", what, _STATE, mend)
    library.FreeFMUstate(instance.component, ctypes.byref(saved))
    instance.free()


def _refused(diary: Diary, instance: Instance, function: str) -> None:
    said = f"; it says: {instance.messages[-1][:200]}" if instance.messages else ""
    mend = "Make it work between communication steps, or do not declare the capability"
    diary.find(Severity.ERROR, "state", function, "fails" + said, _STATE, mend)


def _serialise(plan: Plan, diary: Diary, instance: Instance, saved: ctypes.c_void_p, expected: Rows) -> None:
    diary.doing("fmi2SerializeFMUstate", _STATE)
    content = instance.to_bytes(saved)
    if content is None or len(content) > _LONGEST_STATE:
        _refused(diary, instance, "fmi2SerializeFMUstate")
        return
    diary.know(saved_state=base64.b64encode(content).decode("ascii"), after_state=[list(r) for r in expected])
    diary.doing("fmi2DeSerializeFMUstate", _STATE)
    status, restored = instance.from_bytes(content)
    if status > WARNING or instance.library.SetFMUstate(instance.component, restored) > WARNING:
        _refused(diary, instance, "fmi2DeSerializeFMUstate")
        return
    _differs(plan, diary, "state", "after a state that went through bytes", expected, _rest(instance))
    for length in (0, 1, len(content) // 2, len(content) - 1):
        call = f"fmi2DeSerializeFMUstate with {length} of {len(content)} bytes"
        if diary.doing(call, _STATE) and length < len(content):
            status, _ = instance.from_bytes(content[:length])
            if status <= WARNING:
                what, mend = f"returns {STATUS_NAMES[status]}", "Check the length before reading"
                diary.find(Severity.ERROR, "state-length", call, what, _STATE, mend)


def restore(plan: Plan, diary: Diary) -> None:
    """The state of another process: the same bytes here, and the same values from there on."""
    text, expected = plan.found.get("saved_state"), plan.found.get("after_state")
    if text is None or expected is None:
        return
    content = base64.b64decode(text)
    library = Library(plan)
    diary.doing("saving a state in a second process", _STATE)
    instance = _path(library)
    saved = None if instance is None else instance.save()
    if instance is None or saved is None:
        return
    if instance.to_bytes(saved) != content:
        what = (
            "as bytes differs between two processes that did the same: it holds addresses or memory never set"
        )
        mend = "Write values in a fixed order and set all memory before use"
        diary.find(Severity.WARNING, "state-bytes", "FMU state", what, practice("reproducibility"), mend)
    diary.doing("restoring the state of another process", _STATE)
    fresh = Instance(library)
    fresh.begin()
    status, restored = fresh.from_bytes(content)
    if status > WARNING or library.SetFMUstate(fresh.component, restored) > WARNING:
        _refused(diary, fresh, "fmi2DeSerializeFMUstate in another process")
        return
    diary.doing("stepping on from the state of another process", _STATE)
    _differs(plan, diary, "state-process", "in another process", expected, _rest(fresh))
