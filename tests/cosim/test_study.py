"""Limits are judged as they read, and a study is the same over one process and over two."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cosimulation.settings import STUDIES, load_settings, parse_settings
from cosimulation.study import run_study
from cosimulation.study.job import STUDIES as KNOWN
from cosimulation.study.limits import Limit, judge
from cosimulation.study.page import colour
from fmu_builder.errors import SettingsError
from identification.scores import FIELDS

SMALL = """
title = "Small"
sets = ["Blow"]
seeds = [3, 4]
duration = 8.0
whole_range_duration = 12.0
processes = {processes}

[[configurations]]
name = "hat"
network = {{ validity = "hat", blending = "parameter" }}
noises = ["1e-4 m, 1e-2 m/s", "1e-5 m, 1e-3 m/s", "none"]
tables = ["network"]

[[configurations]]
name = "thesis"
network = {{ validity = "gaussian", blending = "output", offsets = "low_pass" }}
tables = ["network"]

[[configurations]]
name = "placed"
placement = "placed"
network = {{ validity = "hat" }}
llms = [3]
tables = ["numbers"]

[[configurations]]
name = "exact"
models = "linearisation"
network = {{ validity = "hat" }}
llms = [2, 4]
tables = ["network", "numbers"]

[[tables]]
name = "network"
title = "Networks side by side"
text = "Seen here & there."
llms = [4]
every_noise = true
figure = "seeds"

[[tables]]
name = "numbers"
title = "More and fewer"
text = ""
figure = "over_llms"

[[own_operating_point]]
route = "own"
subspace = {{ order = 6, block_rows = 30 }}

[[own_operating_point]]
route = "own, exact"
models = "linearisation"

[[limits]]
label = "reachable"
where = {{ wbm = "Blow", route = "hat", noise = "none", signal = "F_p" }}
median = 50.0

