"""The report: what it must say, what it must not load, and that it follows the scores."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.whole_path import WholePath
from cosimulation.bands import banded
from cosimulation.demo import DemoResult, SetResult
from cosimulation.fmu_file import open_fmu
from cosimulation.linearise import linearise
from cosimulation.pantograph import OUTPUTS, SIGNALS, TORQUE, operating_point_name
from cosimulation.report import write_picture, write_report
from cosimulation.report.bands import without_bands
from cosimulation.report.modes import modes_of_set
from cosimulation.report.page import render
from cosimulation.report.tables import significant
from cosimulation.report.thesis import BEST_CONTACT_FORCE, counterpart
from cosimulation.report.verdict import verdict
from cosimulation.report.views import SetView, views
from cosimulation.scoring import marked_recommended, run_candidate
from identification.warning import IdentificationWarning
from tolerances import POLE_DAMPING, POLE_FREQUENCY

VOID = {"meta", "link", "br", "img", "hr", "input", "col", "wbr"}
LARGEST = 6_000_000
LARGEST_PICTURE = 150_000
BEST = "n4sid, scheduled equilibrium, parameter blending"


@pytest.fixture(scope="module")
def result(blow: WholePath) -> DemoResult:
    """The demo's result on Blow, and once more under another set's name with other scores."""
    (test,) = blow.data.select("whole_range", "test")
    validation = replace(test, name="wr_validation", split="validation")
    names = [name for name in blow.candidates if "output" not in name]
    held_out = replace(blow.data, experiments=(validation,))
    candidates = tuple(
        replace(one, parameter_set=banded(one.parameter_set, held_out).parameter_set)
        for one in (blow.candidates[name] for name in names)
    )
    runs = {
        name: tuple(
            run_candidate(blow.candidates[name], blow.fmus[name], one, 1) for one in (validation, test)
        )
        for name in names
    }
    start_values = {"preset": "Blow"}
    with open_fmu(blow.white_box) as fmu:
        points = tuple(
            linearise(fmu, {"eta": height, "M_pa": TORQUE}, OUTPUTS, start_values)
            for height in (0.75, 1.25, 1.75, 2.25)
        )
    first = SetResult("Blow", blow.data, candidates, runs, points)
    other = tuple(replace(item, labels={**item.labels, "wbm": "A"}) for item in candidates)
    second = SetResult("A", blow.data, other, runs, points)
    records = [item for one in runs.values() for run in one for item in run.records]
    weaker = [{**item, "wbm": "A", "fit": item["fit"] - 1.25} for item in records]
    steps = [step_record(name, 50.0 + 10.0 * index) for index, name in enumerate(names)]
    steps.append(step_record("pantograph_wbm", 800.0))
    scores = marked_recommended([*records, *weaker])
    return DemoResult(Path("runs/demo"), (first, second), scores, {"seconds": {}, "steps": steps}, quick=True)


def step_record(name: str, own: float) -> dict[str, Any]:
    factor = own * 1e-6
    return {
        "fmu": name,
        "own_ns": own,
        "python_ns": 1500.0,
        "real_time_factor": factor,
        "speed_up": 800 / own,
    }


@pytest.fixture(scope="module")
def page(result: DemoResult, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, result)
    return path.read_text(encoding="utf-8")


class Reader(HTMLParser):
    """Checks nesting; collects ids, references, and the tables of one section."""

    def __init__(self, section: str = "") -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, dict[str, str | None]]] = []
        self.section, self.inside = section, ""
        self.rows: list[list[tuple[str, str]]] = []  # cells of a row: exact value or "", text

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.attributes.append((tag, found))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "section":
            self.inside = found.get("id") or ""
        if self.inside == self.section and tag == "tr":
            self.rows.append([])
        if self.inside == self.section and tag in ("td", "th"):
            self.rows[-1].append(("", ""))
        if self.inside == self.section and tag == "data":
            self.rows[-1][-1] = (found.get("value") or "", "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.inside == self.section and self.rows and self.rows[-1] and self.open[-1] not in ("style",):
            value, text = self.rows[-1][-1]
            self.rows[-1][-1] = (value, text + data)


def read(page: str, section: str = "") -> Reader:
    reader = Reader(section)
    reader.feed(page)
    reader.close()
    return reader


def test_the_page_is_well_formed(page: str) -> None:
    reader = read(page)
    assert reader.open == []
    ids = Counter(found["id"] for _, found in reader.attributes if "id" in found)
    assert [name for name, count in ids.items() if count > 1] == []
    references = {found["href"] for _, found in reader.attributes if "href" in found}
    local = {name for name in references if name and name.startswith("#")}
    assert {name[1:] for name in local} <= set(ids)
    clips = set(re.findall(r"url\(#([^)]+)\)", page))
    assert clips and clips <= set(ids)


def test_the_page_loads_nothing(page: str) -> None:
    assert "http://" not in page and "https://" not in page
    reader = read(page)
    assert {tag for tag, _ in reader.attributes} & {"script", "iframe", "object", "embed", "form"} == set()
    assert "@import" not in page
    for _, found in reader.attributes:
        assert "src" not in found or (found["src"] or "").startswith("data:")
        assert (found.get("href") or "#").startswith(("#", "data:"))
        assert not [name for name in found if name.startswith("on")]


def test_the_page_stays_small_and_names_no_place(page: str) -> None:
    assert len(page.encode()) < LARGEST
    for place in ("/tmp", "/home", "/root", "/Users", "C:\\", str(Path.cwd())):
        assert place not in page


def test_every_figure_has_words(page: str) -> None:
    pictures = [found for tag, found in read(page).attributes if tag == "svg"]
    assert len(pictures) == 1 + 2 * 7
    assert all(found.get("role") == "img" and len(found.get("aria-label") or "") > 40 for found in pictures)


def test_every_model_and_signal_appears(page: str, result: DemoResult) -> None:
    for one in result.sets:
        for candidate in one.candidates:
            assert candidate.title in page
            assert candidate.parameter_set.model_hash() in page
        for experiment in one.data.experiments:
            assert experiment.data.content_hash in page
    for signal in SIGNALS:
        assert f"{signal} [" in page
    assert "Quick run" in page


def test_the_numbers_of_the_table_are_the_scores(page: str, result: DemoResult) -> None:
    rows = [row for row in read(page, "fit").rows if len(row) == len(SIGNALS) + 2 and any(v for v, _ in row)]
    ours = iter(row for row in rows if not row[0][1].startswith("thesis:"))
    for view in views(result):
        for model in view.models:
            head, *cells, worst = next(ours)
            assert head[1].startswith(model.title)
            assert ("recommended" in head[1]) == model.recommended
            expected = [record(result, view.name, model.title, signal) for signal in SIGNALS]
            assert [float(value) for value, _ in cells] == [item["fit"] for item in expected]
            assert float(worst[0]) == expected[-1]["max_error"]
            for (_, text), item in zip(cells, expected, strict=True):
                assert text.replace("\N{MINUS SIGN}", "-").startswith(f"{item['fit']:.2f}")
    assert next(ours, None) is None


def record(result: DemoResult, wbm: str, title: str, signal: str) -> dict[str, Any]:
    """The record of scores.json, found through the run's own labels and not through the report."""
    (one,) = (item for item in result.sets if item.wbm == wbm)
    (candidate,) = (item for item in one.candidates if item.title == title)
    keys = ("model", "offsets", "blending", "validity")
    (found,) = (
        item
        for item in result.scores
        if item["wbm"] == wbm and item["split"] == "test" and item["signal"] == signal
        if all(item[key] == candidate.labels[key] for key in keys)
    )
    return found


