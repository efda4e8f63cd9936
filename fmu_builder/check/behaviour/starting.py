"""Loading, instantiating, starting, and the first output."""

from __future__ import annotations

from fmu_builder.check.behaviour.comparing import Rows, all_finite, difference, spans
from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.instance import OK, STATUS_NAMES, WARNING, Instance, Library
from fmu_builder.check.behaviour.plan import Plan
from fmu_builder.check.finding import Severity, standard

_CREATION = standard("2.1.5")
_START = standard("2.1.6")
_SCALES = (0.05, 0.005, 0.0005, 0.0)
_TRIAL_STEPS = 300
_RESPONSE_STEPS = 20
_LATER = 60
_TINY = 1e-3  # of the communication step
_SHIFTED = 0.02  # of the response: more is no rounding


def load(plan: Plan, diary: Diary) -> None:
    """Does the library load, and say what it is?"""
    diary.doing("loading the library", standard("2.3"))
    try:
        library = Library(plan)
    except OSError as reason:
        diary.find(
            Severity.ERROR, "load", "binary for this machine", f"does not load ({reason})", standard("2.3"),
            "Link it with everything it needs; the loader names what is missing",
        )  # fmt: skip
        return
    except AttributeError as reason:
        diary.find(
            Severity.ERROR, "missing-function", "binary for this machine", str(reason), standard("2.1.1"),
            "Export every function of the interface",
        )  # fmt: skip
        return
    diary.know(loaded=True)
    for name, wanted in (("GetVersion", b"2.0"), ("GetTypesPlatform", b"default")):
        diary.doing(f"fmi2{name}", standard("2.1.4"))
        answer = getattr(library, name)()
        if answer != wanted:
            what, mend = (
                f"returns {answer!r}, not {wanted.decode()!r}",
                "Return what fmi2TypesPlatform.h defines",
            )
            diary.find(Severity.ERROR, "version", f"fmi2{name}", what, standard("2.1.4"), mend)


def wrong_guid(plan: Plan, diary: Diary) -> None:
    """An FMU whose description was exchanged must not start."""
    library = Library(plan)
    for guid in ("{00000000-0000-0000-0000-000000000000}", plan.guid + "x", ""):
        if not diary.doing(f"fmi2Instantiate with the GUID {guid!r}", _CREATION):
            continue
        instance = Instance(library, guid=guid)
        if instance.component:
            what = f"succeeds with the GUID {guid!r}, which is not that of the description"
            mend = "Compare fmuGUID with the GUID the code was generated for, and return NULL"
            diary.find(Severity.ERROR, "wrong-guid", "fmi2Instantiate", what, _CREATION, mend)
            return


def run(plan: Plan, diary: Diary) -> None:
    """Start it with its start values and let it run; find how far the inputs can be moved."""
    library = Library(plan)
    diary.doing("fmi2Instantiate", _CREATION)
    instance = Instance(library)
    if not instance.component:
        what = "returns NULL" + _said(instance)
        mend = "Make it instantiate with the GUID of the description, without a window and without logging"
        diary.find(Severity.ERROR, "instantiate", "fmi2Instantiate", what, _CREATION, mend)
        return
    diary.doing("initialisation with the start values", _START)
    status = instance.begin()
    if status > WARNING:
        what = f"returns {STATUS_NAMES[status]} with the start values of the description" + _said(instance)
        diary.find(
            Severity.ERROR, "initialise", "initialisation", what, _START, "Start values must be able to start"
        )
        return
    values = instance.get_outputs()
    if values is None or not all_finite([values]):
        what = "cannot be read, or are not finite, after initialisation" + _said(instance)
        diary.find(Severity.ERROR, "first-output", "outputs", what, _START, "Compute them in initialisation")
        return
    instance.free()
    if not plan.can_step:
        diary.know(runs=True)
        return
    for scale in _SCALES:
        diary.doing("fmi2DoStep with inputs near their start values", standard("4.2.2"))
        trial = Instance(library)
        trial.begin()
        set_status = trial.set_inputs([variable.moved(scale) for variable in plan.inputs])
        rows = trial.run(_TRIAL_STEPS, plan.step) if set_status <= WARNING else None
        if rows is not None and all_finite(rows):
            diary.know(runs=True, scale=scale)
            return
        said = _said(trial)
        trial.free()
    what = f"fails within {_TRIAL_STEPS} steps of {plan.step:g} s with the start values" + said
    diary.find(
        Severity.ERROR, "run", "fmi2DoStep", what, standard("4.2.2"), "Make it run with what it proposes"
    )


