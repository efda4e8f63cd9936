"""The committed networks: their scores are reached again by their FMUs, and hold on data nobody has seen."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np
import pytest

import fmus
from cosimulation.candidates import head_forces, identifier
from cosimulation.demo import generate_settings
from cosimulation.fmu_driver import running_fmu
from cosimulation.fmu_file import open_fmu
from cosimulation.identify import IdentifySettings, derived_outputs
from cosimulation.pantograph import INPUTS, SIGNALS
from cosimulation.report import thesis
from cosimulation.settings import STUDIES, GenerateSettings, load_settings
from cosimulation.study import run_study
from cosimulation.study.shipped import ShippedSettings, compared
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import load
from fmus.wbm import native, parameter_sets
from identification.data_set import DataSet
from identification.excitation import whole_range_inputs
from identification.scores import fit_percent, max_error
from tolerances import OTHER_RECORD, SHIPPED_SCORE

UNSEEN_SEED = 2
DECIMALS = 3  # of the FIT in the README


def recipe(wbm: str) -> GenerateSettings:
    """The data that the networks of a white-box set were identified from."""
    return generate_settings(fmus.path("wbm"), wbm, quick=False)


@functools.cache
def reference(wbm: str, seed: int) -> DataSet:
    """The test record of the acceptance recipe, drawn with a seed and generated here."""
    experiments = recipe(wbm).experiments
    ((stream, test),) = [(k, item) for k, item in enumerate(experiments) if item.split == "test"]
    inputs = whole_range_inputs(seed, (stream,), test.duration)
    outputs = native.simulate(parameter_sets()[wbm], inputs.values, inputs.sample_time)
    columns = [native.OUTPUTS.index(name) for name in SIGNALS]
    return inputs.with_columns(SIGNALS, ("",) * len(SIGNALS), outputs[:, columns])


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_committed_fmu_reaches_its_committed_scores(name: str) -> None:
    data = reference(fmus.NETWORKS[name], recipe("A").seed)
    with open_fmu(fmus.path(name)) as fmu, running_fmu(fmu) as instance:
        outputs = instance.run(data.matrix(INPUTS), INPUTS, SIGNALS, data.sample_time)
    scores = json.loads((fmus.folder(name) / "scores.json").read_text(encoding="utf-8"))
    assert [record["signal"] for record in scores] == list(SIGNALS)
    for column, record in enumerate(scores):
        truth, got = data.matrix(SIGNALS)[:, column], outputs[:, column]
        assert abs(fit_percent(truth, got) - record["fit"]) <= SHIPPED_SCORE
        assert abs(max_error(truth, got) - record["max_error"]) <= SHIPPED_SCORE * record["max_error"]


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_scores_hold_on_a_record_that_nobody_has_seen(name: str) -> None:
    data, network = reference(fmus.NETWORKS[name], UNSEEN_SEED), fmus.network(name)
    outputs = simulate(network, data.matrix(INPUTS))
    for record in network.scores:
        signal, fit = str(record["signal"]), record["fit"]
        assert isinstance(fit, float)
        found = fit_percent(data.column(signal), outputs[:, network.output_names.index(signal)])
        assert 100.0 - found <= OTHER_RECORD * (100.0 - fit), signal


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_settings_beside_a_network_are_those_it_was_identified_with(name: str) -> None:
    wbm, provenance = fmus.NETWORKS[name], fmus.network(name).provenance
    settings = load_settings(IdentifySettings, fmus.folder(name) / "identify.toml")
    assert settings.model_fields_set <= {"name", "method", "data", "head"}  # nothing is tuned by hand
    assert settings.name == identifier(settings.method, wbm)
    assert settings.data == Path("data") / wbm
    assert settings.head is not None and settings.head.m_C == parameter_sets()[wbm]["mC"]
    assert derived_outputs(settings) == head_forces(wbm)
    used, asked = provenance["identify"], settings.model_dump(mode="json")
    assert isinstance(used, dict) and {key: asked[key] for key in used} == used
    origin = provenance["origin"]
    assert isinstance(origin, dict)
    drawn = recipe(wbm).model_dump(mode="json", exclude={"output": True, "reference": {"fmu"}})
    assert origin["settings"] == drawn


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_model_card_shows_the_scores_and_the_thesis(name: str) -> None:
    card = (fmus.folder(name) / "README.md").read_text(encoding="utf-8")
    for record in fmus.network(name).scores:
        published = thesis.counterpart(record)
        assert published is not None
        signal, fit = str(record["signal"]), record["fit"]
        row = (
            f"| `{signal}` | {fit:.{DECIMALS}f} | {record['max_error']:.2g} | {published.fits[signal]:.2f} |"
        )
        assert row in card, f"{name}/README.md lacks the row {row}"


def test_identifying_anew_is_compared_signal_by_signal() -> None:
    scores = json.loads((fmus.folder("n4sid") / "scores.json").read_text(encoding="utf-8"))
    worse = [{**record, "fit": record["fit"] - 0.1 * k} for k, record in enumerate(scores)]
    found = list(compared("n4sid", scores, worse))
    assert [item["signal"] for item in found] == list(SIGNALS)
    assert np.allclose([item["value"] for item in found], 0.1 * np.arange(len(scores)))
    lost = [{**record, "fit": None} for record in scores]
    assert {item["value"] for item in compared("n4sid", scores, lost)} == {None}


def test_the_study_asks_for_every_network_and_signal() -> None:
    settings = load_settings(ShippedSettings, STUDIES / "shipped.toml")
    assert [limit.where["network"] for limit in settings.limits] == list(fmus.NETWORKS)
    assert {limit.worst for limit in settings.limits} == {0.05}
    assert set(settings.sets) == set(fmus.NETWORKS.values())
    assert settings.longest is None and settings.seeds == (recipe("A").seed,)


def test_the_study_writes_what_may_replace_the_committed_files(tmp_path: Path) -> None:
    text = (STUDIES / "shipped.toml").read_text(encoding="utf-8")
    short = tmp_path / "short.toml"
    one_set = text.replace('"A", "Blow"', '"Blow"')
    short.write_text(f"longest = 8.0\nprocesses = 1\n{one_set}", encoding="utf-8")
    result = run_study("shipped", tmp_path / "out", short)
    assert not result.passed  # eight seconds are not the acceptance recipe, and the other set is missing
    printed = result.text()
    for word in ("committed", "anew", "n4sid_blow", "FAIL", "surrogate_blow: FIT as committed"):
        assert word in printed
    for name in ("surrogate_blow", "n4sid_blow"):
        made = {path.name for path in (tmp_path / "out" / "models" / name).iterdir()}
        assert made == {"parameters.json", "scores.json"} <= {p.name for p in fmus.folder(name).iterdir()}
        (bands,) = load(tmp_path / "out" / "models" / name / "parameters.json").residual_bands
        assert bands.output == "F_p" and bands.held_out[0] == "wr_validation"
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "n4sid_blow, identified anew" in page and "surrogate_blow, committed" in page
