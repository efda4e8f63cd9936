"""What the page and the command say about LOLIMOT."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cosimulation.pantograph import SIGNALS
from cosimulation.report.tables import Cell as TextCell
from cosimulation.report.tables import Row as TextRow
from cosimulation.report.tables import number
from cosimulation.study.lolimot.settings import (
    ANGLE,
    FREE_RUN,
    FROM_XI,
    ONE_STEP,
    LolimotConfiguration,
    LolimotStudySettings,
)
from cosimulation.study.lolimot.task import BLEND_RADIUS, LARGEST_ERROR, LOCAL_RADIUS, REST_ERROR
from cosimulation.study.page import Drawing, Row, Section, Table, TextTable
from cosimulation.study.tables import fit_caption, statistics

Records = Sequence[Mapping[str, Any]]

THESIS_POLES = (
    ("LLM 1", ((0.998229, 0.0196039), (0.962048, 0.0593345), (-0.464731, 0.49121))),
    ("LLM 2", ((0.997896, 0.0202057), (0.979318, 0.0897201), (-0.620023, 0.44884))),
    ("LLM 3", ((0.996982, 0.0189813), (0.987507, 0.0810701), (-0.486953, 0.435217))),
    ("LLM 4", ((0.998188, 0.0207739), (0.986215, 0.0824344), (-0.515838, 0.415633))),
)
"""Upper poles in the z plane of the thesis's four local models (Figure 4.7)."""

_ANGLE_TEXT = """The angle of the lower arm from wire height and torque, one tree of local ARX models. One
step: predicted from measured outputs. Free run: from its own outputs. The other columns are state-space
systems of the same local models whose matrices are blended, as an FMU computes them: states that are past
outputs and inputs (the non-minimal state space, equal to the free run to rounding), canonical forms, each
model's own modal states, these about each model's own centre; and blended outputs. The thesis's model has a
FIT of 88.25 % on its training record, its soaring included (eq. 4.2)."""
_SOARING_TEXT = """All local models are stable. Where the largest pole of the blend held at a height stays
below one, too, a blend that soars is not unstable: its states do not mean the same in two neighbours. Where
the slowest mode is a real pole in one local model and a pair of poles in the next (the table of poles shows
it), states of different modes are blended, and already the output at rest is wrong between the centres.
States that are past signals mean the same everywhere: nothing soars. Errors are over the span of the angle
on the test record."""
_POLES_TEXT = """Poles of the local models of the first seed in the z plane, natural frequency |s| and
damping -Re(s) / |s| with s = log(z) / Ts, of every pair once; below, those of the thesis's Figure 4.7."""
_SIX_TEXT = """One network per output: LOLIMOT knows no others. A force in proportion to a small difference
of positions magnifies their errors: F_p = k_E (xi - eta), so a millimetre of xi is k_E / 1000 newtons, and
next to nothing of the span of xi. On F_p as an output of its own an input acts at once, through k_E:
without eta of the same row among the regressors (a delay of one row) the local models have no meaning and
run away; with it they hold, but no parameter set can say so."""
_TREE_TEXT = """Which cells the tree found, first seed: edges, rows of training data in every cell, and how
the one-step error fell. The worst cell is the one with the largest sum of squared errors. Many rows in one
part of the range draw the cells there: the partition follows the data, as the thesis complains."""


def sections(settings: LolimotStudySettings, scores: Records, findings: Records) -> list[Section]:
    """Return the sections of the page."""
    return [
        _angle(settings, scores),
        _soaring(settings, findings),
        _poles(findings),
        _six(settings, scores),
        _tree(settings, findings),
    ]


def lines(settings: LolimotStudySettings, findings: Records) -> list[str]:
    """Return what a person is told before the verdicts: every measured form, medians over the seeds."""
    head = f"{'phi_1, medians over the seeds':<52}{'local':>9}{'blend':>9}{'error':>9}{'at rest':>9}  where"
    found = [head]
    for wbm in settings.sets:
        for one in _detailed(settings, wbm):
            for form in one.forms:
                values = _measured(findings, wbm, one.name, form)
                local = _values(findings, LOCAL_RADIUS, wbm, one.name, "all")
                cells = [np.median(local) if local else np.nan, *values]
                where = _where(findings, wbm, one.name, form)
                told = "".join(f"{cell:>9.4f}" for cell in cells)
                found.append(f"{f'{wbm}, {one.name}, {form}':<52}{told}  {where}")
    return found


def _detailed(settings: LolimotStudySettings, wbm: str) -> Iterable[LolimotConfiguration]:
    return (one for one in settings.configurations if one.detailed and wbm in one.sets)


def _values(findings: Records, name: str, wbm: str, route: str, form: str) -> list[float]:
    wanted = (name, wbm, route, form)
    return [
        np.inf if one["value"] is None else float(one["value"])
        for one in findings
        if (one.get("measure"), one.get("wbm"), one.get("route"), one.get("form")) == wanted
    ]


def _measured(findings: Records, wbm: str, route: str, form: str) -> list[float]:
    """Return medians over the seeds of blend radius, largest error and error at rest; NaN without any."""
    names = (BLEND_RADIUS, LARGEST_ERROR, REST_ERROR)
    found = [_values(findings, name, wbm, route, form) for name in names]
    return [float(np.median(values)) if values else float("nan") for values in found]


def _where(findings: Records, wbm: str, route: str, form: str) -> str:
    """Return where the first seed's largest error is."""
    for one in findings:
        same = (one.get("wbm"), one.get("route"), one.get("form")) == (wbm, route, form)
        if same and one.get("measure") == LARGEST_ERROR and one.get("time") is not None:
            return f"seed {one['seed']}: {one['time']:.2f} s, {one['eta']:.2f} m"
    return ""


