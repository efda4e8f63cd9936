"""From a study's settings to its folder: tasks, limits, tables, page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosimulation.progress import Reporter
from cosimulation.result_folder import result_folder
from cosimulation.scoring import marked_recommended
from cosimulation.settings import load_settings, load_shipped_settings, settings_line, with_flags
from cosimulation.study import (
    blending,
    compare,
    contact,
    extrapolation,
    lolimot,
    order,
    shipped,
    surrogate,
    tables,
    white_box,
)
from cosimulation.study.limits import judge, plural
from cosimulation.study.page import Section, render
from cosimulation.study.runner import Pool, StudyResult, StudySettings, as_json
from fmu_builder.compiler import host_platform
from fmu_builder.errors import SettingsError
from fmu_builder.files import write_text
from fmus.wbm import build_wbm
from identification.scores import FIELDS

Records = list[dict[str, Any]]


@dataclass(frozen=True)
class Study:
    """What distinguishes one study from another.

    Attributes:
        settings: The class of its settings.
        tasks: Settings and white-box FMU to independent tasks.
        run: Task to records: score records, and findings, whose first key says what they are; one that
            begins with `cpu` is a timing, with `measure` what limits may be set on; a timing that holds a
            `measure`, too, is both.
        sections: Score records and findings to the sections of its page.
        recommend: Whether configurations compete, so that one is recommended by validation data.
        lines: Findings to lines that the command prints before the limits.
        pages: Like `sections`, for pages of their own beside it, by white-box set: report_SET.html.
    """

    settings: type[StudySettings]
    tasks: Callable[[Any, Path], Sequence[Any]]
    run: Callable[[Any], Records]
    sections: Callable[[Any, Records, Records], list[Section]]
    recommend: bool
    lines: Callable[[Any, Records], list[str]] = lambda _settings, _findings: []
    pages: Callable[[Any, Records, Records], dict[str, list[Section]]] = lambda *_: {}


STUDIES = {
    "order": Study(order.OrderSettings, order.tasks, order.run_task, tables.order_sections, False),
    "blending": Study(
        blending.BlendingSettings, blending.tasks, blending.run_task, tables.blending_sections, True
    ),
    "surrogate": Study(
        surrogate.SurrogateStudySettings, surrogate.tasks, surrogate.run_task, surrogate.sections, True
    ),
    "shipped": Study(
        shipped.ShippedSettings, shipped.tasks, shipped.run_task, shipped.sections, False, shipped.lines
    ),
    "lolimot": Study(
        lolimot.LolimotStudySettings, lolimot.tasks, lolimot.run_task, lolimot.sections, False, lolimot.lines
    ),
    "white_box": Study(
        white_box.WhiteBoxSettings, white_box.tasks, white_box.run_task, white_box.sections, False
    ),
    "contact": Study(
        contact.ContactSettings, contact.tasks, contact.run_task, contact.sections, False, contact.lines
    ),
    "extrapolation": Study(
        extrapolation.ExtrapolationSettings,
        extrapolation.tasks,
        extrapolation.run_task,
        extrapolation.sections,
        False,
        extrapolation.lines,
    ),
    "compare": Study(
        compare.CompareSettings, compare.tasks, compare.run_task, compare.overview, False, pages=compare.pages
    ),
}
_FINDINGS = (
    "measure", "theta", "optima", "reason", "drawing", "information", "exact", "growth", "poles",
)  # fmt: skip


def run(
    name: str, output: Path, settings_file: Path | None, seeds: tuple[int, ...], reporter: Reporter
) -> StudyResult:
    """Run a study; see `cosimulation.study.run_study`."""
    if name not in STUDIES:
        raise SettingsError.of(f"study {name!r}", "there is no such study", f"Choose of {', '.join(STUDIES)}")
    study = STUDIES[name]
    shipped = load_shipped_settings(study.settings, f"{name}.toml")
    settings = load_settings(study.settings, settings_file) if settings_file else shipped
    settings = with_flags(settings, seeds=seeds or None)
    reporter.say(settings_line(settings, settings_file or Path(f"{name}.toml"), shipped))
    with result_folder(output, f"llmn study {name} 1") as folder:
        white_box = build_wbm(folder / "fmus" / "pantograph_wbm.fmu", (host_platform(),))
        results = Pool[Any](settings.processes).run(
            study.run, study.tasks(settings, white_box), reporter, f"study {name}"
        )
        found = [record for result in results for record in result]
        kinds = [next(iter(item)) for item in found]
        timings = [item for item, kind in zip(found, kinds, strict=True) if kind == "cpu"]
        findings = [item for item, kind in zip(found, kinds, strict=True) if kind in _FINDINGS]
        scores = [
            {key: item.get(key) for key in FIELDS}
            for item, kind in zip(found, kinds, strict=True)
            if kind not in ("cpu", *_FINDINGS)
        ]
        if study.recommend:
            scores = _with_recommendations(scores)
        shown = [*findings, *(item for item in timings if "measure" in item)]
        measures = [item for item in shown if "measure" in item]
        verdicts = [judge(limit, scores, measures) for limit in settings.limits]
        text = settings.model_dump_json(indent=1)
        lead = f"{plural(len(settings.seeds), 'seed')}, white-box sets {', '.join(settings.sets)}"
        sections = study.sections(settings, scores, shown)
        page = render(settings.title, lead, verdicts, sections, text)
        write_text(folder / "report.html", page)
        for wbm, own in study.pages(settings, scores, shown).items():
            mine = [one for one in verdicts if one.limit.where.get("wbm", wbm) == wbm]
            title = f"{settings.title}: white-box set {wbm}"
            page = render(title, plural(len(settings.seeds), "seed"), mine, own, text)
            write_text(folder / f"report_{wbm}.html", page)
        write_text(folder / "scores.json", as_json(scores))
        write_text(folder / "timings.json", as_json(timings))
        if findings:
            told = [item for item in findings if "drawing" not in item]
            write_text(folder / "findings.json", as_json(told))
        write_text(folder / "settings.json", text + "\n")
    return StudyResult(output, scores, verdicts, {}, tuple(study.lines(settings, findings)))


def _with_recommendations(scores: Records) -> Records:
    """Mark configurations by their validation scores; what no data were identified from never competes."""

    def competes(item: Mapping[str, Any]) -> bool:
        return item["model"] in ("n4sid", "surrogate") and item["data_set"] in ("wr_validation", "wr_test")

    marked = iter(marked_recommended([item for item in scores if competes(item)]))
    return [next(marked) if competes(item) else item for item in scores]
