"""The study of friction and lift-off, in small: its records against the models run by hand."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fmus
import tolerances
from cosimulation.settings import STUDIES, load_settings, parse_settings
from cosimulation.study import run_study
from cosimulation.study.contact import ContactSettings, words
from cosimulation.study.contact.results import Results
from cosimulation.study.contact.situation import Situation
from cosimulation.study.contact.task import TWIN
from cosimulation.study.runner import StudyResult
from fmu_builder.errors import SettingsError
from fmu_builder.kernel import contact_of, simulate
from fmus.wbm import native, parameter_sets
from identification.excitation import ExcitationSettings, whole_range_inputs
from identification.scores import fit_percent

SEED, SECONDS, AMPLITUDE, TORQUE = 5, 8.0, 0.3, 1310.9
SMALL = f"""
title = "Small"
sets = ["Blow"]
seeds = [{SEED}]
duration = {SECONDS}
friction_amplitudes = [1.0, 0.2]
amplitudes = [0.05, {AMPLITUDE}]
torques = [{TORQUE}, 1500.0]
shown_amplitude = {AMPLITUDE}
processes = 1

[[frictions]]
name = "no friction"
coulomb = 0.0

[[frictions]]
name = "20 N.m"
coulomb = 20.0

[[frictions]]
name = "all joints"
coulomb = 10.0
start_values = {{ friction_bend = 0.5, friction_slip_rate = 0.01 }}
axis = false

[[combinations]]
friction = "20 N.m"
amplitude = {AMPLITUDE}

[[limits]]
label = "never negative"
measure = "F_p below zero"
where = {{ contact = "unilateral" }}
worst = 0.0