def _fits(scores: Records, wbm: str, route: str, structure: str, signal: str) -> list[float | None]:
    wanted = (wbm, route, structure, signal)
    keys = ("wbm", "route", "structure", "signal")
    return [one["fit"] for one in scores if tuple(one[key] for key in keys) == wanted]


def _angle(settings: LolimotStudySettings, scores: Records) -> Section:
    forms = dict.fromkeys(form for one in settings.configurations for form in one.forms)
    columns = [ONE_STEP, FREE_RUN, *forms]
    tables = []
    for wbm in settings.sets:
        rows = [
            Row(one.name, [statistics(_fits(scores, wbm, one.name, name, ANGLE)) for name in columns])
            for one in settings.configurations
            if ANGLE in one.outputs and wbm in one.sets
        ]
        tables.append(Table(fit_caption(wbm, len(settings.seeds)), "configuration", columns, rows))
    return Section("The angle of the lower arm", _ANGLE_TEXT, tables)


def _soaring(settings: LolimotStudySettings, findings: Records) -> Section:
    columns = [
        "largest |pole|, local",
        "largest |pole|, blend",
        "largest error",
        "error at rest",
        "where",
    ]
    tables = []
    for wbm in settings.sets:
        rows = []
        for one in _detailed(settings, wbm):
            rows.append(TextRow(one.name, (), "group"))
            for form in one.forms:
                local = _values(findings, LOCAL_RADIUS, wbm, one.name, "all")
                radius, error, rest = _measured(findings, wbm, one.name, form)
                cells = [number(float(np.median(local)) if local else np.nan, 5), number(radius, 5)]
                cells += [number(error, 3), number(rest, 3), _where(findings, wbm, one.name, form)]
                rows.append(TextRow(form, tuple(map(TextCell, cells))))
        caption = f"White-box set {wbm}, medians over the seeds; where: of the largest error, first seed."
        tables.append(TextTable(caption, "form", columns, rows))
    drawn = [Drawing(Markup(one["svg"]), one["caption"]) for one in findings if "drawing" in one]
    return Section("Where a blend soars", _SOARING_TEXT, figures=drawn, text_tables=tables)


def _poles(findings: Records) -> Section:
    rows: list[TextRow] = []
    before = None
    for one in (one for one in findings if "poles" in one):
        place = f"{one['wbm']}, {one['route']}, {one['poles']:g} m"
        if place != before:
            rows.append(TextRow(place, (), "group"))
        rows.append(_pole_row(one["real"], one["imaginary"], one["sample_time"], "ours"))
        before = place
    for name, poles in THESIS_POLES:
        rows.append(TextRow(f"thesis, {name}", (), "group"))
        rows += [_pole_row(real, imaginary, 0.001, "thesis") for real, imaginary in poles]
    columns = ["real", "imaginary", "natural frequency [rad/s]", "damping"]
    table = TextTable("Poles of the local models.", "local model", columns, rows)
    return Section("Poles", _POLES_TEXT, text_tables=[table])


def _pole_row(real: float, imaginary: float, sample_time: float, kind: str) -> TextRow:
    s = np.log(complex(real, imaginary)) / sample_time
    size = float(abs(s))
    damping = -float(s.real) / size if size else 1.0
    texts = [number(real, 6), number(imaginary, 6), number(size, 2), number(damping, 4)]
    return TextRow("pair" if imaginary else "real", tuple(map(TextCell, texts)), kind)


def _six(settings: LolimotStudySettings, scores: Records) -> Section:
    tables = []
    for wbm in settings.sets:
        rows = []
        for one in settings.configurations:
            if wbm not in one.sets or not set(SIGNALS) & set(one.outputs):
                continue
            for structure in (ONE_STEP, FREE_RUN):
                cells = [statistics(_fits(scores, wbm, one.name, structure, name)) for name in SIGNALS]
                rows.append(Row(f"{one.name}, {structure}", cells))
            if "xi" in one.outputs:
                for structure in (ONE_STEP, FREE_RUN):
                    told = _fits(scores, wbm, one.name, structure + FROM_XI, "F_p")
                    nothing = [statistics([])] * (len(SIGNALS) - 1)
                    rows.append(Row(f"{one.name}, {structure}{FROM_XI}", [*nothing, statistics(told)]))
        tables.append(Table(fit_caption(wbm, len(settings.seeds)), "configuration", SIGNALS, rows))
    return Section("The six outputs", _SIX_TEXT, tables)


def _tree(settings: LolimotStudySettings, findings: Records) -> Section:
    rows = []
    for one in findings:
        if "growth" not in one or one["seed"] != settings.seeds[0]:
            continue
        edges = ", ".join(f"{edge:g}" for edge in one["edges"])
        counts = ", ".join(map(str, one["rows"]))
        order = ", ".join(f"{place:g}" for _, place, _ in one["stages"] if place is not None)
        errors = f"{one['stages'][0][2]:.2e} to {one['stages'][-1][2]:.2e}"
        cells = [str(len(one["rows"])), edges, order, counts, errors]
        name = f"{one['wbm']}, {one['route']}, {one['growth']}"
        rows.append(TextRow(name, tuple(map(TextCell, cells))))
    columns = ["models", "edges [m]", "halved at, in turn [m]", "rows per cell", "one-step error, rms"]
    return Section(
        "What the tree does", _TREE_TEXT, text_tables=[TextTable("Partitions.", "network", columns, rows)]
    )