def _said(instance: Instance) -> str:
    return f"; it says: {instance.messages[-1][:200]}" if instance.messages else ""


def first_output(plan: Plan, diary: Diary) -> None:
    """Outputs before the first step: there, settled, and not a step late or early."""
    library = Library(plan)
    diary.doing("outputs before the first step", _START)
    instance = Instance(library)
    instance.begin()
    first = instance.get_outputs()
    tiny = instance.run(3, _TINY * plan.step)
    instance.free()
    if first is not None and tiny is not None:
        _compare_with_tiny_steps(plan, diary, first, tiny)
    diary.doing("the response to a change of the inputs at the start and later", standard("4.2.2"))
    start = [variable.start or 0.0 for variable in plan.inputs]
    at_once = _response(library, start, 0)
    later = _response(library, start, _LATER)
    if at_once is not None and later is not None:
        _compare_responses(plan, diary, at_once, later)


def _compare_with_tiny_steps(plan: Plan, diary: Diary, first: list[float], tiny: Rows) -> None:
    for column, variable in enumerate(plan.outputs):
        jump = abs(tiny[0][column] - first[column])
        drift = max(abs(tiny[2][column] - tiny[1][column]), abs(tiny[1][column] - tiny[0][column]))
        size = max(abs(tiny[0][column]), abs(first[column]), 1e-12 * variable.size)
        if variable.variability == "continuous" and jump > 1e-6 * size and jump > 100.0 * drift:
            what = (
                f"is {first[column]:g} before the first step and {tiny[0][column]:g} after a step of"
                f" {_TINY * plan.step:g} s"
            )
            mend = "Compute the outputs of the start in initialisation, not in the first step"
            diary.find(Severity.ERROR, "first-output", f"output {variable.name!r}", what, _START, mend)


def _response(library: Library, start: list[float], wait: int) -> Rows | None:
    """Return the outputs after `wait` steps at rest and from there on with moved inputs."""
    plan = library.plan
    instance = Instance(library)
    instance.begin()
    if instance.set_inputs(start) > WARNING:
        return None
    before = instance.run(wait, plan.step) if wait else []
    resting = instance.get_outputs()
    status = instance.set_inputs(plan.moved())
    after = instance.run(_RESPONSE_STEPS, plan.step, wait)
    instance.free()
    if before is None or resting is None or after is None or status > OK:
        return None
    return [*before, resting, *after]


def _compare_responses(plan: Plan, diary: Diary, at_once: Rows, later: Rows) -> None:
    """A model that rests at its start answers the same at any time; one that does not is not judged."""
    rest, late = later[1 : _LATER + 1], later[_LATER:]
    sizes = spans(plan.outputs, at_once)
    settled, _ = difference(rest, [rest[0]] * len(rest), plan.outputs, sizes)
    if settled > 1e-6:
        return
    for column, variable in enumerate(plan.outputs):
        first, then = later[0][column], rest[0][column]
        if variable.variability == "continuous" and abs(first - then) > _SHIFTED * sizes[column]:
            what = f"is {first:g} before the first step and {then:g} from then on, with inputs that stay"
            mend = "Compute the outputs of the start in initialisation, not in the first step"
            diary.find(Severity.ERROR, "first-output", f"output {variable.name!r}", what, _START, mend)
            return
    gap, name = difference(at_once, late, plan.outputs, sizes)
    if gap <= _SHIFTED:
        return
    ahead, _ = difference(at_once[1:-1], late[2:], plan.outputs, sizes)
    behind, _ = difference(at_once[2:], late[1:-1], plan.outputs, sizes)
    shifted = min(ahead, behind) <= 1e-6
    what = (
        f"answers a change of the inputs at the start {'one step ' if shifted else ''}"
        f"{'early' if ahead <= behind else 'late' if shifted else 'otherwise than later'}"
    )
    severity = Severity.ERROR if shifted else Severity.WARNING
    mend = "The first step uses the inputs set before it, and goes exactly one step"
    diary.find(severity, "first-output", f"output {name!r}", what, standard("4.2.2"), mend)


