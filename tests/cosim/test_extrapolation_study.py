"""The study beyond the trained region, in small: its records against the models run by hand."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fmus
import tolerances
from cosimulation.fmu_file import open_fmu
from cosimulation.settings import STUDIES, load_settings, parse_settings
from cosimulation.study import run_study
from cosimulation.study.extrapolation import ExtrapolationSettings, words
from cosimulation.study.extrapolation.inputs import inputs_of, trained_region
from cosimulation.study.extrapolation.results import Results
from cosimulation.study.extrapolation.task import QUANTILE_MEASURE, RATIO_MEASURE, phasor, policies
from cosimulation.study.limits import judge
from cosimulation.study.runner import StudyResult
from fmu_builder.errors import SettingsError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set.components import TrainedRegion
from fmus.wbm import native, parameter_sets
from identification.scores import fit_percent

SMALL: dict[str, Any] = {
    "title": "Small",
    "sets": ["A"],
    "seeds": [4, 5],
    "processes": 1,
    "causes": [
        {"name": "height", "values": [0.55, 1.5, 2.6, 3.419], "inside": 1.5, "duration": 4.0},
        {"name": "speed", "values": [0.03, 3.0], "inside": 0.03, "trained": [0.0, 0.03], "duration": 4.0},
        {"name": "noise", "values": [1.0, 4.0], "inside": 1.0, "trained": [0.0, 1.0], "duration": 4.0},
        {"name": "frequency", "values": [3.0, 40.0], "inside": 3.0, "duration": 4.0},
        {"name": "torque", "values": [1310.9, 1500.0], "inside": 1310.9, "duration": 4.0},
    ],
    "limits": [
        {"label": "failed", "measure": "run that failed", "where": {}, "total": 0.0},
        {"label": "silent", "measure": "samples beyond the limits not told", "where": {}, "total": 0.0},
    ],
}
F_P = native.OUTPUTS.index("F_p")
NETWORK = "surrogate"


@dataclass(frozen=True)
class Small:
    folder: Path
    settings: ExtrapolationSettings
    result: StudyResult
    scores: list[dict[str, Any]]
    findings: list[dict[str, Any]]

    def found(self, measure: str, cause: str, at: float, network: str = NETWORK, seed: int = 4) -> float:
        wanted = {
            "measure": measure, "cause": cause, "at": at, "network": network, "seed": seed, "policy": "warn",
        }  # fmt: skip
        (item,) = [one for one in self.findings if all(one[key] == wanted[key] for key in wanted)]
        return float("nan") if item["value"] is None else float(item["value"])

    def inputs(self, cause: str, at: float) -> np.ndarray:
        return np.asarray(inputs_of(self.settings.cause(cause), at, self.settings, 4))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Small:
    folder = tmp_path_factory.mktemp("extrapolation")
    settings = parse_settings(ExtrapolationSettings, SMALL, "test")
    (folder / "small.toml").write_text(_toml(SMALL), encoding="utf-8")
    result = run_study("extrapolation", folder / "out", folder / "small.toml")
    read = [
        json.loads((folder / "out" / f"{name}.json").read_text("utf-8")) for name in ("scores", "findings")
    ]
    return Small(folder / "out", settings, result, *read)


def _toml(tables: dict[str, Any]) -> str:
    """Inline tables throughout: JSON with = for : in objects."""

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{key} = {text(one)}" for key, one in value.items()) + " }"
        return f"[{', '.join(map(text, value))}]" if isinstance(value, list) else json.dumps(value)

    return "\n".join(f"{key} = {text(value)}" for key, value in tables.items())


def by_hand(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F_p (N) of the white-box model and of a network, without any FMU."""
    reference = native.simulate(parameter_sets()["A"], inputs, 1e-3)[:, F_P]
    return reference, simulate(fmus.network(NETWORK), inputs)[:, -1]


def test_the_claims_hold_and_all_runs_were_made(small: Small) -> None:
    assert [verdict.passed for verdict in small.result.verdicts] == [True, True]
    assert small.result.verdicts[0].records == len(policies_offered()) * 2 * (2 * 10 + 2)


def policies_offered() -> tuple[str, ...]:
    with open_fmu(fmus.path(NETWORK)) as fmu:
        return policies(fmu)


