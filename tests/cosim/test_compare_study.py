"""The study of Figure 4.35 in small: its figures against independent computations, its pages and settings."""

from __future__ import annotations

import json
import re
import statistics
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosimulation.fmu_driver import ROWS_AT_ONCE, running_fmu
from cosimulation.fmu_file import open_fmu
from cosimulation.pantograph import INPUTS, SIGNALS
from cosimulation.report import thesis
from cosimulation.settings import STUDIES, load_settings, parse_settings
from cosimulation.study import run_study
from cosimulation.study.compare import CompareSettings
from cosimulation.study.compare.figures import Box
from cosimulation.study.compare.members import PARAMETER, in_thesis
from cosimulation.study.compare.task import BATCH, LOOP, RELATIVE_ERROR, WHITE_BOX
from cosimulation.study.compare.timing import batch_call, own_loop
from cosimulation.study.runner import StudyResult
from fmu_builder.errors import SettingsError
from fmus.wbm import native, parameter_sets
from identification.data_set import DataSet
from identification.excitation import whole_range_inputs
from identification.scores import FIELDS
from tolerances import BITS, FMPY_LOOP, RECOMPUTED_FIT

RATES, SEED, SECONDS = (0.05, 0.3), 5, 12.0
SMALL = f"""
title = "Small"
sets = ["Blow"]
seeds = [3]
duration = 12.0
whole_range_duration = 20.0
signal_duration = {SECONDS}
signal_seed = {SEED}
slew_rates = {list(RATES)}
timing_repeats = 1
loop_repeats = 1
processes = 1

[[limits]]
label = "reachable"
where = {{ wbm = "Blow", route = "M41", signal = "F_p" }}
combine = "worst"
worst = 50.0

[[limits]]
label = "slow enough for any machine"
measure = "{BATCH}"
where = {{ wbm = "Blow" }}
worst = 1e9

[[limits]]
label = "of another set"
where = {{ wbm = "A", route = "M41", signal = "F_p" }}

[[limits]]
label = "no machine is that fast"
measure = "{LOOP}"
where = {{ model = "M41" }}
worst = 0.0
"""
MODELS = ("M11", "M12", "M13", "M21", "M31", "M41", "L11", "T31")
LESS = {"L11": ("xi", "F_p")}
FULL = load_settings(CompareSettings, STUDIES / "compare.toml")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    folder = tmp_path_factory.mktemp("compare")
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    return run_study("compare", folder / "out", folder / "small.toml")


