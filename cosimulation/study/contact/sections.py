"""The page of the study: what it says in plain words, figures, tables."""

from __future__ import annotations

from collections.abc import Sequence

from cosimulation.pantograph import SIGNALS
from cosimulation.report.tables import Cell
from cosimulation.report.tables import Row as TextRow
from cosimulation.report.tables import number as decimals
from cosimulation.study.contact import figures, words
from cosimulation.study.contact.results import Results
from cosimulation.study.contact.settings import ContactSettings
from cosimulation.study.contact.situation import STATISTICS, Situation
from cosimulation.study.contact.task import TWIN
from cosimulation.study.page import Row, Section, Table, TextTable
from cosimulation.study.side_by_side import Record, model_of

_SLASH = "\N{NO-BREAK SPACE}/ "
_STATISTICS = {
    "time without contact": 2,
    "lost contacts of 5 ms and more": 0,
    "mean length of a lost contact": 4,
    "longest lost contact": 3,
    "mean F_p": 1,
    "standard deviation of F_p": 1,
    "statistical minimum of F_p": 0,
    "largest F_p": 0,
    "smallest F_p": 0,
}
"""Measure to its number of decimals."""


def lines(settings: ContactSettings, findings: Sequence[Record]) -> list[str]:
    """Return the hysteresis of every set for a person; what else there is to say is in the page."""
    del settings
    chosen = [item for item in findings if item.get("measure") == "width of the hysteresis"]
    found = [f"{'hysteresis of F_p over a slow ramp [N]':<44}{'friction':<24}{'found':>9}{'2 T_c/z_1':>11}"]
    for item in chosen:
        name = f"{item['network']}, set {item['wbm']}"
        found.append(f"{name:<44}{item['friction']:<24}{item['value']:>9.2f}{item['reference']:>11.2f}")
    return found if chosen else []


def sections(
    settings: ContactSettings, scores: Sequence[Record], findings: Sequence[Record]
) -> list[Section]:
    """Return the sections of the page."""
    results = Results(settings, scores, findings)
    raised, dropped = (f"wire {word} by {1e3 * settings.jump:g} mm" for word in ("raised", "dropped"))
    said = TextTable(
        "What the figures below say. The worst network and draw count: usable is where the contact force "
        f"has a FIT of {settings.usable_fit:g} % or more with both networks in every draw. Of the twin the "
        "median.",
        "question",
        [f"white-box set {wbm}" for wbm in settings.sets],
        [
            _prose(question, [answer(results, wbm) for wbm in settings.sets])
            for question, answer in words.ANSWERS
        ],
        prose=True,
    )
    return [
        Section("In plain words", _ABOUT, text_tables=[said]),
        Section(
            "Friction",
            _FRICTION,
            [_friction_table(results, wbm) for wbm in settings.sets],
            [figures.over_friction(results), figures.loops(results)],
            [_friction_forces(results, wbm) for wbm in settings.sets],
        ),
        Section(
            "Lift-off",
            _LIFT_OFF,
            figures=[figures.over_amplitude(results), figures.close_up(results)],
            text_tables=[
                table(results, wbm)
                for wbm in settings.sets
                for table in (_lift_off_fits, _lift_off_statistics)
            ],
        ),
        Section(
            "A wire that jumps",
            "All bilateral runs answer a raised wire with a force that pulls.",
            figures=[figures.jumps(results, raised, "raised"), figures.jumps(results, dropped, "dropped")],
            text_tables=[_jump_table(results, wbm) for wbm in settings.sets],
        ),
        Section("Both at once", _BOTH, text_tables=[_both_table(results, wbm) for wbm in settings.sets]),
    ]


_ABOUT = (
    "The networks that ship were identified on a white-box model without friction, with a wire that never "
    "lets go. Here they run as FMUs beside that model with friction, with a contact that opens, and with "
    "both. Nothing was identified anew. Amplitudes scale the acceptance recipe: 1 is 1.2 mm rms of wire "
    "noise and torque steps of \N{PLUS-MINUS SIGN}75 N.m; the last three quarters of every record count. The "
    "white-box model stands in for a pantograph, it is none; no friction of a real one is published here."
)
_FRICTION = (
    "The network has no state for friction: it answers as if there were none. While the wire moves slowly "
    "it is off by T_c / z_1, half the hysteresis. While it moves fast friction also changes the resonances, "
    "and the error is a multiple of that; the tables tell which."
)
_LIFT_OFF = (
    "With the parameter unilateral on, min(eta, xi) takes the place of eta in the network, in force, "
    "scheduling and rebase. The twin is the white-box model itself on a wire that is a micrometre higher: "
    "what it cannot predict of its own motion no model can. Contact is looked at once per millisecond; "
    "shorter losses are missed by both. The statistics are those of EN 50317 and EN 50318: deviation and "
    "statistical minimum (mean less three standard deviations) are of the force up to 20 Hz where the name "
    "says so."
)
_BOTH = (
    "Where the twin is near 100 % the motion can be predicted; what a network misses then is beside its own "
    "errors the friction it does not know."
)