@pytest.mark.parametrize(
    ("cause", "at"), [("height", 2.6), ("speed", 3.0), ("noise", 4.0), ("torque", 1500.0)]
)
def test_errors_are_those_of_the_models_run_by_hand(small: Small, cause: str, at: float) -> None:
    reference, force = by_hand(small.inputs(cause, at))
    counted = slice(len(force) // 4, None)
    error = np.abs(force - reference)[counted]
    assert small.found("largest error of F_p", cause, at) == pytest.approx(error.max())
    assert small.found(QUANTILE_MEASURE, cause, at) == pytest.approx(np.quantile(error, 0.95))
    (score,) = [
        item["fit"]
        for item in small.scores
        if (item["model"], item["data_set"], item["signal"], item["seed"])
        == ("surrogate", f"{cause} {at:g}, warn", "F_p", 4)
    ]
    assert score == pytest.approx(fit_percent(reference, force), abs=tolerances.SHIPPED_SCORE)


def test_errors_are_told_against_the_same_inside(small: Small) -> None:
    ratio = small.found(QUANTILE_MEASURE, "height", 2.6) / small.found(QUANTILE_MEASURE, "height", 1.5)
    assert small.found(RATIO_MEASURE, "height", 2.6) == pytest.approx(ratio)
    assert small.found(RATIO_MEASURE, "height", 1.5) == 1.0
    assert ratio > 10.0


def test_the_time_beyond_the_limits_is_what_is_counted_in_the_inputs(small: Small) -> None:
    eta, torque = fmus.network(NETWORK).inputs
    for cause, at in (("height", 0.55), ("height", 1.5), ("torque", 1500.0), ("torque", 1310.9)):
        inputs = small.inputs(cause, at)
        inside = [
            eta.minimum <= row[0] <= eta.maximum and torque.minimum <= row[1] <= torque.maximum
            for row in inputs.tolist()
        ]
        share = 100.0 * (1.0 - sum(inside) / len(inside))
        assert small.found("time beyond the limits of the inputs", cause, at) == pytest.approx(share)
        assert small.found("time out of range", cause, at) >= share - 100.0 / len(inputs)
    assert small.found("time out of range", "height", 0.55) > 99.0


def test_where_the_white_box_model_gives_out_the_network_still_answers(small: Small) -> None:
    at = 3.419
    assert small.found("white-box model gave out", "height", at, "white-box") == 1.0
    assert small.found("run that failed", "height", at) == 0.0
    assert np.isfinite(small.found("largest |F_p| of the network", "height", at))
    names = {item["measure"] for item in small.findings if item["at"] == at}
    assert QUANTILE_MEASURE not in names
    assert any("white-box model gave out" in line for line in small.result.lines)


def test_the_fast_wire_is_as_fast_as_it_says_and_stays_between_the_ends() -> None:
    settings = parse_settings(ExtrapolationSettings, SMALL, "test")
    cause = settings.cause("speed")
    smooth = inputs_of(cause, 3.0, settings, 4)[:, 0] - inputs_of(cause, 1e-9, settings, 4)[:, 0] + 0.6
    assert np.abs(np.diff(smooth)).max() / 1e-3 == pytest.approx(3.0, rel=1e-3)
    assert smooth.min() == pytest.approx(0.6, abs=1e-6)
    assert smooth.max() == pytest.approx(2.4, abs=1e-5)


def test_every_cause_varies_one_thing() -> None:
    settings = parse_settings(ExtrapolationSettings, SMALL, "test")
    for name, column in (("height", 0), ("speed", 0), ("noise", 0), ("torque", 1)):
        cause = settings.cause(name)
        one, other = (inputs_of(cause, at, settings, 4) for at in cause.values[:2])
        assert one[:, 1 - column].tolist() == other[:, 1 - column].tolist()
        assert one[:, column].tolist() != other[:, column].tolist()


def test_a_phasor_has_the_amplitude_and_phase_of_the_sine() -> None:
    time = 1e-3 * np.arange(2000)
    found = phasor(70.0 + 3.0 * np.cos(2.0 * np.pi * 7.0 * time + 0.4), 7.0)
    assert abs(found) == pytest.approx(3.0)
    assert np.angle(found) == pytest.approx(0.4)


def test_the_response_at_a_frequency_is_that_of_the_linearised_models(small: Small) -> None:
    """Amplitude of F_p beside the white-box model's, 0.5 mm at 1.5 m: near one at both frequencies."""
    for at in (3.0, 40.0):
        reference, force = by_hand(small.inputs("frequency", at))
        ratio = np.ptp(force[-1000:]) / np.ptp(reference[-1000:])
        found = small.found("amplitude of F_p beside the white-box model's", "frequency", at)
        assert found == pytest.approx(ratio, rel=tolerances.SINE_RESPONSE)


def described(*items: str, name: str = "out_of_range") -> Any:
    declared = SimpleNamespace(items=[SimpleNamespace(name=one) for one in items]) if items else None
    variable = SimpleNamespace(name=name, declaredType=declared)
    return SimpleNamespace(description=SimpleNamespace(modelVariables=[variable]))


def test_clamp_is_run_where_the_fmu_offers_it() -> None:
    assert policies(described("warn", "clamp", "error")) == ("warn", "clamp")
    assert policies(described("warn", "error")) == ("warn",)
    assert policies(described()) == ("warn",)
    assert policies(described("warn", "clamp", name="other")) == ("warn",)


def test_the_page_shows_both_policies_where_both_were_run(small: Small) -> None:
    findings = [item for item in small.findings if item["policy"] == "warn"]
    scores = [item for item in small.scores if item["data_set"].endswith("warn")]
    findings += [{**item, "policy": "clamp"} for item in findings]
    scores += [
        {**item, "data_set": item["data_set"].replace("warn", "clamp"), "fit": 12.0} for item in scores
    ]
    cause = small.settings.cause("height")
    both = Results(small.settings, scores, findings)
    assert both.policies == ("warn", "clamp")
    assert "FIT 12 % in place of" in words.clamped(both, "A", cause)


def test_the_words_follow_the_figures(small: Small) -> None:
    results = Results(small.settings, small.scores, small.findings)
    cause = small.settings.cause("height")
    assert words.usable(results, "A", cause) == (0.55, 1.5)
    assert "gave out at 3.419 m" in words.span(results, "A", cause)
    lax = small.settings.model_copy(update={"usable_fit": -1000.0})
    assert words.usable(Results(lax, small.scores, small.findings), "A", cause) == (0.55, 2.6)
    page = (small.folder / "report.html").read_text(encoding="utf-8")
    assert words.span(results, "A", cause) in page
    assert page.count("<svg") == 5


def test_the_trained_region_comes_from_the_parameter_set_first(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = load_settings(ExtrapolationSettings, STUDIES / "extrapolation.toml")
    known = fmus.network(NETWORK)
    heights = trained_region(NETWORK, settings.cause("height"))
    assert heights == (known.inputs[0].minimum, known.inputs[0].maximum)
    assert trained_region(NETWORK, settings.cause("noise")) == (0.0, 1.0)
    told = TrainedRegion(rate=3.0, frequency_bands={"eta": (0.1, 33.0)})
    monkeypatch.setattr(fmus, "network", lambda _: known.replaced(trained_region=told))
    trained_region.cache_clear()
    assert trained_region(NETWORK, settings.cause("frequency")) == (0.1, 33.0)
    trained_region.cache_clear()


def test_every_cause_leaves_the_region_that_any_network_was_trained_in() -> None:
    settings = load_settings(ExtrapolationSettings, STUDIES / "extrapolation.toml")
    for network in fmus.NETWORKS:
        for cause in settings.causes:
            region = trained_region(network, cause)
            assert region is not None
            assert region[0] <= cause.inside <= region[1]
            assert min(cause.values) < region[0] or max(cause.values) > region[1]


def test_a_clamped_wire_is_printed_and_not_held_against_the_network() -> None:
    settings = load_settings(ExtrapolationSettings, STUDIES / "extrapolation.toml")
    measure = "largest |F_p| beside the white-box model's"
    served, clamped = (limit for limit in settings.limits if limit.measure == measure)
    records = [
        {"measure": measure, "policy": policy, "seed": 1, "value": value, "unit": "1"}
        for policy, value in (("warn", 1.5), ("clamp", 3.5))
    ]
    assert (judge(served, [], records).worst, judge(served, [], records).passed) == (1.5, True)
    assert (judge(clamped, [], records).worst, judge(clamped, [], records).passed) == (3.5, None)
    records[0]["value"] = 2.5
    assert judge(served, [], records).passed is False
    assert judge(clamped, [], records[:1]).passed is None  # FMUs without the choice


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"values": [2.0, 1.0], "inside": 1.0}, "values must rise"),
        ({"values": [1.0, 2.0], "inside": 3.0}, "inside = 3 is none of its values"),
        ({"values": [-1.0, 2.0], "inside": 2.0}, "-1 is not above zero"),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(SettingsError, match=said):
        parse_settings(ExtrapolationSettings, SMALL | {"causes": [{"name": "noise", **changes}]}, "test")
    with pytest.raises(SettingsError, match="stands there twice"):
        parse_settings(ExtrapolationSettings, SMALL | {"causes": SMALL["causes"][:1] * 2}, "test")
