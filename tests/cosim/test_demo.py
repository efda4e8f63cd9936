"""The demo as a user runs it, in full."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

from cosimulation.pantograph import SIGNALS
from fmu_builder.compiler import host_platform
from identification.scores import FIELDS, recommendation_problems

ROOT = Path(__file__).resolve().parents[2]
COMPARED = {
    ("linear", None): "subtracted after the simulation",
    ("surrogate", "theta"): "scheduled_equilibrium",
    ("n4sid", "output"): "low_pass",
    ("n4sid", "parameter"): "scheduled_equilibrium",
}


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("an empty folder")
    command = [sys.executable, "-m", "cosimulation", "demo", "--platform", host_platform()]
    result = subprocess.run(
        command, cwd=folder, env={"PYTHONPATH": str(ROOT), "PATH": "", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "reference data" in result.stderr  # progress is visible without a terminal, too
    return folder / "runs" / "demo"


@pytest.fixture(scope="module")
def scores(demo: Path) -> list[dict[str, object]]:
    found: list[dict[str, object]] = json.loads((demo / "scores.json").read_text(encoding="utf-8"))
    return found


def fit(scores: list[dict[str, object]], **wanted: object) -> float:
    (found,) = [
        item
        for item in scores
        if item["split"] == "test" and all(item[key] == value for key, value in wanted.items())
    ]
    value = found["fit"]
    assert isinstance(value, float)
    return value


def test_everything_a_user_is_promised_is_there(demo: Path) -> None:
    names = {path.name for path in demo.iterdir()}
    assert {"report.html", "scores.json", "timings.json", "settings.json", "fmus", "models", "data"} <= names
    assert not [name for name in names if name.startswith(".")]


def test_every_model_is_scored_on_every_output_of_both_sets(scores: list[dict[str, object]]) -> None:
    for wbm in ("A", "Blow"):
        for (model, blending), offsets in COMPARED.items():
            for signal in SIGNALS:
                label = {"wbm": wbm, "model": model, "blending": blending, "offsets": offsets}
                assert fit(scores, signal=signal, **label) <= 100.0


def test_records_have_the_fields_and_one_recommendation_per_group(scores: list[dict[str, object]]) -> None:
    assert all(tuple(item) == FIELDS for item in scores)
    assert recommendation_problems(scores) == []


def test_n4sid_holds_its_bound_on_the_plausible_set(scores: list[dict[str, object]]) -> None:
    label = {"wbm": "Blow", "model": "n4sid", "offsets": "scheduled_equilibrium", "signal": "F_p"}
    best = max(fit(scores, blending=blending, **label) for blending in ("output", "parameter"))
    assert best >= 95.0


def test_no_model_was_scored_on_data_it_was_trained_on(demo: Path, scores: list[dict[str, object]]) -> None:
    index = json.loads((demo / "data" / "Blow" / "data.json").read_text(encoding="utf-8"))
    trained = {item["name"] for item in index["experiments"] if item["split"] == "train"}
    assert not trained & {item["data_set"] for item in scores}
    for path in (demo / "models").glob("*_blow.json"):
        training = json.loads(path.read_text(encoding="utf-8"))["provenance"].get("training", [])
        assert {item["name"] for item in training} <= trained


@pytest.mark.parametrize("name", ["pantograph_wbm", "pantograph_surrogate", "pantograph_n4sid_blow"])
def test_the_fmus_pass_fmpy(demo: Path, name: str) -> None:
    assert validate_fmu(str(demo / "fmus" / f"{name}.fmu")) == []


def test_timings_stay_out_of_what_must_be_reproducible(demo: Path) -> None:
    timings = json.loads((demo / "timings.json").read_text(encoding="utf-8"))
    assert {item["fmu"] for item in timings["steps"]} == {path.stem for path in (demo / "fmus").glob("*.fmu")}
    assert all(item["own_ns"] > 0.0 for item in timings["steps"])


def test_no_result_names_the_machine(demo: Path) -> None:
    for path in [
        *demo.glob("*.json"),
        *demo.glob("*/*/data.json"),
        *demo.glob("models/*.json"),
        demo / "report.html",
    ]:
        assert str(demo.parents[1]) not in path.read_text(encoding="utf-8")
