"""The FMUs in the folders of `fmus/` are what the sources build from the parameters beside them."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

import fmus
from fmu_builder.errors import BuildError, ParameterSetError, SettingsError
from fmus import registry
from identification.scores import FIELDS

LARGEST = 1_000_000  # bytes of an FMU with all platforms and sources


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("name", fmus.NAMES)
def test_a_committed_fmu_is_what_the_sources_build(name: str, tmp_path: Path) -> None:
    built = fmus.build(name, tmp_path / "built.fmu")
    if fmus.path(name).read_bytes() == built.read_bytes():
        return
    committed, anew = contents(fmus.path(name)), contents(built)
    differing = sorted(entry for entry in {*committed, *anew} if committed.get(entry) != anew.get(entry)) or [
        "order or attributes of the entries"
    ]
    pytest.fail(f"{name} is not what the sources build: run make fmus and commit it ({', '.join(differing)})")


@pytest.mark.parametrize("name", fmus.NAMES)
def test_a_committed_fmu_is_small_stored_and_valid(name: str) -> None:
    path = fmus.path(name)
    assert path.stat().st_size < LARGEST
    with zipfile.ZipFile(path) as archive:
        assert {entry.compress_type for entry in archive.infolist()} == {zipfile.ZIP_STORED}
        card = archive.read("documentation/model_card.md")
    assert card == (fmus.folder(name) / "README.md").read_bytes()
    description = fmpy.read_model_description(str(path))
    assert description.coSimulation.modelIdentifier == description.modelExchange.modelIdentifier == path.stem
    assert path.stem == f"pantograph_{name}"
    assert validate_fmu(str(path)) == []


def test_every_folder_holds_the_same_files() -> None:
    for name in fmus.NAMES:
        own = {"README.md", "parameters.json", f"pantograph_{name}.fmu"}
        if name in fmus.NETWORKS:
            own |= {"identify.toml", "scores.json"}
        assert own <= {path.name for path in fmus.folder(name).iterdir()}
    folders = {path.name for path in Path(fmus.__file__).parent.iterdir() if (path / "README.md").is_file()}
    assert folders == set(fmus.NAMES)


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_parameters_are_canonical_and_the_recommended_network(name: str) -> None:
    network = fmus.network(name)
    text = (fmus.folder(name) / "parameters.json").read_text(encoding="utf-8")
    assert network.replaced(scores=()).canonical_json() == text
    assert network.name == f"pantograph_{name}"
    assert (network.kind, network.blending) == {
        "surrogate": ("surrogate", "theta"),
        "n4sid": ("n4sid", "parameter"),
    }[name.removesuffix("_blow")]
    assert len(network.local_models) == 4
    assert network.partition.deviation_gain == 0.0
    assert network.surrogate is None or network.surrogate.structure == "chain8"


@pytest.mark.parametrize("name", fmus.NETWORKS)
def test_the_fmu_tells_its_scores(name: str) -> None:
    network = fmus.network(name)
    assert [tuple(record) for record in network.scores] == [FIELDS] * len(network.output_names)
    assert {(record["split"], record["recommended"]) for record in network.scores} == {("test", True)}
    inside = contents(fmus.path(name))
    assert inside["resources/parameter_set.json"].decode() == network.compact_json()
    assert "<h2>Scores</h2>" in inside["documentation/index.html"].decode()


def test_names_that_do_not_come_with_the_project_are_refused() -> None:
    for function in (fmus.path, fmus.folder, fmus.network):
        with pytest.raises(SettingsError, match="surrogate_blow"):
            function("surogate")
    with pytest.raises(SettingsError, match="n4sid_blow"):
        fmus.network("wbm")


def test_a_missing_fmu_says_how_to_build_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(registry, "_FMUS", tmp_path)
    with pytest.raises(BuildError, match="make fmus"):
        fmus.path("n4sid")


def test_damaged_scores_are_placed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    shutil.copytree(fmus.folder("n4sid"), tmp_path / "n4sid")
    (tmp_path / "n4sid" / "scores.json").write_text("[", encoding="utf-8")
    monkeypatch.setattr(registry, "_FMUS", tmp_path)
    with pytest.raises(ParameterSetError, match=r"n4sid/scores\.json"):
        fmus.network("n4sid")