[[limits]]
label = "out of reach"
where = {{ wbm = "Blow", route = "hat", noise = "none", signal = "F_p" }}
yardstick = {{ wbm = "Blow", route = "exact", llms = 4, signal = "F_p" }}
worst = 100.0
"""
HARMLESS = {"title": "x", "configurations": [{"name": "one", "network": {}}]}


def record(**changes: Any) -> dict[str, Any]:
    fixed = {"wbm": "A", "split": "test", "signal": "F_p", "llms": 4}
    return {**dict.fromkeys(FIELDS), **fixed, **changes}


def test_median_and_worst_are_over_seeds() -> None:
    records = [record(seed=seed, fit=fit) for seed, fit in enumerate((90.0, 95.0, 99.0))]
    verdict = judge(Limit(label="x", where={"wbm": "A"}, median=95.0, worst=90.0), records)
    assert (verdict.median, verdict.worst, verdict.seeds, verdict.passed) == (95.0, 90.0, 3, True)
    assert judge(Limit(label="x", where={"wbm": "A"}, worst=90.1), records).passed is False
    assert judge(Limit(label="x", where={"wbm": "A"}, median=95.1), records).passed is False


def test_alternatives_of_one_seed_are_combined_as_asked() -> None:
    records = [record(seed=1, fit=fit, llms=llms) for llms, fit in ((4, 90.0), (6, 99.0))]
    assert judge(Limit(label="x", where={"wbm": "A"}), records).median == 99.0
    assert judge(Limit(label="x", where={"wbm": "A"}, combine="worst"), records).median == 90.0


def test_validation_data_and_other_models_do_not_count() -> None:
    records = [
        record(seed=1, fit=50.0),
        record(seed=2, fit=99.0, split="validation"),
        record(seed=3, fit=9.0, wbm="B"),
    ]
    assert judge(Limit(label="x", where={"wbm": "A"}), records).seeds == 1


def test_several_numbers_are_alternatives() -> None:
    records = [record(seed=1, fit=fit, llms=llms) for llms, fit in ((4, 90.0), (6, 95.0), (8, 99.0))]
    assert judge(Limit(label="x", where={"llms": (4, 6)}), records).median == 95.0


def test_the_yardstick_is_told_where_a_limit_fails() -> None:
    records = [record(seed=seed, fit=90.0 + seed, model="n4sid") for seed in (1, 2, 3)]
    records += [record(seed=seed, fit=95.0 + seed, model="linearisation") for seed in (1, 2, 3)]
    where, yardstick = {"model": "n4sid"}, {"model": "linearisation"}
    failed = judge(Limit(label="x", where=where, yardstick=yardstick, median=93.0), records)
    assert failed.yardstick == 97.0 and "exact linearisations 97.000" in failed.line()
    passed = judge(Limit(label="x", where=where, yardstick=yardstick, median=92.0), records)
    assert passed.yardstick == 97.0 and "97" not in passed.line()
    assert judge(Limit(label="x", where=where, median=93.0), records).yardstick is None


def test_differences_are_taken_seed_by_seed() -> None:
    records = [record(seed=1, fit=90.0), record(seed=2, fit=80.0)]
    records += [record(seed=1, fit=89.0, blending="output"), record(seed=2, fit=81.0, blending="output")]
    limit = Limit(label="x", where={"blending": None}, less={"blending": "output"}, worst=0.0)
    verdict = judge(limit, records)
    assert (verdict.worst, verdict.passed) == (-1.0, False)


def test_a_difference_to_a_model_that_failed_does_not_pass() -> None:
    records = [record(seed=1, fit=90.0), record(seed=1, fit=None, blending="output")]
    limit = Limit(label="x", where={"blending": None}, less={"blending": "output"}, worst=-1.0, median=-1.0)
    assert judge(limit, records).passed is False


def test_a_model_that_fails_is_the_worst_and_no_data_never_pass() -> None:
    verdict = judge(Limit(label="x", where={"wbm": "A"}, worst=0.0), [record(seed=1, fit=None)])
    assert verdict.passed is False
    assert judge(Limit(label="x", where={"wbm": "none such"}, worst=0.0), []).passed is False
    assert judge(Limit(label="x", where={"wbm": "A"}), [record(seed=1, fit=1.0)]).passed is None


def measure(seed: int, value: float | None, **changes: Any) -> dict[str, Any]:
    return {"measure": "error", "wbm": "A", "seed": seed, "value": value, "unit": "kg", **changes}


def test_measures_have_largest_values() -> None:
    measures = [measure(1, 2.0), measure(1, 3.0), measure(2, 1.0), measure(3, 9.0, wbm="B")]
    verdict = judge(
        Limit(label="x", measure="error", where={"wbm": "A"}, median=2.0, worst=3.0), [], measures
    )
    assert (verdict.median, verdict.worst, verdict.seeds, verdict.passed) == (2.0, 3.0, 2, True)
    assert verdict.unit == "kg" and "median <= 2, worst <= 3" in verdict.line()
    assert judge(Limit(label="x", measure="error", where={}, worst=8.9), [], measures).passed is False
    assert judge(Limit(label="x", measure="error", where={}, median=2.9), [], measures).passed is False


def test_a_verdict_has_the_unit_of_what_it_is_about() -> None:
    measures = [measure(1, 2.0), measure(1, 7.0, wbm="B", unit="N.m"), measure(1, 0.5, wbm="C", unit="1")]
    units = [
        judge(Limit(label="x", measure="error", where={"wbm": name}), [], measures).unit for name in "ABC"
    ]
    assert units == ["kg", "N.m", ""]
    line = judge(Limit(label="x" * 80, measure="error", where={}), [], measures).line()
    assert f"{'x' * 80} median" in line


def test_what_is_counted_has_a_largest_sum() -> None:
    measures = [measure(1, 1.0), measure(1, 0.0), measure(2, 1.0), measure(3, 0.0, wbm="B")]
    limit = Limit(label="x", measure="error", where={"wbm": "A"}, total=2)
    verdict = judge(limit, [], measures)
    assert verdict.passed is True and "2 of 3" in verdict.line() and "total <= 2" in verdict.line()
    assert judge(limit.model_copy(update={"total": 1.0}), [], measures).passed is False
    assert judge(limit, [], []).passed is False
    assert judge(limit, [], [measure(1, None)]).passed is False
    with pytest.raises(ValueError, match="total is of a measure"):
        Limit(label="x", where={}, total=2)


def test_a_measure_that_could_not_be_taken_never_passes() -> None:
    limit = Limit(label="x", measure="error", where={"wbm": "A"}, worst=5.0)
    assert judge(limit, [], [measure(1, 1.0), measure(1, None)]).passed is False
    assert judge(limit, [], []).passed is False
    with pytest.raises(KeyError, match="mode"):
        judge(Limit(label="x", measure="error", where={"mode": "L"}), [], [measure(1, 1.0)])


def test_a_limit_on_a_field_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(KeyError, match="wmb"):
        judge(Limit(label="x", where={"wmb": "A"}), [])


def test_colours_go_from_red_over_yellow_to_green() -> None:
    assert colour(-5.0) == colour(0.0) != colour(50.0) != colour(100.0)


OF_THEIR_OWN_TESTS = {"shipped", "white_box", "compare", "contact", "extrapolation"}


@pytest.mark.parametrize("name", sorted(set(KNOWN) - OF_THEIR_OWN_TESTS))
def test_the_settings_that_come_with_a_study_are_valid_and_their_limits_can_be_met(name: str) -> None:
    settings = load_settings(KNOWN[name].settings, STUDIES / f"{name}.toml")
    assert len(settings.seeds) == 8
    configurations = getattr(settings, "configurations", ())
    known = {route for one in configurations for route in getattr(one, "routes", (one.name,))}
    measured = {one.name for one in configurations if getattr(one, "detailed", False)}
    known |= {one.route for one in getattr(settings, "own_operating_point", ())}
    for limit in settings.limits:
        if limit.measure is not None:
            assert measured and limit.where.get("route", min(measured)) in measured
            continue
        assert {limit.where["route"]} <= known
        assert not limit.less or limit.less["route"] in known
        assert not limit.yardstick or limit.yardstick["route"] in known


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"configurations": [{"name": "one", "network": {}}, {"name": "one", "network": {}}]},
            "twice: one, A",
        ),
        ({"configurations": [{"name": "one", "network": {}, "tables": ["no such"]}]}, "no table no such"),
        ({"tables": [{"name": "t", "title": "T", "text": ""}]}, "'one': stands in no table"),
        ({"configurations": [{"name": "one", "network": {}, "noises": ["loud"]}]}, "noises"),
        ({"sets": []}, "sets"),
        ({"sets": ["A", "A"]}, "twice: A"),
        ({"sets": ["A", "X"]}, "no white-box set X; there are A, A60, B, Blow"),
        ({"seeds": []}, "seeds"),
        ({"seeds": [3, 1, 3]}, "twice: 3"),
        ({"seeds": [-1]}, "from 0 on"),
    ],
)
def test_settings_that_contradict_themselves_are_refused(changes: dict[str, Any], said: str) -> None:
    parse_settings(KNOWN["blending"].settings, HARMLESS, "test")
    with pytest.raises(SettingsError, match=said):
        parse_settings(KNOWN["blending"].settings, HARMLESS | changes, "test")


def test_an_unknown_study_is_answered_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="order, blending"):
        run_study("ordre", tmp_path / "x")
    with pytest.raises(SettingsError, match="configurations"):
        parse_settings(KNOWN["blending"].settings, {"title": "x"}, "test")


def test_seeds_of_the_command_line_are_checked_like_those_of_the_file(tmp_path: Path) -> None:
    for seeds, said in (((101,), "signal_seed 101"), ((2, 2), "twice: 2"), ((-4,), "from 0 on")):
        with pytest.raises(SettingsError, match=said):
            run_study("compare", tmp_path / "x", seeds=seeds)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    folders = {}
    for processes in (1, 2):
        folder = tmp_path_factory.mktemp(f"study{processes}")
        (folder / "small.toml").write_text(SMALL.format(processes=processes), encoding="utf-8")
        result = run_study("blending", folder / "out", folder / "small.toml")
        assert [verdict.passed for verdict in result.verdicts] == [True, False]
        folders[processes] = folder / "out"
    return folders


def test_processes_change_nothing(small: dict[int, Path]) -> None:
    one, two = (json.loads((small[count] / "scores.json").read_text(encoding="utf-8")) for count in (1, 2))
    assert one == two
    assert all(tuple(item) == FIELDS for item in one)


def test_the_yardstick_knows_the_model_and_is_never_recommended(small: dict[int, Path]) -> None:
    scores = json.loads((small[2] / "scores.json").read_text(encoding="utf-8"))
    assert {item["recommended"] for item in scores if item["model"] == "linearisation"} == {False}
    assert {item["recommended"] for item in scores if item["model"] == "n4sid"} == {True, False}
    fits = {
        (item["route"], item["data_set"], item["seed"]): item["fit"]
        for item in scores
        if item["signal"] == "F_p" and item["split"] == "test" and item["noise"] == "none"
    }
    assert all(fits["own, exact", f"OP{point}", seed] > 99.0 for point in (25, 45, 65, 85) for seed in (3, 4))


def test_the_page_shows_limits_and_every_configuration(small: dict[int, Path]) -> None:
    page = (small[2] / "report.html").read_text(encoding="utf-8")
    words = [
        "reachable",
        "out of reach",
        ">pass<",
        ">FAIL<",
        ">hat<",
        ">thesis<",
        "4 LLM.",
        "own, OP45",
        "2 seeds",
    ]
    for word in (
        *words,
        "Seen here &amp; there.",
        '<tr class="yardstick"><th>exact<',
        "<th>3 LLM<",
        ">placed<",
    ):
        assert word in page, word
    assert page.count("<svg") == 2
    quiet, loud = page.index("<th>hat, noise of 1e-5 m"), page.index("<th>hat, noise of 1e-4 m")
    assert page.index("<th>hat<") < quiet < loud
    assert "<script" not in page and "http://" not in page.replace("http://www.w3.org", "")
