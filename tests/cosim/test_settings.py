"""Settings are checked as a whole, and every message says how to mend it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from cosimulation.settings import (
    ExperimentSettings,
    GenerateSettings,
    Noise,
    Signals,
    deviations,
    load_settings,
    parse_settings,
    settings_line,
    toml_value,
    with_flags,
)
from fmu_builder.errors import SettingsError


def problems(values: dict[str, object]) -> list[str]:
    with pytest.raises(SettingsError) as caught:
        parse_settings(GenerateSettings, values, "run.toml")
    return [str(problem) for problem in caught.value.problems]


def test_a_misspelt_key_is_answered_with_the_right_one() -> None:
    (text,) = problems({"expermients": []})
    assert "run.toml, expermients" in text
    assert "'experiments'" in text


def test_a_misspelt_key_in_a_table_is_placed() -> None:
    (text,) = problems({"excitation": {"noise_rsm": 0.001}})
    assert "excitation.noise_rsm" in text
    assert "'noise_rms'" in text


def test_a_misspelt_key_in_a_list_is_placed() -> None:
    experiment = {"name": "a", "kind": "whole_range", "split": "test", "duration": 1.0, "hieght": 2.0}
    (text,) = problems({"experiments": [experiment]})
    assert "experiments[1].hieght" in text
    assert "'height'" in text


def test_everything_wrong_is_told_at_once() -> None:
    texts = problems({"seed": -1, "nonsense": 1, "experiments": [{"name": "a b"}]})
    assert len(texts) == 5  # seed, nonsense, and in the experiment: name, kind, split
    assert all(text.startswith("run.toml") for text in texts)


@pytest.mark.parametrize(
    ("content", "expected"), [("a = ", "not valid TOML"), ("\x00", "not valid TOML"), ("seed = 'x'", "seed")]
)
def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, content: str, expected: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(SettingsError) as caught:
        load_settings(GenerateSettings, path)
    assert str(path) in str(caught.value)
    assert expected in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no such settings file"):
        load_settings(GenerateSettings, tmp_path / "run.toml")


@pytest.mark.parametrize(
    ("values", "place"),
    [
        ({"static_map": {"low": float("nan")}}, "static_map.low"),
        ({"excitation": {"torque_amplitude": float("inf")}}, "excitation"),
        ({"static_map": {"heights": 10**9}}, "static_map.heights"),
        ({"static_map": {"low": 2.5, "high": 0.5}}, "low 2.5 is not below high 0.5"),
        (
            {"experiments": [{"name": "a", "kind": "operating_point", "split": "test", "low": 3.0}]},
            "needs its height; an experiment needs either a file or a duration; low 3 is not below high 2.4",
        ),
        ({"signals": {"inputs": {}}}, "at least one input"),
        ({"signals": {"outputs": {"eta": "xi"}}}, "both an input and an output: eta"),
        ({"signals": {"units": {"etta": "mm"}}}, "not mapped: etta"),
    ],
)
def test_values_that_cannot_be_worked_with_are_refused_at_once(values: dict[str, object], place: str) -> None:
    (text,) = problems(values)
    assert place in text


def test_what_contradicts_itself_is_told_without_the_whole_table() -> None:
    (text,) = problems({"static_map": {"low": 2.5, "high": 0.5, "heights": 9}})
    assert text == "run.toml, static_map: low 2.5 is not below high 0.5. Change the values."


def test_a_flag_is_checked_like_the_key_it_stands_in_for() -> None:
    settings = GenerateSettings(seed=3)
    assert with_flags(settings, seed=None) == settings
    assert with_flags(settings, seed=5).seed == 5
    with pytest.raises(SettingsError, match="command line, seed"):
        with_flags(settings, seed=-1)


def test_a_unit_of_one_signal_leaves_the_others_theirs() -> None:
    signals = Signals(units={"xi": "mm"})
    assert (signals.unit("xi"), signals.unit("eta"), signals.unit("unheard_of")) == ("mm", "m", "")


def test_the_settings_are_told_in_one_line_by_what_is_unusual() -> None:
    source = Path("run.toml")
    assert settings_line(GenerateSettings(), source) == "settings: run.toml; all defaults"
    experiments = tuple(
        ExperimentSettings(name=f"e{k}", kind="whole_range", split="test", duration=1.0) for k in range(3)
    )
    unusual = GenerateSettings(seed=3, experiments=experiments, noise=Noise(velocity=0.5))
    line = settings_line(unusual, source)
    assert line == (
        "settings: run.toml; not the default: seed = 3, experiments (3 entries), noise.velocity = 0.5"
    )
    assert settings_line(unusual, source, unusual) == "settings: run.toml; all defaults"
    assert deviations(unusual, GenerateSettings(seed=3)) == {
        "experiments": experiments, "noise.velocity": 0.5,
    }  # fmt: skip


@pytest.mark.parametrize("value", [1, -2.5e-7, True, 'a "b"', (1.0, 2.0), {"a": 1.5, "b": [True, "x"]}])
def test_values_are_told_as_toml(value: object) -> None:
    expected = list(value) if isinstance(value, tuple) else value
    assert tomllib.loads(f"key = {toml_value(value)}") == {"key": expected}