[[limits]]
label = "hysteresis"
measure = "hysteresis away from 2 T_c / z_1"
where = {{ part = "ramp" }}
worst = 5.0
"""
F_P = native.OUTPUTS.index("F_p")
NETWORK = "n4sid_blow"
LIFT_OFF = Situation("lift-off", "no friction", 0.0, AMPLITUDE, TORQUE, unilateral=True)


@dataclass(frozen=True)
class Small:
    folder: Path
    result: StudyResult
    scores: list[dict[str, Any]]
    findings: list[dict[str, Any]]

    def found(self, measure: str, **where: Any) -> dict[str, Any]:
        wanted = {"measure": measure, **where}
        (item,) = [one for one in self.findings if all(one.get(key) == wanted[key] for key in wanted)]
        return item


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Small:
    folder = tmp_path_factory.mktemp("contact")
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    result = run_study("contact", folder / "out", folder / "small.toml")
    read = [
        json.loads((folder / "out" / f"{name}.json").read_text("utf-8")) for name in ("scores", "findings")
    ]
    return Small(folder / "out", result, *read)


@pytest.fixture(scope="module")
def inputs() -> np.ndarray:
    recipe = ExcitationSettings(noise_rms=0.0012 * AMPLITUDE, torque_amplitude=75.0 * AMPLITUDE)
    return np.asarray(whole_range_inputs(SEED, (700,), SECONDS, settings=recipe).values)


@pytest.fixture(scope="module")
def by_hand(inputs: np.ndarray) -> dict[str, np.ndarray]:
    """F_p (N) of the white-box model and of a network, without any FMU."""
    network = fmus.network(NETWORK)
    lifting = parameter_sets()["Blow"].changed(unilateral=1.0)
    return {
        "reference": native.simulate(lifting, inputs, 1e-3)[:, F_P],
        "unilateral": simulate(network, inputs, contact_of(network))[:, -1],
        "bilateral": simulate(network, inputs)[:, -1],
    }


def test_the_claims_hold(small: Small) -> None:
    assert [verdict.passed for verdict in small.result.verdicts] == [True, True]
    assert small.result.verdicts[0].records > 10


@pytest.mark.parametrize("contact", ["unilateral", "bilateral"])
def test_lost_contact_is_what_is_counted_in_the_forces(
    small: Small, by_hand: dict[str, np.ndarray], contact: str
) -> None:
    where = {"network": NETWORK, "situation": LIFT_OFF.name(contact)}
    counted = slice(round(0.25 * SECONDS * 1000), None)
    ours, theirs = by_hand[contact][counted], by_hand["reference"][counted]
    assert 1.0 < 100.0 * np.mean(theirs == 0.0) < 99.0
    share = small.found("time without contact", **where)
    assert share["value"] == pytest.approx(100.0 * np.mean(ours <= 0.0))
    assert share["reference"] == pytest.approx(100.0 * np.mean(theirs == 0.0))
    losses = small.found("lost contacts", **where)
    begins = [np.sum((one[1:] <= 0.0) & (one[:-1] > 0.0)) + (one[0] <= 0.0) for one in (ours, theirs)]
    assert [losses["value"], losses["reference"]] == begins
    assert small.found("largest F_p", **where)["value"] == pytest.approx(ours.max())
    error = small.found("95 % quantile of the error of F_p", **where)["value"]
    assert error == pytest.approx(np.sort(np.abs(ours - theirs))[int(0.95 * (len(ours) - 1))], rel=0.01)


def test_first_lift_off_is_the_first_of_five_samples_without_contact(
    small: Small, by_hand: dict[str, np.ndarray]
) -> None:
    found = small.found("first lift-off", network=NETWORK, situation=LIFT_OFF.name("unilateral"))
    for field, name in (("value", "unilateral"), ("reference", "reference")):
        gone = by_hand[name] == 0.0
        first = next(row for row in range(len(gone)) if gone[row : row + 5].all())
        assert found[field] == pytest.approx(1e-3 * first)


@pytest.mark.parametrize("contact", ["unilateral", "bilateral"])
def test_fit_is_that_of_the_forces(small: Small, by_hand: dict[str, np.ndarray], contact: str) -> None:
    (score,) = [
        item
        for item in small.scores
        if (item["model"], item["data_set"], item["signal"]) == ("n4sid", LIFT_OFF.name(contact), "F_p")
    ]
    expected = fit_percent(by_hand["reference"], by_hand[contact])
    assert score["fit"] == pytest.approx(expected, abs=tolerances.SHIPPED_SCORE)


def test_hysteresis_is_twice_the_torque_over_the_lift_of_the_arm_at_rest(small: Small) -> None:
    """z_1 from two states of rest, which know neither ramp nor friction."""
    angle = native.OUTPUTS.index("phi_1")
    zeta = native.OUTPUTS.index("zeta")
    low, high = (native.simulate(parameter_sets()["Blow"], [[one, TORQUE]])[0] for one in (1.3, 1.6))
    lift = (high[zeta] - low[zeta]) / (high[angle] - low[angle])
    dry = small.found("width of the hysteresis", network="white-box", friction="20 N.m")
    assert abs(dry["value"] * lift / 40.0 - 1.0) <= tolerances.HYSTERESIS
    assert abs(dry["reference"] * lift / 40.0 - 1.0) <= tolerances.HYSTERESIS
    for network in ("surrogate_blow", NETWORK):
        assert abs(small.found("width of the hysteresis", network=network)["value"]) < 0.01 * dry["value"]


def test_the_raised_wire_is_regained_when_the_white_box_model_regains_it(small: Small) -> None:
    raised = {"part": "jump", "amplitude": 0.02, "contact": "unilateral"}
    assert small.found("first loss after a jump", network="white-box", **raised)["value"] == pytest.approx(
        0.067
    )
    for network in ("surrogate_blow", NETWORK):
        found = small.found("first loss after a jump", network=network, **raised)["value"]
        assert found == pytest.approx(0.067, abs=0.0021)
        assert small.found("first lift-off", network=network, **raised)["value"] == 0.0
    pulling = small.found("smallest F_p", network=NETWORK, **{**raised, "contact": "bilateral"})
    assert pulling["value"] < -1900.0


def test_friction_costs_more_the_smaller_the_movement(small: Small) -> None:
    def fit(friction: str, amplitude: float) -> float:
        coulomb = {"no friction": 0.0, "20 N.m": 20.0}[friction]
        name = Situation("friction", friction, coulomb, amplitude).name("bilateral")
        wanted = ("n4sid", name, "F_p")
        return next(
            item["fit"]
            for item in small.scores
            if (item["model"], item["data_set"], item["signal"]) == wanted
        )

    assert fit("no friction", 1.0) > fit("20 N.m", 1.0) > fit("20 N.m", 0.2)


def test_the_twin_predicts_itself_while_bounces_are_few(small: Small) -> None:
    calm = Situation("lift-off", "no friction", 0.0, 0.05, TORQUE, unilateral=True)
    wanted = (TWIN, calm.name("unilateral"), "F_p")
    fits = [
        item["fit"] for item in small.scores if (item["model"], item["data_set"], item["signal"]) == wanted
    ]
    assert len(fits) == 1 and fits[0] > 99.0


def test_the_words_follow_the_figures(small: Small) -> None:
    settings = parse_settings(ContactSettings, tomllib.loads(SMALL), "test")
    results = Results(settings, small.scores, small.findings)
    assert "amplitude 1: usable up to 20 N.m" in words.friction(results, "Blow")
    strict = Results(settings.model_copy(update={"usable_fit": 99.99}), small.scores, small.findings)
    assert "not usable even without friction" in words.friction(strict, "Blow")
    assert "no hysteresis" in words.hysteresis(results, "Blow")
    assert "Contact lost at once, regained after 67 ms" in words.raised(results, "Blow")
    late = [
        {**one, "reference": 0.004} if one.get("measure") == "first lift-off" else one
        for one in small.findings
    ]
    never = [one for one in small.findings if one.get("measure") != "first lift-off"]
    said = [words.raised(Results(settings, small.scores, one), "Blow") for one in (late, never)]
    assert said[0].startswith("Contact lost after 4 ms, regained")
    assert said[1].startswith("The white-box model keeps contact")
    assert "Not usable at any amplitude tried." in words.ignored(results, "Blow")
    lax = Results(settings.model_copy(update={"usable_fit": -1e3}), small.scores, small.findings)
    assert "Usable up to amplitude 0.3." in words.ignored(lax, "Blow")
    page = (small.folder / "report.html").read_text(encoding="utf-8")
    assert words.raised(results, "Blow") in page
    assert page.count("<svg") == 6


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"frictions": [{"name": "dry", "coulomb": 1.0}]}, "the first of the frictions"),
        ({"combinations": [{"friction": "wet", "amplitude": 1.0}]}, "name no friction: wet"),
        ({"ramp_counted": [0.5, 1.6]}, "inside ramp"),
        ({"amplitudes": [0.1, -0.1]}, r"amplitudes\[2\]"),
        ({"friction_amplitudes": [0.0]}, r"friction_amplitudes\[1\]"),
        ({"torques": []}, "torques"),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(SettingsError, match=said):
        parse_settings(ContactSettings, tomllib.loads(SMALL) | changes, "test")


def test_a_set_without_networks_is_refused(tmp_path: Path) -> None:
    (tmp_path / "b.toml").write_text(SMALL.replace('["Blow"]', '["B"]'), encoding="utf-8")
    with pytest.raises(SettingsError, match="no network that ships was identified from it"):
        run_study("contact", tmp_path / "out", tmp_path / "b.toml")
    assert not (tmp_path / "out").exists()


def test_the_limits_that_come_with_the_study_name_what_it_measures(small: Small) -> None:
    shipped = load_settings(ContactSettings, STUDIES / "contact.toml")
    for limit in (one for one in shipped.limits if one.measure is not None):
        named = [item for item in small.findings if item["measure"] == limit.measure]
        assert named and set(limit.where) <= set(named[0]), limit.label