def written(result: StudyResult, name: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((result.folder / name).read_text(encoding="utf-8"))
    return found


def reference(index: int) -> DataSet:
    """A test signal made here: the excitation, and the white-box equations without their FMU."""
    inputs = whole_range_inputs(SEED, (index,), SECONDS, slew_rate=RATES[index])
    outputs = native.simulate(parameter_sets()["Blow"], inputs.values, inputs.sample_time)
    columns = [native.OUTPUTS.index(name) for name in SIGNALS]
    return inputs.with_columns(SIGNALS, ("",) * len(SIGNALS), outputs[:, columns])


def test_every_model_is_scored_on_every_signal(small: StudyResult) -> None:
    records = written(small, "scores.json")
    assert all(tuple(one) == FIELDS for one in records)
    tests = [(one["route"], one["data_set"], one["signal"]) for one in records if one["split"] == "test"]
    names = ("slew_050_mm_s", "slew_300_mm_s")
    assert tests == [
        (model, name, signal) for model in MODELS for name in names for signal in LESS.get(model, SIGNALS)
    ]
    others = {(one["route"], one["data_set"]) for one in records if one["split"] != "test"}
    assert others == {
        *((model, "wr_validation") for model in MODELS),
        *((model, "wr_train") for model in ("M11", "M21", "M31", "M41")),
        *((f"1 LLM {kind}", f"op_1750_{split}")
          for kind in ("surrogate", "n4sid") for split in ("train", "validation")),
    }  # fmt: skip


@pytest.mark.parametrize("model", ["M11", "M41"])
def test_a_fit_is_that_of_the_fmu_in_the_folder(small: StudyResult, model: str) -> None:
    for index, rate in enumerate(RATES):
        data = reference(index)
        with open_fmu(small.folder / "fmus" / "Blow" / f"{model}.fmu") as fmu, running_fmu(fmu) as instance:
            force = instance.run(data.matrix(INPUTS), INPUTS, ("F_p",), data.sample_time)[:, 0]
        error = data.column("F_p") - force
        if model == "M11":
            error = error - error.mean()  # the thesis subtracts the offset afterwards (Remark 4.8.1)
        late = slice(len(error) // 4, None)
        truth = data.column("F_p")[late]
        fit = 100.0 * (1.0 - np.sqrt(np.sum(error[late] ** 2) / np.sum((truth - truth.mean()) ** 2)))
        name = f"slew_{round(1000 * rate):03d}_mm_s"
        mine = {"route": model, "data_set": name, "signal": "F_p"}
        (found,) = (one for one in small.records if mine.items() <= one.items())
        assert abs(found["fit"] - fit) <= RECOMPUTED_FIT
        (measure,) = (
            one for one in written(small, "findings.json")
            if (one["measure"], one["model"], one["data_set"]) == (RELATIVE_ERROR, model, name)
        )  # fmt: skip
        share = 100.0 * np.abs(error[late]).max() / np.abs(truth).max()
        assert measure["value"] == pytest.approx(share, rel=RECOMPUTED_FIT)


@given(st.lists(st.floats(-500.0, 100.0), min_size=2, max_size=30))
def test_the_numbers_of_a_box_are_the_quartiles(fits: list[float]) -> None:
    low, first, middle, third, high = Box("M41", PARAMETER, fits).quartiles
    expected = (min(fits), *statistics.quantiles(fits, n=4, method="inclusive"), max(fits))
    assert np.allclose((low, first, middle, third, high), expected, rtol=1e-12, atol=1e-9)


def test_a_run_that_ran_away_is_the_smallest_of_its_box() -> None:
    quartiles = Box("M41", PARAMETER, [90.0, -np.inf, 99.0, 98.0, 97.0]).quartiles
    assert quartiles == (-np.inf, 90.0, 97.0, 98.0, 99.0)


def test_timings_can_be_limited_and_stay_out_of_what_must_be_reproducible(small: StudyResult) -> None:
    assert [verdict.passed for verdict in small.verdicts] == [True, True, None, False]
    timings = written(small, "timings.json")
    assert {one["model"] for one in timings} == {WHITE_BOX, "M11", "M21", "M31", "M41", "L11", "T31"}
    assert {one["data_set"] for one in timings if one["measure"] == LOOP} == {"wr_validation"}
    assert all(one["value"] > 0.0 for one in timings)
    assert {one["measure"] for one in written(small, "findings.json")} == {RELATIVE_ERROR}


def test_both_ways_of_timing_do_the_same(small: StudyResult) -> None:
    data = reference(1)
    with open_fmu(small.folder / "fmus" / "Blow" / "M41.fmu") as fmu:
        at_once, own = batch_call(fmu, data, {}), own_loop(fmu, data, {})
        with running_fmu(fmu) as instance:
            usual = instance.run(data.matrix(INPUTS), INPUTS, SIGNALS, data.sample_time)
    assert len(data) > 2 * ROWS_AT_ONCE and np.abs(at_once - usual).max() <= BITS
    # fmpy reads outputs before it sets the inputs of the same instant: F_p, which feels the height at once,
    # is that of the height before
    late = np.diff(data.column("eta"), prepend=data.column("eta")[0]) * parameter_sets()["Blow"]["k_E"]
    own[:, SIGNALS.index("F_p")] -= late
    assert np.all(np.abs(own - at_once).max(axis=0) <= FMPY_LOOP * np.ptp(at_once, axis=0))


def test_the_page_shows_the_thesis_beside_ours(small: StudyResult) -> None:
    page = (small.folder / "report_Blow.html").read_text(encoding="utf-8")
    columns = (
        thesis.ONE_SURROGATE_TRAINING, thesis.ONE_SURROGATE, thesis.SURROGATE_TRAINING, thesis.SURROGATE,
        thesis.ONE_N4SID_TRAINING, thesis.ONE_N4SID, thesis.N4SID_OUTPUT, thesis.N4SID_PARAMETER,
    )  # fmt: skip
    numbers = [f"{fit:.2f}" for column in columns for fit in column.fits.values()]
    factors = [one for row in thesis.REAL_TIME_FACTORS_BY_DATA.values() for one in row if one is not None]
    for number in [*numbers, *map(str, factors)]:
        assert f"thesis\N{NO-BREAK SPACE}{number}<".replace("-", "\N{MINUS SIGN}") in page
    for title in ("Figure 4.35", "Table 4.4", "Table 4.5", "Table 4.6", "Figure 4.33"):
        assert f"<h2>{title}" in page
    (fit,) = (
        one["fit"] for one in small.records
        if (one["route"], one["data_set"], one["signal"]) == ("M41", "wr_validation", "F_p")
    )  # fmt: skip
    assert f'<data value="{fit!r}">{fit:.2f}</data>' in page
    assert page.count("<svg ") == 5 and "T31" in page and "not in the thesis" in page


def test_pages_stand_alone_and_the_first_leads_to_the_others(small: StudyResult) -> None:
    first = (small.folder / "report.html").read_text(encoding="utf-8")
    links = re.findall(r'href="([^"#]+)"', first)
    assert links == ["report_Blow.html"] and (small.folder / links[0]).is_file()
    page = (small.folder / links[0]).read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!#)', page) and "<script" not in page
    limits = ("<th>of another set</th>", "<th>no machine is that fast</th>")
    assert [limit in first for limit in limits] == [True, True]
    assert [limit in page for limit in limits] == [False, True]


def test_the_study_is_twelve_signals_times_ten_models() -> None:
    draws = range(1, len(FULL.seeds) + 1)
    labels = [f"M1{k + 1}" for k in range(len(FULL.linearised_at))]
    labels += [f"M{family}{draw}" for family in (2, 3, 4) for draw in draws]
    ten = ["M11", "M12", "M13", "M21", "M22", "M23", "M31", "M32", "M33", "M41"]
    assert (
        [label for label in labels if in_thesis(label)] == ten
        and not in_thesis("T31")
        and not in_thesis("L11")
    )
    assert len(FULL.signals()) == 12 and FULL.sets == ("A", "Blow")
    assert {one.duration for one in FULL.signals()} == {70.0}
    assert [one.slew_rate for one in FULL.signals()] == sorted(FULL.slew_rates)
    spans = [(one.slew_rate or 0.0) * 70.0 / (one.high - one.low) for one in FULL.signals()]
    assert min(spans) > 1.0  # every signal passes the whole range
    ratios = np.array(FULL.slew_rates[1:]) / FULL.slew_rates[:-1]
    assert ratios.min() > 1.15 and ratios.max() < 1.25


def test_the_limits_are_those_that_were_promised() -> None:
    asked = {(one.where.get("wbm"), one.where.get("route"), one.worst) for one in FULL.limits
             if one.measure is None}  # fmt: skip
    assert asked == {("A", "M41", 95.0), ("Blow", "M41", 99.0), ("A", None, 95.0), ("Blow", None, 99.0)}
    assert all(one.combine == "worst" for one in FULL.limits if one.measure is None)
    every = [one.where for one in FULL.limits if one.measure is None and "route" not in one.where]
    assert all((one["model"], one["blending"]) == ("n4sid", "parameter") for one in every)
    timed = {one.where["wbm"]: one.worst for one in FULL.limits if one.measure == BATCH}
    assert timed == {"A": 0.01, "Blow": 0.01}


HARMLESS = {"title": "x", "signal_seed": 9, "slew_rates": [0.1, 0.2]}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"slew_rates": []}, "slew_rates"),
        ({"slew_rates": [0.1, -0.1]}, "slew_rates"),
        ({"slew_rates": [0.1, 0.1001]}, "the same to a millimetre per second: slew_100_mm_s"),
        ({"signal_seed": 3}, "signal_seed 3 is a seed of training data"),
        ({"seeds": [1, 1]}, "twice: 1"),
        ({"seeds": []}, "seeds"),
        ({"seeds": list(range(10, 20))}, "seeds: 9 at most"),
        ({"operating_point": 1.3}, "no local model stands there; use 0.75, 1.25, 1.75, 2.25"),
        ({"linearised_at": [1.25, 1.25]}, "each of them once"),
        ({"signal_duration": 0.0}, "signal_duration"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changes: dict[str, Any], said: str) -> None:
    parse_settings(CompareSettings, HARMLESS, "test")
    with pytest.raises(SettingsError, match=said):
        parse_settings(CompareSettings, HARMLESS | changes, "test")