def test_the_thesis_stands_beside_its_counterpart(page: str) -> None:
    rows = read(page, "fit").rows
    heads = [row[0][1].strip() for row in rows]
    place = next(index for index, head in enumerate(heads) if head.startswith(BEST))
    assert [float(value) for value, _ in rows[place + 1][1:-1]] == [99.15, 64.57, 99.02, 77.91, 49.46, 81.78]
    assert counterpart({"model": "linear", "llms": 1, "blending": None}) is None
    assert BEST_CONTACT_FORCE == 81.78


def test_the_same_result_gives_the_same_bytes(page: str, result: DemoResult, tmp_path: Path) -> None:
    write_report(tmp_path / "again.html", result)
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == page
    write_picture(tmp_path / "one.svg", result)
    write_picture(tmp_path / "two.svg", result)
    content = (tmp_path / "one.svg").read_bytes()
    assert content == (tmp_path / "two.svg").read_bytes()
    assert content.startswith(b"<?xml") and len(content) < LARGEST_PICTURE


def rescored(result: DemoResult, title: str, **fits: float) -> SetView:
    """The view of Blow after the contact force of one model got other scores, by split."""
    (candidate,) = (item for item in result.sets[0].candidates if item.title == title)
    scores = []
    for item in result.scores:
        own = all(item[key] == value for key, value in candidate.labels.items())
        if own and item["signal"] == "F_p" and item["split"] in fits:
            item = {**item, "fit": fits[item["split"]]}
        scores.append(item)
    return views(replace(result, scores=scores))[0]


