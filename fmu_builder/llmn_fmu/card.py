"""The model card inside an FMU: one static page that says what the model is and where it holds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from itertools import pairwise

from pydantic import JsonValue

from fmu_builder.fmi2 import Interface, Variable
from fmu_builder.kernel import contact_of
from fmu_builder.llmn_fmu.variables import OUT_OF_RANGE, conditions, region_limits
from fmu_builder.parameter_set import ParameterSet, StabilityProof

_OFFSETS = {
    "none": "Outputs are counted from the operating point; away from it they carry an offset.",
    "affine": "Affine terms x0, u0, y0 in every local model (thesis eq. 3.33-3.34) carry the offsets.",
    "low_pass": "The scheduling input is split by a low-pass of {corner} Hz: the slow part schedules and"
    " reads the static outputs from a look-up table, the rest drives the local models.",
    "scheduled_equilibrium": "States are deviations from the steady state of the present scheduling input;"
    " static outputs come from a look-up table over it.",
}
_BLENDING = {
    "output": "Every local model runs; their outputs are blended (thesis eq. 3.98).",
    "parameter": "The matrices of the local models are blended; one state (thesis eq. 3.100-3.101).",
    "theta": "The physical parameters of the local models are blended and discretised; one state.",
}
_STYLE = (
    "body{font-family:sans-serif;max-width:52em;margin:2em auto;padding:0 1em;line-height:1.45}"
    "table{border-collapse:collapse;margin:.6em 0}"
    "td,th{border:1px solid #bbb;padding:.2em .6em;text-align:left}"
)
_CHOICES = "choices"
"""Where the provenance keeps automatic choices: a list of objects."""
_CHOICE_COLUMNS = ("name", "value", "place", "reason")
_WARNINGS = "warnings"
"""Where the provenance keeps what makes the model doubtful: a list of objects."""
_WARNING_COLUMNS = ("place", "what", "mend")
_SCORE_COLUMNS = ("signal", "split", "data_set", "fit", "max_error")


def model_card(parameter_set: ParameterSet, shown: Interface, proof: StabilityProof | None = None) -> str:
    """Return documentation/index.html.

    What the model is, the range it was trained in, how the inputs act, what is proved of its stability, its
    variables, and the scores and provenance that the parameter set holds.
    """
    sections = [
        f"<h1>{escape(shown.model_name)}</h1>",
        _paragraph(shown.description + "."),
        _paragraph(parameter_set.documentation),
        *_told(parameter_set, _WARNINGS, "Warnings", _WARNING_COLUMNS),
        *_range(parameter_set),
        *_behaviour(parameter_set),
        *_stability(parameter_set, proof),
        *_variables(shown),
        *_parameters(shown),
        *_scores(parameter_set),
        *_bands(parameter_set),
        *_told(parameter_set, _CHOICES, "What was chosen automatically", _CHOICE_COLUMNS),
        *_provenance(parameter_set),
    ]
    head = f'<meta charset="utf-8"><title>{escape(shown.model_name)}</title><style>{_STYLE}</style>'
    body = "\n".join(section for section in sections if section)
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>{head}</head>\n<body>\n{body}\n</body>\n</html>\n'


def _range(parameter_set: ParameterSet) -> Iterator[str]:
    yield "<h2>Where it holds</h2>"
    rows = [
        (
            signal.name,
            signal.unit,
            _number(signal.minimum),
            _number(signal.operating_point),
            _number(signal.maximum),
        )
        for signal in (*parameter_set.inputs, *parameter_set.outputs)
    ]
    region = parameter_set.trained_region
    known = {} if region is None else region.derived_outputs
    rows += [
        (one.name, one.unit, _number(known[one.name][0]), "", _number(known[one.name][1]))
        for one in parameter_set.derived_outputs
        if one.name in known
    ]
    yield _table(("signal", "unit", "smallest in training", "operating point", "largest in training"), rows)
    low, high = parameter_set.partition.range
    scheduling = parameter_set.partition.scheduling
    yield _paragraph(
        f"Range of {scheduling}: {_number(low)} to {_number(high)}. Beyond it the weights of the local models"
        " stay as at the end of the range and a static map is continued in a straight line. Nothing is known"
        " about the accuracy there."
    )
    yield from _region(parameter_set)


def _region(parameter_set: ParameterSet) -> Iterator[str]:
    """What is watched, what is not, and what can be done about it."""
    region, scheduling = parameter_set.trained_region, parameter_set.partition.scheduling
    watched = ", ".join(
        ("in every tick of the last step the inputs lay in their limits", *region_limits(parameter_set))
    )
    yield _paragraph(
        f"in_range tells whether {watched}. Limits are the extremes of the training data, without a margin:"
        " other data of the same kind leave them now and then by a little. Derived outputs are those at the"
        " beginning of the tick, with its inputs. The first limit that is left goes to the log, once."
    )
    clamped = "with clamp (2) inputs are held at their limits"
    if region is not None:
        clamped += (
            f", {scheduling} follows no faster than in training, and derived outputs are worked out with"
        )
        clamped += f" what is left of {scheduling}"
    yield _paragraph(
        f"{OUT_OF_RANGE} says what an input outside does: with warn (1) it acts as it is; {clamped}; with"
        " error (3) the call is refused, and the instance can be reset. Outputs are never limited. An input"
        " held over a long communication step jumps, and the jump counts."
    )
    if region is None:
        yield _paragraph(f"How fast {scheduling} moved in training is not known, nor at which frequencies.")
    elif region.frequency_bands:
        bands = region.frequency_bands.items()
        yield _table(
            ("input", "moved in training from, Hz", "to, Hz"),
            [(name, f"{low:.3g}", f"{high:.3g}") for name, (low, high) in bands],
        )
        yield _paragraph("Frequencies are not watched: movement in other bands is extrapolation, too.")


def _behaviour(parameter_set: ParameterSet) -> Iterator[str]:
    yield "<h2>How it works</h2>"
    partition, offsets = parameter_set.partition, parameter_set.offsets
    centres = ", ".join(_number(centre) for centre in partition.centres)
    yield _paragraph(
        f"{len(parameter_set.local_models)} local linear models with {parameter_set.state_count} states,"
        f" centred at {partition.scheduling} = {centres};"
        f" validity functions: {partition.validity.replace('_', ', ')}."
        f" {_BLENDING[parameter_set.blending]}"
        f" {_OFFSETS[offsets.kind].format(corner=offsets.corner_frequency)}"
    )
    if partition.deviation_gain != 0.0:
        yield _paragraph(
            f"To {partition.scheduling} the schedule adds {partition.deviation_gain!r} times the deviation of"
            f" {partition.deviation_output} from its value at rest, as of the last tick."
        )
    yield _paragraph(
        f"The model runs on its own grid of {parameter_set.sample_time!r} s. In co-simulation any"
        " communication step is accepted; in model exchange there is a time event at every tick. A tick uses"
        " the inputs in force when it begins. Between ticks outputs hold, except where an input acts at once"
        " (see the table). The start is the steady state of the start inputs."
    )
    for derived in parameter_set.derived_outputs:
        terms = " ".join(
            f"{'+' if term.sign > 0 else '-'} {term.parameter} {term.signal}" for term in derived.terms
        )
        named = derived.parameters.items()
        values = ", ".join(f"{name} = {_number(item.value)} {item.unit}" for name, item in named)
        yield _paragraph(f"{derived.name} = {terms.removeprefix('+ ')}, {values}.")
    contact = contact_of(parameter_set)
    if contact is not None:
        pressed, wire = parameter_set.outputs[contact.output].name, partition.scheduling
        yield _paragraph(
            "The contact pulls as well as it presses, unless the parameter unilateral is set: then"
            f" min({wire}, {pressed}) acts in the place of {wire} on everything, force, schedule and rest;"
            f" for a tick with {pressed} in its middle. What the model was trained on was in contact:"
            " how well it flies is another question."
        )


def _stability(parameter_set: ParameterSet, proof: StabilityProof | None) -> Iterator[str]:
    yield "<h2>Stability</h2>"
    if proof is None:
        stored = " A certificate stored with the model was not proved when this FMU was built."
        yield _paragraph("Nothing is proved." + (stored if parameter_set.certificate is not None else ""))
        return
    yield _paragraph(proof.statement)
    yield _paragraph(proof.limits)
    if proof.rate is not None:
        yield _paragraph(
            f"Beyond the range of {parameter_set.partition.scheduling} weights are held and the proof holds,"
            " as it does for every change of direction. An input held over a long communication step jumps,"
            " and the jump counts."
        )
    if broken := conditions(parameter_set, proof):
        yield _paragraph(
            f"outside_certificate tells whether {', or '.join(broken)}. What has happened in a tick stays"
            " true, and the log says it once; parameters count as they are."
        )
    yield _paragraph(
        "llmn prove, or identification/stability/verify.py alone, makes the proof anew from"
        " resources/parameter_set.json."
    )


def _variables(shown: Interface) -> Iterator[str]:
    yield "<h2>Variables</h2>"
    rows = [
        (
            shown.shown_name(variable),
            variable.causality,
            variable.unit,
            ", ".join(variable.dependencies or ()),
            variable.description,
        )
        for variable in shown.variables
        if not _is_given(variable)
    ]
    yield _table(("name", "causality", "unit", "inputs that act at once", "description"), rows)


def _is_given(variable: Variable) -> bool:
    """Whether it is a parameter or a constant."""
    return variable.causality == "parameter" or variable.variability == "constant"


def _parameters(shown: Interface) -> Iterator[str]:
    given = [variable for variable in shown.variables if _is_given(variable)]
    if not given:
        return
    yield "<h2>Parameters and constants</h2>"
    if any(variable.variability == "tunable" for variable in given):
        yield _paragraph(
            "Tunable parameters may be set before the start, between communication steps and in event mode."
            " The model is then made anew: physical parameters are blended and discretised at every node,"
            " positions and velocities go on from where they are. What makes it unstable is refused. Scores,"
            " and any certificate of stability, belong to the start values only."
        )
    rows = [
        (
            shown.shown_name(variable),
            variable.variability,
            _number(variable.start),
            _number(variable.minimum),
            _number(variable.maximum),
            variable.unit,
            variable.description,
        )
        for variable in given
    ]
    yield _table(("name", "variability", "start", "smallest", "largest", "unit", "description"), rows)


def _scores(parameter_set: ParameterSet) -> Iterator[str]:
    if parameter_set.scores:
        yield "<h2>Scores</h2>"
        rows = [[_number(record.get(name)) for name in _SCORE_COLUMNS] for record in parameter_set.scores]
        yield _table(_SCORE_COLUMNS, rows)


def _bands(parameter_set: ParameterSet) -> Iterator[str]:
    """Tell how far off outputs were on held-out data: a row per height."""
    scheduling = parameter_set.inputs[parameter_set.scheduling_index]
    units = {item.name: item.unit for item in parameter_set.outputs}
    units |= {item.name: item.unit for item in parameter_set.derived_outputs}
    for one in parameter_set.residual_bands:
        yield f"<h2>How far off {escape(one.output)} is</h2>"
        yield _paragraph(
            f"What {_number(100.0 * one.coverage)} % of the errors on held-out data"
            f" ({', '.join(one.held_out)}) do not exceed [{units[one.output]}]; in brackets amplitude (model"
            " over reference) and phase (model less reference) [rad]. Bounds are estimates: other records"
            " keep them more or less often."
        )
        columns = [f"{low:g} to {high:g} Hz" for low, high in pairwise(one.frequencies)]
        rows = [
            (f"{low:g} to {high:g}", _number(seconds), _number(total), *(_banded(*cell) for cell in cells))
            for (low, high), seconds, total, *parts in zip(
                pairwise(one.positions),
                one.seconds,
                one.total,
                one.bound,
                one.amplitude,
                one.phase,
                strict=True,
            )
            for cells in [zip(*parts, strict=True)]
        ]
        yield _table((f"{scheduling.name} [{scheduling.unit}]", "data [s]", "all", *columns), rows)


def _banded(bound: float | None, amplitude: float | None, phase: float | None) -> str:
    unknown = amplitude is None or phase is None
    answer = "" if unknown else f" ({_number(amplitude)}, {_number(phase)})"
    return ("no data" if bound is None else _number(bound)) + answer


def _told(parameter_set: ParameterSet, key: str, title: str, columns: Sequence[str]) -> Iterator[str]:
    """Give records of the provenance a table of their own."""
    if records := _records(parameter_set, key):
        yield f"<h2>{title}</h2>"
        yield _table(columns, [[_number(record.get(name)) for name in columns] for record in records])


def _records(parameter_set: ParameterSet, key: str) -> list[dict[str, JsonValue]]:
    """Return records of the provenance, nothing where it holds something else by their name."""
    found = parameter_set.provenance.get(key)
    records = found if isinstance(found, list) else []
    return [one for one in records if isinstance(one, dict)]


def _provenance(parameter_set: ParameterSet) -> Iterator[str]:
    yield "<h2>Where it comes from</h2>"
    rows = [("model hash", parameter_set.model_hash())]
    told = {key for key in (_CHOICES, _WARNINGS) if _records(parameter_set, key)}
    names = sorted(set(parameter_set.provenance) - told)
    rows += [(name, _number(parameter_set.provenance[name])) for name in names]
    yield _table(("what", "value"), rows)


def _number(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>" if text.strip() else ""


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return "\n".join(["<table>", row(head, "th"), *(row(cells, "td") for cells in rows), "</table>"])
