"""The page of the study: what it says in plain words, then figure and tables of every cause."""

from __future__ import annotations

from collections.abc import Sequence

from cosimulation.report.tables import Cell, significant
from cosimulation.report.tables import Row as TextRow
from cosimulation.report.tables import number as decimals
from cosimulation.study.extrapolation import figures, words
from cosimulation.study.extrapolation.inputs import UNITS, trained_region
from cosimulation.study.extrapolation.results import Results
from cosimulation.study.extrapolation.settings import Cause, ExtrapolationSettings
from cosimulation.study.extrapolation.task import CLAMP, QUANTILE_MEASURE, RATIO_MEASURE
from cosimulation.study.page import Section, TextTable
from cosimulation.study.side_by_side import Record, model_of

_SLASH = "\N{NO-BREAK SPACE}/ "
_ABOUT = (
    "The networks that ship, as FMUs beside the white-box FMU, driven beyond what they were trained on, one "
    "cause at a time; everything else stays as in training. Both contacts are bilateral. The last three "
    "quarters of every record count. Model on model: where the white-box model has no answer either, no "
    "error is known."
)
_CLAMPED = (
    " With out_of_range = warn inputs act as they are. With clamp they are held at their limits, and the "
    "wire follows no faster than in training: the network then answers to another wire and torque than the "
    "white-box model, noise included, and its error is theirs."
)
_WITHOUT = " These FMUs serve what is out of range and warn once."
_TEXTS = {
    "height": (
        "The acceptance recipe at one height. Beyond the range the weights of the local models stay, and "
        "the static map goes on in a straight line."
    ),
    "speed": (
        "The acceptance recipe on a wire that goes up and down in a sine through the whole range; the value "
        "is its speed in the middle. An FMU sees the move from one tick to the next only, in which the "
        "noise of the training hides a slow movement."
    ),
    "noise": "The whole-range record with the wire's noise scaled; the torque's steps stay.",
    "frequency": (
        "A sine of the wire alone, without noise and torque steps; the same for every seed, so one run "
        "each. The noise of the training is behind a first-order low-pass: beyond its corner less of it is "
        "left, but some."
    ),
    "torque": "The acceptance recipe at one height about another mean torque.",
}


def lines(settings: ExtrapolationSettings, findings: Sequence[Record]) -> list[str]:
    """Return for a person where the white-box model gave out, and what failed."""
    del settings
    found = []
    for item in findings:
        if item["measure"] in ("white-box model gave out", "run that failed") and item["value"]:
            place = (
                f"set {item['wbm']}, {item['network']}, {item['cause']} {item['at']:g}, seed {item['seed']}"
            )
            found.append(f"{item['measure']}: {place}: {item['said'].splitlines()[0]}")
    return found


def sections(
    settings: ExtrapolationSettings, scores: Sequence[Record], findings: Sequence[Record]
) -> list[Section]:
    """Return the sections of the page."""
    results = Results(settings, scores, findings)
    questions = [("where usable", words.span), ("error", words.growth), ("does the FMU say so", words.told)]
    if CLAMP in results.policies:
        questions.append(("with the policy clamp", words.clamped))
    rows = []
    for cause in settings.causes:
        rows.append(TextRow(cause.name, (), "group"))
        for question, answer in questions:
            rows.append(TextRow(question, tuple(Cell(answer(results, wbm, cause)) for wbm in settings.sets)))
    caption = (
        "What the figures below say; FIT of the worst network and draw. Usable: that is "
        f"{settings.usable_fit:g} % or more there and everywhere between there and the value inside."
    )
    said = TextTable(caption, "", [f"white-box set {wbm}" for wbm in settings.sets], rows, prose=True)
    policy = _CLAMPED if CLAMP in results.policies else _WITHOUT
    return [
        Section("In plain words", _ABOUT + policy, text_tables=[said]),
        *(
            Section(
                cause.name.capitalize(),
                _TEXTS[cause.name],
                figures=[figures.over_cause(results, cause)],
                text_tables=[_table(results, cause, wbm) for wbm in settings.sets],
            )
            for cause in settings.causes
        ),
    ]


def _table(results: Results, cause: Cause, wbm: str) -> TextTable:
    names = results.networks(wbm)
    columns = [
        "standard deviation of F_p [N]",
        "FIT of F_p [%]",
        "95 % of errors below [N]",
        "times that inside",
    ]
    columns += [
        "largest error [N]",
        "largest |F_p| over the white-box model's",
        "fastest move of a tick [m/s]",
    ]
    columns += ["out of range [% of time]"]
    if cause.name == "frequency":
        columns += ["amplitude over the white-box model's", "phase [deg]"]
    rows = []
    for policy in results.policies:
        if len(results.policies) > 1:
            rows.append(TextRow(f"policy {policy}", (), "group"))
        rows += [_row(results, cause, wbm, at, policy) for at in cause.values]
    caption = (
        f"Set {wbm}: {' / '.join(map(model_of, names))}, median over the seeds; trained values marked by a "
        "star."
    )
    unit = UNITS[cause.name]
    return TextTable(caption, cause.name + ("" if unit == "1" else f" [{unit}]"), columns, rows)


def _row(results: Results, cause: Cause, wbm: str, at: float, policy: str) -> TextRow:
    names = results.networks(wbm)
    region = trained_region(names[0], cause)
    star = " *" if region is not None and region[0] <= at <= region[1] else ""

    def every(measure: str) -> Cell:
        return _cell([results.value(measure, wbm, name, cause, at, policy) for name in names])

    fits = [results.fit(wbm, name, cause, at, policy) for name in names]
    cells = [
        _cell([results.reference("standard deviation of F_p", wbm, cause, at)]),
        Cell(_SLASH.join("none" if fit != fit else decimals(fit, 1) for fit in fits)),
        every(QUANTILE_MEASURE),
        every(RATIO_MEASURE),
        every("largest error of F_p"),
        every("largest |F_p| beside the white-box model's"),
        _cell([results.reference("largest rate of the wire from tick to tick", wbm, cause, at)]),
        every("time out of range"),
    ]
    if cause.name == "frequency":
        cells += [
            every("amplitude of F_p beside the white-box model's"),
            every("phase of F_p less the white-box model's"),
        ]
    return TextRow(f"{at:g}{star}", tuple(cells))


def _cell(values: Sequence[float]) -> Cell:
    return Cell(_SLASH.join("none" if value != value else significant(value, 3) for value in values))