def text_of(view: SetView) -> str:
    return " ".join(f"{lead} {text}" for lead, text in verdict(view).sentences)


def test_the_verdict_follows_the_scores(result: DemoResult) -> None:
    view = views(result)[0]
    assert verdict(view).best.title == BEST
    assert f"{view.best.fit('F_p'):.1f}" in text_of(view)
    assert " above the thesis's best" in text_of(view)
    fallen = rescored(result, BEST, validation=99.9, test=70.0)
    assert verdict(fallen).best.title == BEST
    assert "70.0" in text_of(fallen) and "11.8 percentage points below the thesis's best" in text_of(fallen)
    assert f"not above the thesis's best: {BEST}" in text_of(fallen).replace("\N{NO-BREAK SPACE}", " ")


def test_the_best_model_is_chosen_on_validation_data_alone(result: DemoResult) -> None:
    linear = "white-box model linearised at OP45"
    assert verdict(rescored(result, linear, test=99.99)).best.title == BEST
    assert verdict(rescored(result, linear, validation=99.99)).best.title == linear


def test_a_faster_reference_is_not_called_slower(result: DemoResult) -> None:
    name = views(result)[0].best.candidate.name
    steps = [{**item, "speed_up": 0.5} if item["fmu"] == name else item for item in result.timings["steps"]]
    changed = replace(result, timings={**result.timings, "steps": steps})
    assert "2 times slower than the white-box FMU" in text_of(views(changed)[0])


def test_a_model_that_runs_away_does_not_break_the_report(result: DemoResult, tmp_path: Path) -> None:
    one = result.sets[0]
    name = one.candidates[0].name
    runs = {**one.runs, name: tuple(replace(run, outputs=run.outputs * 1e250) for run in one.runs[name])}
    labels = one.candidates[0].labels
    scores = [
        {**item, "fit": None, "max_error": None}
        if all(item[key] == value for key, value in labels.items())
        else item
        for item in result.scores
    ]
    changed = replace(result, sets=(replace(one, runs=runs),), scores=scores)
    write_report(tmp_path / "report.html", changed)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "not finite" in text
    assert read(text).open == []


def test_the_poles_of_the_reference_are_those_of_the_white_box_model(result: DemoResult) -> None:
    first = modes_of_set(views(result)[0])[0]
    assert operating_point_name(first.height) == "OP25"
    own = first.models[BEST]
    for mode, match in zip(first.reference, own, strict=True):
        assert match is not None
        assert abs(match.frequency - mode.frequency) < 10 * POLE_FREQUENCY
        assert abs(match.damping - mode.damping) < 10 * POLE_DAMPING


def test_warnings_of_several_models_are_told_once(result: DemoResult) -> None:
    shared = IdentificationWarning("local model at eta = 1.25, output 'xi'", "what is wrong", "Mend it")
    own = IdentificationWarning("network on whole-range data, output 'F_p'", "what is worse", "Mend that")
    first, *rest = result.sets[0].candidates
    candidates = (
        replace(first, warnings=(shared, own)),
        *(replace(one, warnings=(shared,)) for one in rest),
    )
    doubtful = replace(result, sets=(replace(result.sets[0], candidates=candidates),))
    told = [str(shared), f"{first.title}: {own}"]
    assert doubtful.summary()["warnings"] == {"Blow": told}
    assert all(f"warning: Blow, {text}\n" in doubtful.text() for text in told)
    page = render(doubtful)
    assert all(page.count(one.what) == 1 for one in (shared, own))


