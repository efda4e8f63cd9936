"""The study of LOLIMOT on short data: records, findings, page. That a blend soars, full data show."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from cosimulation.settings import parse_settings
from cosimulation.study import run_study
from cosimulation.study.lolimot import LolimotStudySettings
from cosimulation.study.lolimot.sections import THESIS_POLES
from cosimulation.study.runner import StudyResult
from fmu_builder.errors import SettingsError
from tolerances import SAME_FREE_RUN

SHORT = """
title = "Short"
sets = ["A"]
seeds = [5]
training_duration = 24.0
test_duration = 12.0
dense = { duration = 24.0 }
processes = 1

[[configurations]]
name = "order 6"
outputs = ["phi_1", "xi"]
forms = ["regressors", "modal", "outputs blended"]
detailed = true

[[configurations]]
name = "force, late"
outputs = ["F_p"]
lolimot = { every = 2 }

[[configurations]]
name = "force, at once"
outputs = ["F_p"]
lolimot = { delay = 0, every = 2 }

[[configurations]]
name = "even"
lolimot = { most_models = 5, every = 4 }

[[configurations]]
name = "dense"
lolimot = { most_models = 5, every = 4 }
dense = true

[[limits]]
label = "phi_1"
where = { wbm = "A", route = "order 6", structure = "free run", signal = "phi_1" }
median = 88.25

[[limits]]
label = "stable"
measure = "spectral radius of local models"
where = { route = "order 6" }
worst = 0.9999
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    folder = tmp_path_factory.mktemp("lolimot")
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    return run_study("lolimot", folder / "out", folder / "short.toml")


def fit(result: StudyResult, route: str, structure: str, signal: str) -> float:
    (found,) = (
        one["fit"]
        for one in result.records
        if (one["route"], one["structure"], one["signal"]) == (route, structure, signal)
    )
    return -np.inf if found is None else float(found)


def findings(result: StudyResult, kind: str) -> list[dict[str, Any]]:
    text = (result.folder / "findings.json").read_text(encoding="utf-8")
    return [one for one in json.loads(text) if next(iter(one)) == kind]


def test_limits_on_scores_and_on_measures_are_judged(result: StudyResult) -> None:
    """So short a record leaves one local model unstable, which does not keep it from being scored."""
    assert [verdict.passed for verdict in result.verdicts] == [True, False]
    assert 1.0 < result.verdicts[1].worst < 1.01


def test_one_step_is_better_than_a_free_run(result: StudyResult) -> None:
    for signal in ("phi_1", "xi"):
        assert 99.9 < fit(result, "order 6", "one step", signal) < 100.0
        assert fit(result, "order 6", "free run", signal) < fit(result, "order 6", "one step", signal)


def test_the_fmu_of_states_in_common_is_the_free_run(result: StudyResult) -> None:
    for signal in ("phi_1", "xi"):
        free, states = (fit(result, "order 6", name, signal) for name in ("free run", "regressors"))
        assert states == pytest.approx(free, abs=SAME_FREE_RUN)
        assert fit(result, "order 6", "modal", signal) != pytest.approx(free, abs=100 * SAME_FREE_RUN)


def test_a_force_from_the_motion_is_worse_than_the_motion(result: StudyResult) -> None:
    motion, force = (
        fit(result, "order 6", "free run", "xi"),
        fit(result, "order 6", "free run, from xi", "F_p"),
    )
    assert force < motion - 5.0


def test_a_force_of_its_own_needs_the_input_of_its_own_row(result: StudyResult) -> None:
    assert fit(result, "force, at once", "one step", "F_p") > 99.0
    assert fit(result, "force, late", "one step", "F_p") < 90.0


def test_findings_tell_where_errors_are_largest(result: StudyResult) -> None:
    measures = {(one["measure"], one["form"]): one for one in findings(result, "measure")}
    worst = measures["largest error over range", "regressors"]
    assert 0.0 < worst["value"] < 1.0
    assert 3.0 <= worst["time"] < 12.0
    assert 0.5 < worst["eta"] < 2.5
    local = measures["spectral radius of local models", "all"]["value"]
    assert measures["spectral radius of the blend", "outputs blended"]["value"] == pytest.approx(local)
    ratio = worst["value"] / measures["largest error over range", "modal"]["value"]
    assert measures["error left by states in common", "modal"]["value"] == pytest.approx(ratio)


def test_the_tree_goes_where_the_data_are(result: StudyResult) -> None:
    edges = {one["route"]: one["edges"] for one in findings(result, "growth") if one["growth"] == "phi_1"}
    low = {route: sum(edge < 1.0 for edge in found) for route, found in edges.items()}
    assert low["dense"] > low["even"]
    for one in findings(result, "growth"):
        assert [edge for edge in one["edges"] if edge in (0.5, 2.5)] == [0.5, 2.5]
        assert len(one["rows"]) == len(one["edges"]) - 1


def test_the_page_shows_figure_poles_and_thesis(result: StudyResult) -> None:
    page = (result.folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 1
    for word in ("phi_1", "states in common", "thesis, LLM 4", "88.25", "one step, from xi"):
        assert word in page, word
    poles = findings(result, "poles")
    assert {one["poles"] for one in poles} == {
        0.5 * (low + high)
        for one in findings(result, "growth")
        if (one["route"], one["growth"]) == ("order 6", "phi_1")
        for low, high in zip(one["edges"][:-1], one["edges"][1:], strict=True)
    }
    assert all(one["imaginary"] >= 0.0 for one in poles)
    assert result.lines[0].startswith("phi_1")
    assert len(result.lines) == 1 + 3


def test_the_poles_of_the_thesis_have_its_frequencies_and_damping() -> None:
    """Its table prints frequency and damping beside them."""
    printed = (
        ((19.6996, 0.0801802), (71.749, 0.512797), (2361.14, 0.165703)),
        ((20.3346, 0.0935161), (92.877, 0.180015), (2529.17, 0.105693)),
        ((19.2474, 0.14764), (82.4285, 0.111765), (2449.57, 0.173919)),
        ((20.8698, 0.076533), (84.0387, 0.123747), (2497.54, 0.164886)),
    )
    for (_, poles), expected in zip(THESIS_POLES, printed, strict=True):
        for (real, imaginary), (frequency, damping) in zip(poles, expected, strict=True):
            s = np.log(complex(real, imaginary)) / 0.001
            assert abs(s) == pytest.approx(frequency, rel=1e-3)
            assert -s.real / abs(s) == pytest.approx(damping, rel=1e-2)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"outputs": ["phi_2"]}, "no output phi_2"),
        ({"outputs": ["xi"], "detailed": True}, "phi_1 is what is shown in detail"),
        ({"forms": ["jordan"]}, "forms"),
        ({"lolimot": {"scheduling": {"eta": [2.0, 1.0]}}}, "does not ascend"),
    ],
)
def test_settings_that_contradict_themselves_are_refused(changes: dict[str, Any], said: str) -> None:
    good = {"title": "x", "configurations": [{"name": "one"}]}
    parse_settings(LolimotStudySettings, good, "test")
    with pytest.raises(SettingsError, match=said):
        parse_settings(LolimotStudySettings, {**good, "configurations": [{"name": "one", **changes}]}, "test")
    with pytest.raises(SettingsError, match="twice: one"):
        parse_settings(LolimotStudySettings, {**good, "configurations": [{"name": "one"}] * 2}, "test")