def _prose(question: str, answers: Sequence[str]) -> TextRow:
    return TextRow(question, tuple(Cell(answer) for answer in answers))


def _cells(values: Sequence[float], digits: int) -> Cell:
    return Cell(_SLASH.join("none" if value != value else decimals(value, digits) for value in values))


def _friction_table(results: Results, wbm: str) -> Table:
    amplitudes = results.settings.friction_amplitudes
    large, small = amplitudes[0], amplitudes[-1]
    rows = []
    for one, little in zip(results.frictions(large), results.frictions(small), strict=True):
        for network in results.networks(wbm):
            fits = [
                tuple(results.fit(wbm, network, item, "bilateral", signal) for item in (one, little))
                for signal in SIGNALS
            ]
            rows.append(Row(f"{one.friction}, {model_of(network)}", [(fit[0], fit[1]) for fit in fits]))
    caption = (
        f"Set {wbm}: FIT of every signal [%] at the amplitude {large:g}, below it small at {small:g}, median "
        "over the seeds."
    )
    return Table(caption, "friction of the white-box model", SIGNALS, rows)


def _friction_forces(results: Results, wbm: str) -> TextTable:
    names = results.networks(wbm)
    measures = (
        ("mean F_p", 2, True),
        ("standard deviation of F_p", 1, True),
        ("95 % quantile of the error of F_p", 1, False),
        ("largest error of F_p", 0, False),
    )
    rows = []
    for amplitude in results.settings.friction_amplitudes:
        rows.append(TextRow(f"amplitude {amplitude:g}", (), "group"))
        for one in results.frictions(amplitude):
            cells = [
                _cells(_beside(results, measure, wbm, one, "bilateral", reference), digits)
                for measure, digits, reference in measures
            ]
            rows.append(TextRow(one.friction, tuple(cells)))
    caption = (
        f"Set {wbm}: contact force [N], white-box model / {_SLASH.join(map(model_of, names))} (errors: the "
        "networks only), median over the seeds."
    )
    return TextTable(caption, "friction", [name for name, _, _ in measures], rows)


def _beside(
    results: Results, measure: str, wbm: str, situation: Situation, contact: str, reference: bool = True
) -> list[float]:
    """Return a measure of the white-box model (if asked for), then of every network."""
    names = results.networks(wbm)
    first = [results.value(measure, wbm, names[0], situation, contact, "reference")] if reference else []
    return [*first, *(results.value(measure, wbm, name, situation, contact) for name in names)]


def _lift_off_fits(results: Results, wbm: str) -> TextTable:
    names = results.networks(wbm)
    rows = []
    for torque in results.settings.torques:
        rows.append(TextRow(f"{torque:g} N.m", (), "group"))
        for one in results.lift_offs(torque):
            on = [results.fit(wbm, name, one, "unilateral") for name in names]
            off = [results.fit(wbm, name, one, "bilateral") for name in names]
            cells = (
                _cells(on, 1),
                _cells([results.fit(wbm, TWIN, one, "unilateral")], 1),
                _cells(off, 1),
                _cells(
                    _beside(results, "95 % quantile of the error of F_p", wbm, one, "unilateral", False), 1
                ),
                _cells(_beside(results, "common share of lost contact", wbm, one, "unilateral", False), 0),
                _timing(results, wbm, one),
                _cells([results.value("time out of range", wbm, names[0], one, "unilateral")], 0),
            )
            rows.append(TextRow(f"amplitude {one.amplitude:g}", cells))
    columns = (
        "FIT of F_p, unilateral on [%]", "twin [%]", "unilateral off [%]", "95 % of the errors below [N]",
        "lost contact in common [%]", "first lift-off, error [ms]", "inputs out of range [%]",
    )  # fmt: skip
    caption = (
        f"Set {wbm}, lift-off: contact force of the networks ({_SLASH.join(map(model_of, names))}), median "
        "over the seeds. First lift-off: of 5 ms and more, from the start of the record."
    )
    return TextTable(caption, "mean torque, amplitude", columns, rows)


