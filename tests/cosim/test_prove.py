"""`llmn prove` on parameter sets and FMUs: what it says, stores and refuses."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import certified_networks as networks
import numpy as np
import pytest
from typer.testing import CliRunner

from cosimulation.build import build_model
from cosimulation.cli import app
from cosimulation.prove import prove_file
from fmu_builder.compiler import host_platform
from fmu_builder.errors import CertificateError, DataError, FmuError, LlmnError, SettingsError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import load
from identification.data_set import DataSet


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    return networks.oscillators().save(tmp_path / "model.json")


@pytest.fixture
def stored(plain: Path) -> Path:
    assert prove_file(plain, 4.0, store=True).stored
    return plain


def test_a_certificate_is_looked_for_and_stored_where_it_is_asked_for(plain: Path) -> None:
    before = plain.read_bytes()
    found = prove_file(plain, 4.0)
    assert not found.stored and plain.read_bytes() == before
    assert "--store writes it" in found.text()
    again = prove_file(plain, 4.0, store=True)
    assert again.stored and again.proof == found.proof
    assert load(plain).model_hash() == networks.oscillators().model_hash()


def test_a_stored_certificate_is_proved_anew(stored: Path) -> None:
    found = prove_file(stored)
    assert (found.method, found.proof.rate, found.stored) == ("nodes", 4.0, True)
    first = found.text().splitlines()[0]
    assert "at most 4 m/s" in first and "y 97.25 %" in first
    content = json.loads(stored.read_text(encoding="utf-8"))
    content["certificate"]["rate"] = 40.0
    stored.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(CertificateError, match="not positive definite"):
        prove_file(stored)


def test_a_changed_number_is_refused_and_a_new_certificate_can_be_had(stored: Path) -> None:
    content = json.loads(stored.read_text(encoding="utf-8"))
    content["node_table"]["models"][1]["A"][0][0] += 1e-9
    stored.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(CertificateError, match="certificate is of the model"):
        prove_file(stored)
    assert prove_file(stored, 2.0, anew=True, store=True).stored
    assert prove_file(stored).proof.rate == 2.0


def test_a_stored_certificate_for_less_is_not_enough(stored: Path) -> None:
    assert prove_file(stored, 3.0).proof.rate == 4.0
    assert prove_file(stored, 5.0).proof.rate == 5.0


def test_without_a_rate_six_or_the_largest_below_is_found(tmp_path: Path) -> None:
    assert prove_file(networks.oscillators().save(tmp_path / "calm.json")).proof.rate == 6.0
    lively = networks.oscillators(damping=0.005).save(tmp_path / "lively.json")
    rate = prove_file(lively).proof.rate
    assert rate is not None and 0.0 < rate < 6.0


def test_the_fit_on_data_stands_beside_the_proof(stored: Path, tmp_path: Path) -> None:
    network = load(stored)
    rows = np.random.default_rng(2).uniform([0.6, -1.0], [2.4, 1.0], (400, 2))
    outputs = simulate(network, rows) + 0.01 * np.random.default_rng(3).standard_normal((400, 1))
    data = DataSet("trial", 0.01, ("s", "load", "y"), ("m", "N", "m"), np.hstack([rows, outputs]))
    data.save(tmp_path / "trial.npz")
    line = prove_file(stored, data_files=[tmp_path / "trial.npz"]).text().splitlines()[0]
    assert "y 9" in line and "y 97.25 %" not in line and "at most 4 m/s" in line
    other = DataSet("other", 0.02, ("load", "z"), ("N", "m"), rows)
    other.save(tmp_path / "other.npz")
    with pytest.raises(DataError) as caught:
        prove_file(stored, data_files=[tmp_path / "other.npz"])
    assert len(caught.value.problems) == 2


def test_an_fmu_is_proved_by_what_it_carries(stored: Path, tmp_path: Path) -> None:
    fmu = build_model(str(stored), tmp_path / "model.fmu", (host_platform(),))
    found = prove_file(fmu)
    assert (found.proof.rate, found.stored) == (4.0, True)
    with pytest.raises(SettingsError, match="does not write into FMUs"):
        prove_file(fmu, store=True)
    bare = build_model(
        str(networks.oscillators().save(tmp_path / "bare.json")), tmp_path / "bare.fmu", (host_platform(),)
    )
    assert not prove_file(bare, 2.0).stored


def exchanged(fmu: Path, name: str, content: bytes, target: Path) -> Path:
    """A copy of an FMU with another file in it."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for entry in source.namelist():
            copy.writestr(entry, content if entry == name else source.read(entry))
    return target


def test_an_fmu_that_carries_another_parameter_set_is_refused(stored: Path, tmp_path: Path) -> None:
    fmu = build_model(str(stored), tmp_path / "model.fmu", (host_platform(),))
    other = networks.oscillators(4)
    text = other.canonical_json().encode("utf-8")
    mixed = exchanged(fmu, "resources/parameter_set.json", text, tmp_path / "mixed.fmu")
    with pytest.raises(FmuError, match="its GUID is not that of"):
        prove_file(mixed, 1.0)


def test_a_false_certificate_is_not_built_in(stored: Path, tmp_path: Path) -> None:
    content = json.loads(stored.read_text(encoding="utf-8"))
    content["certificate"]["decay"] = 1.9
    stored.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(CertificateError):
        build_model(str(stored), tmp_path / "false.fmu", (host_platform(),))
    assert not (tmp_path / "false.fmu").exists()


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_that_is_none_is_refused(plain: Path, rate: float) -> None:
    with pytest.raises(SettingsError, match="is no rate"):
        prove_file(plain, rate)


def test_files_that_are_neither_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.json").write_text("no json", encoding="utf-8")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<x/>")
    for name in ("text.json", "empty.fmu", "missing.json"):
        with pytest.raises(LlmnError) as caught:
            prove_file(tmp_path / name)
        assert len(caught.value.problems) == 1 and str(caught.value).startswith(str(tmp_path / name))
    with pytest.raises(FmuError, match=r"empty\.fmu: holds no resources/parameter_set\.json\. Give"):
        prove_file(tmp_path / "empty.fmu")


def test_the_command_prints_one_line_and_json(stored: Path) -> None:
    shown = CliRunner().invoke(app, ["prove", str(stored)])
    assert shown.exit_code == 0
    assert "certified: Proved:" in shown.stdout and "Not proved: accuracy" in shown.stdout
    told = json.loads(CliRunner().invoke(app, ["prove", str(stored), "--json"]).stdout)
    assert told["rate"] == 4.0 and told["stored"] is True and told["method"] == "nodes"
    assert told["model_hash"] == networks.oscillators().model_hash()


def test_without_a_proof_the_command_fails(stored: Path) -> None:
    result = CliRunner().invoke(app, ["prove", str(stored), "--rate", "1000"])
    assert isinstance(result.exception, CertificateError)