def reset(plan: Plan, diary: Diary) -> None:
    """After fmi2Reset it must run as at first."""
    library = Library(plan)
    diary.doing("fmi2Reset", _START)
    instance = Instance(library)
    instance.begin()
    instance.set_inputs(plan.moved())
    before = instance.run(50, plan.step) if plan.can_step else [instance.get_outputs() or []]
    status = library.Reset(instance.component)
    if status > WARNING:
        what = f"returns {STATUS_NAMES[status]}" + _said(instance)
        diary.find(
            Severity.ERROR, "reset", "fmi2Reset", what, _START, "Return to the state after fmi2Instantiate"
        )
        return
    if instance.begin() > WARNING:
        what = "cannot be initialised after fmi2Reset" + _said(instance)
        diary.find(
            Severity.ERROR, "reset", "fmi2Reset", what, _START, "Return to the state after fmi2Instantiate"
        )
        return
    instance.set_inputs(plan.moved())
    after = instance.run(50, plan.step) if plan.can_step else [instance.get_outputs() or []]
    instance.free()
    if before is not None and after is not None and before != after:
        sizes = spans(plan.outputs, before)
        gap, name = difference(before, after, plan.outputs, sizes)
        what = f"does not forget everything: {name!r} differs by {100 * gap:.2g} % of its movement"
        mend = "Return every variable to its start value and clear all memory"
        diary.find(Severity.ERROR, "reset", "fmi2Reset", what, _START, mend)
    diary.doing("fmi2Terminate and fmi2FreeInstance", _START)
    last = Instance(library)
    last.begin()
    if library.Terminate(last.component) > WARNING:
        what = "fmi2Terminate fails" + _said(last)
        mend = "Let a simulation end"
        diary.find(Severity.ERROR, "terminate", "fmi2Terminate", what, _START, mend)
    last.free()


def two_instances(plan: Plan, diary: Diary) -> None:
    """Two instances in one process share nothing."""
    if "canBeInstantiatedOnlyOncePerProcess" in plan.abilities:
        return
    library = Library(plan)
    diary.doing("two instances in one process", _CREATION)
    alone = _alternating(library, 1)
    together = _alternating(library, 2)
    if together is None:
        mend = "Keep all memory in the instance, or declare canBeInstantiatedOnlyOncePerProcess"
        diary.find(
            Severity.ERROR, "two-instances", "fmi2Instantiate", "fails for a second instance", _CREATION, mend
        )
    elif alone is not None and alone != together:
        gap, name = difference(alone, together, plan.outputs, spans(plan.outputs, alone))
        what = f"changes when a second instance runs: {name!r} by {100 * gap:.2g} % of its movement"
        mend = "Keep all memory in the instance, none in static variables"
        diary.find(Severity.ERROR, "two-instances", "two instances", what, _CREATION, mend)


def _alternating(library: Library, count: int) -> Rows | None:
    """Return the outputs of the first of `count` instances that take turns; the second is freed halfway."""
    plan = library.plan
    instances = [Instance(library, name=b"check_%d" % k) for k in range(count)]
    if not all(instance.component for instance in instances):
        return None
    if max(instance.begin() for instance in instances) > WARNING:
        return None
    rows = []
    for k in range(40):
        if k == 20:
            for instance in instances[1:]:
                instance.free()
        for place, instance in enumerate(instances):
            if not instance.component:
                continue
            instance.set_inputs(plan.moved(1.0 if place == 0 else 0.3))
            if plan.can_step and instance.step(k * plan.step, plan.step) > WARNING:
                return None
        rows.append(instances[0].get_outputs() or [])
    instances[0].free()
    return rows