def _timing(results: Results, wbm: str, situation: Situation) -> Cell:
    found = [
        1e3 * (results.value("first lift-off", wbm, name, situation, "unilateral") - reference)
        for name in results.networks(wbm)
        for reference in [results.value("first lift-off", wbm, name, situation, "unilateral", "reference")]
    ]
    return _cells(found, 0)


def _lift_off_statistics(results: Results, wbm: str) -> TextTable:
    rows = []
    for torque in results.settings.torques:
        rows.append(TextRow(f"{torque:g} N.m", (), "group"))
        for one in results.lift_offs(torque):
            rows.append(TextRow(f"amplitude {one.amplitude:g}", _statistics(results, wbm, one)))
    return _statistics_table(f"Set {wbm}, lift-off", results, wbm, "mean torque, amplitude", rows)


def _statistics(results: Results, wbm: str, one: Situation) -> tuple[Cell, ...]:
    """Return white-box model / networks / first network with unilateral off."""
    ignoring = results.networks(wbm)[0]
    return tuple(
        _cells(
            [
                *_beside(results, measure, wbm, one, "unilateral"),
                results.value(measure, wbm, ignoring, one, "bilateral"),
            ],
            digits,
        )
        for measure, digits in _STATISTICS.items()
    )


def _statistics_table(
    title: str, results: Results, wbm: str, corner: str, rows: Sequence[TextRow]
) -> TextTable:
    units = dict(STATISTICS.values())
    names = [model_of(name) for name in results.networks(wbm)]
    caption = (
        f"{title}: contact statistics, white-box model / {_SLASH.join(names)} / {names[0]} with unilateral "
        "off (no contact: it pulls), median over the seeds."
    )
    columns = [f"{name} [{units[name]}]".replace(" [1]", "") for name in _STATISTICS]
    return TextTable(caption, corner, columns, rows)


def _jump_table(results: Results, wbm: str) -> TextTable:
    columns = (
        "contact lost for [ms]", "first re-contact [ms]", "largest F_p [N]", "smallest F_p [N]", "time "
        "without contact [%]",
    )  # fmt: skip
    rows = []
    for one in results.jumps():
        word = "raised" if one.amplitude > 0.0 else "dropped"
        rows.append(TextRow(f"wire {word} by {1e3 * abs(one.amplitude):g} mm", (), "group"))
        for network in results.networks(wbm):
            for contact in ("unilateral", "bilateral"):
                rows.append(_jump_row(results, wbm, one, network, contact))
    caption = (
        f"Set {wbm}: after a jump of the wire at {results.settings.jump_height:g} m, white-box model with "
        f"unilateral on / network, over {results.settings.jump_duration:g} s. Lost for: the first loss."
    )
    return TextTable(caption, "network", columns, rows)


def _jump_row(results: Results, wbm: str, one: Situation, network: str, contact: str) -> TextRow:
    def both(measure: str, scale: float, digits: int) -> Cell:
        fields = ("reference", "value")
        return _cells(
            [scale * results.value(measure, wbm, network, one, contact, field) for field in fields], digits
        )

    losses = [
        1e3 * results.value("first loss after a jump", wbm, *who)
        for who in (("white-box", one, "unilateral"), (network, one, contact))
    ]
    cells = (
        _cells(losses, 0),
        both("first re-contact", 1e3, 0),
        both("largest F_p", 1.0, 0),
        both("smallest F_p", 1.0, 0),
        both("time without contact", 1.0, 1),
    )
    return TextRow(f"{model_of(network)}, {contact}", cells)


def _both_table(results: Results, wbm: str) -> TextTable:
    rows = []
    for one in results.combinations():
        head = f"{one.friction}, amplitude {one.amplitude:g}, {one.torque:g} N.m"
        fits = [results.fit(wbm, name, one, "unilateral") for name in results.networks(wbm)]
        off = results.fit(wbm, results.networks(wbm)[0], one, "bilateral")
        said = f"FIT of F_p {decimals(fits[0], 1)} / {decimals(fits[1], 1)} / {decimals(off, 1)} %"
        twin = f"twin {decimals(results.fit(wbm, TWIN, one, 'unilateral'), 1)} %"
        rows.append(TextRow(f"{head}: {said}, {twin}", (), "group"))
        rows.append(TextRow("contact statistics", _statistics(results, wbm, one)))
    return _statistics_table(f"Set {wbm}, friction and lift-off", results, wbm, "situation", rows)
