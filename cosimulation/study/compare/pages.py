"""The pages of the study: one per white-box set, and one that leads to them."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from cosimulation.report.tables import Cell
from cosimulation.report.tables import Row as TextRow
from cosimulation.study.compare import tables, texts
from cosimulation.study.compare.drawings import CLOSE_UP, CONTACT_FORCE, POLES, SPECTRA
from cosimulation.study.compare.figures import boxplots
from cosimulation.study.compare.results import Records, SetResults, results_of
from cosimulation.study.compare.settings import CompareSettings
from cosimulation.study.page import Drawing, Section, TextTable


def overview(settings: CompareSettings, scores: Records, findings: Records) -> list[Section]:
    """Return the sections of the page that leads to those of the white-box sets."""
    found = [results_of(wbm, settings, scores, findings) for wbm in settings.sets]
    links = Markup(", ").join(
        Markup('<a href="report_{0}.html">white-box set {0}</a>').format(one.wbm) for one in found
    )
    rows = []
    for label in found[0].labels:
        cells: list[Cell] = []
        for one in found:
            low, _, middle, _, _ = one.box(label).quartiles
            cells += [tables.fit_cell(middle), tables.fit_cell(low)]
        rows.append(TextRow(tables.named(label), (*cells, tables.published(label))))
    columns = [f"{wbm}, {what}" for wbm in settings.sets for what in ("median", "worst")]
    caption = (
        f"FIT of F_p over {len(settings.slew_rates)} whole-range test signals [%]; the thesis's best FIT on "
        "validation data (Table 4.6)."
    )
    table = TextTable(caption, "model", [*columns, "thesis"], rows)
    text = Markup("Figure 4.35, Tables 4.4 to 4.6, spectra and poles: {0}.").format(links)
    return [Section("One page per white-box set", text, text_tables=[table])]


def pages(settings: CompareSettings, scores: Records, findings: Records) -> dict[str, list[Section]]:
    """Return the sections of every white-box set's page.

    Args:
        settings: Of the study.
        scores: Score records.
        findings: Measures, timings among them, and drawings.
    """
    found = {}
    for wbm in settings.sets:
        results = results_of(wbm, settings, scores, findings)
        found[wbm] = [
            _comparison(results),
            Section(
                "Figure 4.35: every signal",
                "",
                [tables.every_signal(results)],
                text_tables=[tables.test_signals(settings)],
            ),
            Section("Table 4.4: real-time factors", texts.TIMES, text_tables=[tables.real_time(results)]),
            Section(
                "Table 4.5: all signals", texts.all_signals(settings), text_tables=[tables.signals(results)]
            ),
            Section("Table 4.6: contact force", texts.BEST, text_tables=[tables.contact_force(results)]),
            Section(
                "Contact force and spectra",
                texts.FORCE,
                figures=_drawn(results, CONTACT_FORCE, CLOSE_UP, SPECTRA),
            ),
            Section(
                "Figure 4.33: poles",
                texts.POLES,
                figures=_drawn(results, POLES),
                text_tables=[tables.modes(results)],
            ),
            Section("What differs from the thesis", texts.DIFFERENCES),
        ]
    return found


def _comparison(results: SetResults) -> Section:
    """Return Figure 4.35 with its numbers."""
    figure = boxplots(f"compare-boxes-{results.wbm}", results.wbm, results.boxes())
    return Section(
        "Figure 4.35: all models, all realisations",
        texts.boxes(results.settings),
        figures=[figure],
        text_tables=[tables.quartiles(results)],
    )


def _drawn(results: SetResults, *kinds: str) -> Sequence[Drawing]:
    found = [results.drawing(kind) for kind in kinds]
    return [Drawing(Markup(one["svg"]), one["caption"]) for one in found]
