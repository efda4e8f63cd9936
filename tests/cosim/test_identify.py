"""`llmn identify`: what it leaves to the data, tells, writes, and lets a user override."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.identify_data import settings, write_data
from cosim.whole_path import WholePath
from cosimulation.identify import Identified, _diagnostics, identify_from_folder
from fmu_builder.errors import (
    DataError,
    IdentificationError,
    LlmnError,
    OutputError,
    SettingsError,
)
from fmu_builder.llmn_fmu.card import model_card
from fmu_builder.llmn_fmu.variables import interface
from fmu_builder.parameter_set import load
from identification.data_set import DataSet
from identification.excitation import with_measurement_noise


@pytest.fixture
def folder(identify_folder: Path) -> Path:
    return identify_folder


@pytest.fixture
def found(identified: Identified) -> Identified:
    return identified


def names(result: Identified) -> list[str]:
    return list(dict.fromkeys(choice.name for choice in result.choices))


def test_everything_is_chosen_told_and_kept(found: Identified) -> None:
    expected = ["static_map", "n4sid.subspace.order", "n4sid.subspace.block_rows", "network.warp"]
    assert names(found) == [*expected, "network.coordinates", "network.blending"]
    assert [choice.place for choice in found.choices if choice.name == "n4sid.subspace.order"] == [
        "eta = 0.75", "eta = 1.25", "eta = 1.75", "eta = 2.25",
    ]  # fmt: skip
    text = found.text()
    assert all(choice.name in text and choice.reason in text for choice in found.choices)
    chosen = load(found.path)
    assert (chosen.partition.validity, chosen.blending) == ("cubic_warp", "parameter")
    records = [choice.record() for choice in found.choices]
    assert chosen.provenance["choices"] == records == found.summary()["choices"]
    (tuned_on,) = chosen.provenance["tuning"]  # type: ignore[misc]
    assert tuned_on["name"] == "wr_train"  # type: ignore[call-overload,index]
    assert chosen.provenance["identify"]["head"]["k_E"] == 1e5  # type: ignore[index,call-overload]
    json.dumps(found.summary())


def test_the_trained_range_is_that_of_all_training_data(found: Identified, blow: WholePath) -> None:
    (whole,) = blow.data.select("whole_range", "train")
    used = [item.data.rows(0, 8000) for item in blow.data.select("operating_point", "train")]
    used.append(whole.data.rows(0, 40000))
    for signal in (*found.parameter_set.inputs, *found.parameter_set.outputs):
        columns = [data.column(signal.name) for data in used]
        assert signal.minimum == min(float(one.min()) for one in columns)
        assert signal.maximum == max(float(one.max()) for one in columns)
    assert found.parameter_set.inputs[0].minimum < 0.61


def test_what_is_printed_is_what_overrides(found: Identified, folder: Path) -> None:
    """Every choice, pasted into the settings, is none any more; warp and orders come back as they were."""
    keys = re.findall(r"^  (\S+ = .*?)(?: \(eta = \S+\))?: ", found.text(), re.MULTILINE)
    rows = {k.split(" = ")[0] for k in keys}
    assert rows == set(names(found))
    block_rows = [model.diagnostics["block_rows"] for model in found.local.models]
    pasted: dict[str, Any] = {"static_map": "folder", "network": {}, "n4sid": {"subspace": {"order": 6}}}
    for key in keys:
        if key.startswith("network."):
            pasted["network"] |= tomllib.loads(key)["network"]
    again = identify_from_folder(settings(folder, **pasted, output=folder / "again.json"))
    # one number for all where the data chose four, and a motion of coordinates that is found anew
    assert set(names(again)) == {"n4sid.subspace.block_rows", "network.coordinates"}
    assert [model.diagnostics["block_rows"] for model in again.local.models] == block_rows
    assert again.parameter_set.partition.warp == pytest.approx(found.parameter_set.partition.warp, rel=1e-5)
    pasted["n4sid"]["subspace"]["block_rows"] = 50
    pasted["network"]["coordinates"] = "aligned"
    fixed = identify_from_folder(settings(folder, **pasted, output=folder / "again.json"))
    assert fixed.choices == () and "nothing was chosen automatically" in fixed.text()


def test_a_table_that_gives_one_key_leaves_the_others_to_the_data(folder: Path) -> None:
    def network(**given: Any) -> Any:
        return settings(folder, network=given).network

    assert network(blending="output").validity == "cubic_warp"
    assert network(validity="hat").open_choices == ("coordinates", "blending")
    assert network(validity="hat", blending="output").open_choices == ()
    with pytest.raises(SettingsError, match="'blending'"):
        network(blendin="output")


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"network": {"nodes": 10**8}}, "network.nodes"),
        ({"n4sid": {"local_models": 10**8}}, "n4sid.local_models"),
        ({"n4sid": {"centres": [k / 64 for k in range(32, 160)]}}, "n4sid.centres"),
        ({"n4sid": {"alignment_horizon": 10**8}}, "n4sid.alignment_horizon"),
    ],
)
def test_numbers_that_would_fill_the_memory_are_refused(
    tmp_path: Path, given: dict[str, Any], key: str
) -> None:
    with pytest.raises(SettingsError, match=rf"test, {key}: .*(at most|less than)") as refused:
        settings(tmp_path, **given)
    assert len(refused.value.problems) == 1


def test_without_whole_range_data_the_defaults_stand_in_and_say_so(blow: WholePath, tmp_path: Path) -> None:
    result = identify_from_folder(settings(write_data(blow, tmp_path, whole_range=False, static_map=False)))
    reasons = {choice.name: choice.reason for choice in result.choices}
    assert "no whole-range training data" in reasons["network.validity"]
    assert "the data folder holds none" in reasons["static_map"]
    assert result.parameter_set.partition.validity == "cubic"
    assert result.parameter_set.provenance["tuning"] == []
    with pytest.raises(DataError, match="none in the data folder"):
        identify_from_folder(settings(tmp_path, static_map="folder"))


def test_the_page_is_the_same_for_the_same_data_and_names_no_place(found: Identified, folder: Path) -> None:
    assert found.page == folder / "mine.html" and str(found.page) in found.text()
    page = found.page.read_text(encoding="utf-8")
    other = identify_from_folder(settings(folder, output=folder / "b.json", page=folder / "pages" / "b.html"))
    assert other.page is not None and other.page.read_bytes() == found.page.read_bytes()
    assert other.path.read_bytes() == found.path.read_bytes()
    assert str(folder) not in page and "http" not in page and "<script" not in page
    assert page.count("<svg") == 1 and "order 6 from 50 block rows" in page
    assert all(choice.reason.replace(">", "&gt;") in page for choice in found.choices)


def test_the_figure_shows_a_panel_per_model_and_the_reduction(found: Identified, folder: Path) -> None:
    reduced = settings(folder, n4sid={"subspace": {"high_order": 12}}, output=folder / "reduced.json")
    other = identify_from_folder(reduced)
    assert other.page is not None and found.page is not None
    panels = [
        len(set(re.findall(r'id="singular-values-local-(axes_\d+)"', page.read_text(encoding="utf-8"))))
        for page in (found.page, other.page)
    ]
    assert panels == [4, 8]
    assert "Hankel singular values" in other.page.read_text(encoding="utf-8")


def test_no_page_where_none_is_wanted_and_no_parameter_set_where_it_cannot_be(
    blow: WholePath, tmp_path: Path
) -> None:
    write_data(blow, tmp_path, whole_range=False)
    assert identify_from_folder(settings(tmp_path, page=False)).page is None
    assert not list(tmp_path.glob("*.html"))
    (tmp_path / "mine.json").unlink()
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(OutputError, match=r"file.page\.html: cannot be written"):
        identify_from_folder(settings(tmp_path, page=tmp_path / "file" / "page.html"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "file"]
    with pytest.raises(SettingsError, match="cannot both be"):
        settings(tmp_path, page=tmp_path / "mine.json")


def constant(data: DataSet) -> DataSet:
    values = data.values.copy()
    values[:, data.names.index("M_pa")] = 1310.9
    return replace(data, values=values)


def slow(data: DataSet) -> DataSet:
    """A sine instead of noise: it excites two samples in a row."""
    values = data.values.copy()
    values[:, data.names.index("M_pa")] = 1310.9 + 50.0 * np.sin(2.0 * np.pi * data.time)
    return replace(data, values=values)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda data: None, IdentificationError, "centre eta = 1.25: has no experiment"),
        (lambda data: data.rows(0, 12), IdentificationError, "has 12 rows"),
        (constant, IdentificationError, "eta = 1.25, signal 'M_pa': is constant"),
        (slow, IdentificationError, r"eta = 1.25, inputs: do not excite .* eq\. 3\.71"),
        (lambda data: data.select(("eta", "M_pa", "xi", "zeta", "zeta_dot")), DataError, "xi_dot"),
    ],
)
def test_data_that_do_not_do_are_refused_with_the_reason(
    blow: WholePath, tmp_path: Path, change: Any, error: type[LlmnError], message: str
) -> None:
    write_data(blow, tmp_path, op45_train=change)
    with pytest.raises(error, match=message):
        identify_from_folder(settings(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def astray(data: DataSet) -> DataSet:
    """A tenth of the rows recorded with the height off by 2 m."""
    values = data.values.copy()
    values[:4000, data.names.index("eta")] += 2.0
    return replace(data, values=values)


def test_what_makes_a_model_doubtful_is_told_everywhere(
    blow: WholePath, found: Identified, tmp_path: Path
) -> None:
    assert found.warnings == () and "warning" not in found.text()
    assert found.page is not None and "Warnings" not in found.page.read_text(encoding="utf-8")
    assert found.parameter_set.provenance["warnings"] == [] == found.summary()["warnings"]
    loud = {"xi": 0.01, "zeta": 0.01, "xi_dot": 1.0, "zeta_dot": 1.0}
    write_data(blow, tmp_path, op45_train=lambda data: with_measurement_noise(data, loud, 3), wr_train=astray)
    bad = identify_from_folder(settings(tmp_path, n4sid={"subspace": {"order": 6, "block_rows": 30}}))
    places = [one.place for one in bad.warnings]
    assert "local model at eta = 1.25, output 'xi_dot'" in places
    assert "data set 'wr_train'" in places
    assert any(place.startswith("network on whole-range data, output") for place in places)
    records = [one.record() for one in bad.warnings]
    assert load(bad.path).provenance["warnings"] == records == bad.summary()["warnings"]
    page = bad.page.read_text(encoding="utf-8") if bad.page else ""
    card = model_card(bad.parameter_set, interface(bad.parameter_set))
    for one in bad.warnings:
        assert f"warning: {one}" in bad.text()
        assert one.mend in page and one.mend in card
    assert card.count("<h2>Warnings</h2>") == page.count("<h2>Warnings</h2>") == 1


def test_noise_and_one_local_model_go_the_same_way(blow: WholePath, tmp_path: Path) -> None:
    noise = {"xi": 1e-5, "zeta": 1e-5, "xi_dot": 1e-3, "zeta_dot": 1e-3}
    write_data(blow, tmp_path, op65_train=lambda data: with_measurement_noise(data, noise, 3))
    only = {"centres": [1.75], "low": 1.6, "high": 2.0}
    with pytest.raises(IdentificationError, match="nearest centre"):
        identify_from_folder(settings(tmp_path, n4sid=only))
    index = json.loads((tmp_path / "data" / "data.json").read_text(encoding="utf-8"))
    index["experiments"] = [one for one in index["experiments"] if one["name"] in ("op65_train", "wr_train")]
    (tmp_path / "data" / "data.json").write_text(json.dumps(index), encoding="utf-8")
    result = identify_from_folder(settings(tmp_path, n4sid=only))
    assert result.parameter_set.state_count == 6
    reasons = {choice.name: choice.reason for choice in result.choices}
    assert "nothing to blend" in reasons["network.warp"]
    assert "1 local model of order 6" in result.text()
    # the pantograph's 1.5 m is not among the data, so their middle is the operating point
    eta, torque = result.parameter_set.inputs
    heights = blow.data.select("operating_point", "train")[2].data.rows(0, 8000).column("eta")
    assert eta.operating_point == pytest.approx(float(heights.mean())) and torque.operating_point == 1310.9
    assert "n4sid.operating_point = { eta = 1.7" in result.text()
    # the whole-range data begin at 0.6 m, and below 1.6 m weights are held
    (whole,) = blow.data.select("whole_range", "train")
    assert (eta.minimum, eta.maximum) == (1.6, whole.data.rows(0, 40000).column("eta").max())
    assert "data set 'wr_train'" in {warning.place for warning in result.warnings}
    for method in ("n4sid", "surrogate"):
        given = settings(tmp_path, method=method, n4sid={**only, "operating_point": {"eta": 1.5}})
        with pytest.raises(
            IdentificationError, match=r"n4sid\.operating_point\.eta: 1.5 lies outside .* 1\.6"
        ):
            identify_from_folder(given)


def opposite(which: str) -> str:
    """The other theta."""
    return "physical" if which == "tuned" else "tuned"


def test_a_surrogate_tells_how_sure_it_is(folder: Path, tmp_path: Path) -> None:
    files = {"output": tmp_path / "s.json", "page": tmp_path / "page.html"}
    result = identify_from_folder(settings(folder, method="surrogate", **files))
    found = result.surrogate
    assert found is not None and found.certainty is not None
    text = result.text()
    assert "theta at eta = 0.75: m_H = " in text and f"\ntheta: {found.recommended} (" in text
    error = float(found.standard_errors(found.recommended)[1, 2])
    assert f"k_L = {found.theta(found.recommended)[1, 2]:.6g} +- {error:.2g} N/m" in text
    for line in (*found.correlated(), *found.remarks(found.recommended)):
        assert line in text
    other = replace(found, recommendation=replace(found.recommendation, which=opposite(found.recommended)))
    assert other.fit != found.fit  # what is told is told of the theta that is in the network
    told = replace(result, diagnostics=_diagnostics(other)).text()
    assert all(line in told for line in other.remarks(other.recommended))
    assert f"F_p {other.fit['F_p']:.6g}" in told and f"F_p {found.fit['F_p']:.6g}" in text
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Physical parameters" in page and 'id="theta-surrogate-' in page