def test_theta_stands_with_its_standard_errors_and_what_is_not_told(page: str, result: DemoResult) -> None:
    (candidate,) = [one for one in result.sets[0].candidates if one.surrogate is not None]
    found = candidate.surrogate
    assert found is not None and found.certainty is not None
    section = page[page.index('<section id="surrogate">') : page.index('<section id="speed">')]
    shown = unescape(re.sub("<[^>]+>", " ", section))
    for which in ("physical", "tuned"):
        errors = found.standard_errors(which)
        assert np.isfinite(errors).any()
        for value in errors[np.isfinite(errors)]:
            assert f"\N{PLUS-MINUS SIGN} {significant(float(value), 3)}" in shown
    for line in (*found.correlated(), *found.remarks("physical"), *found.remarks("tuned")):
        assert " ".join(line.split()) in " ".join(shown.split())


def test_the_chain_is_drawn_and_fisher_information_stands_beside_theta(page: str, result: DemoResult) -> None:
    (candidate,) = [one for one in result.sets[0].candidates if one.surrogate is not None]
    found = candidate.surrogate
    assert found is not None and found.certainty is not None
    section = page[page.index('<section id="surrogate">') : page.index('<section id="speed">')]
    assert f"<pre>{found.structure.diagram}</pre>" in unescape(section)
    assert f"{found.certainty.condition:.2g}." in section and "(eq. 5.3)" in section
    for table in (found.certainty.partial, found.certainty.coupled):
        for value in table.sum(axis=1)[3].tolist():
            text = str(int(np.floor(np.log10(value)))).replace("-", "\N{MINUS SIGN}")
            assert f'<data value="{value!r}">{text}</data>' in section
    assert "thesis, Table 4.3, 1/r_M" in section


def test_bands_stand_by_height_and_frequency_with_what_lies_inside(page: str, result: DemoResult) -> None:
    """The fixture's validation data are its test data, so that 95 % and hardly more lie inside."""
    rows = read(page, "bands").rows
    for view in views(result):
        for model in view.models:
            (bands,) = model.parameter_set.residual_bands
            if model.candidate.offset_subtracted:
                assert model.bands is None and model.title in without_bands(view)
                continue
            for height, bound in enumerate(bands.bound):
                expected = [bands.seconds[height], bands.total[height], *bound]
                (row,) = {
                    tuple(float(value) for value, _ in row[1:])
                    for row in rows
                    if [value for value, _ in row[1:-1]] == [repr(value) for value in expected]
                }
                assert 0.95 <= row[-1] < 0.953
    section = page[page.index('<section id="bands">') : page.index('<section id="order">')]
    assert section.count("Up to 15 Hz the amplitude is") == 6 and "95.0" in section
    assert section.count("No bands here: white-box model linearised at OP45.") == 2


def test_the_share_of_time_out_of_range_is_what_the_fmu_said(page: str, result: DemoResult) -> None:
    rows = [row for row in read(page, "bands").rows if len(row) == 3 and "%" in row[2][1]]
    expected = [
        [float(run.out_of_range) for run in one.runs[candidate.name] if run.out_of_range is not None]
        for one in result.sets
        for candidate in one.candidates
    ]
    assert [[float(value) for value, _ in row[1:]] for row in rows] == expected
    assert all(0.0 <= share < 0.5 for pair in expected for share in pair) and len(rows) == 8


def test_a_report_without_bands_says_so(result: DemoResult) -> None:
    first = result.sets[0]
    bare = tuple(
        replace(one, parameter_set=one.parameter_set.replaced(residual_bands=())) for one in first.candidates
    )
    page = render(replace(result, sets=(replace(first, candidates=bare),)))
    section = page[page.index('<section id="bands">') : page.index('<section id="order">')]
    assert "Up to 15 Hz" not in section and "<svg" not in section
    assert all(one.title in section.partition("No bands here:")[2] for one in bare)
