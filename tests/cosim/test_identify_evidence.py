"""What `llmn identify` finds out about the trust a network deserves: error bands and trained region."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu_runner import opened

from cosim.identify_data import settings, write_data
from cosim.whole_path import PLATFORMS, WholePath
from cosimulation.bands import band_lines, banded
from cosimulation.data_folder import load_data_folder
from cosimulation.identify import Identified, identify_from_folder
from cosimulation.region import region_of_file
from fmu_builder.errors import (
    DataError,
    ParameterSetError,
    SettingsError,
)
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.llmn_fmu.card import model_card
from fmu_builder.llmn_fmu.variables import interface
from fmu_builder.parameter_set import ResidualBands, load
from identification.data_set import DataSet
from identification.residuals import ResidualSettings


@pytest.fixture
def folder(identify_folder: Path) -> Path:
    return identify_folder


@pytest.fixture
def found(identified: Identified) -> Identified:
    return identified


def with_held_out(blow: WholePath, folder: Path) -> Path:
    """A data folder of operating points and one whole-range record of the split validation."""
    write_data(blow, folder, whole_range=False)
    (test,) = blow.data.select("whole_range", "test")
    data = DataSet("held_out", test.data.sample_time, test.data.names, test.data.units, test.data.values)
    known = load_data_folder(folder / "data")
    extra = replace(test, name="held_out", split="validation", data=data)
    replace(known, experiments=(*known.experiments, extra)).save(folder / "data")
    return folder


def test_error_bands_come_from_held_out_data(blow: WholePath, tmp_path: Path) -> None:
    quick = {"subspace": {"order": 6, "block_rows": 30}}
    result = identify_from_folder(
        settings(with_held_out(blow, tmp_path), n4sid=quick, residuals={"heights": 1, "frequencies": [15.0]})
    )
    (bands,) = load(result.path).residual_bands
    assert (bands.output, bands.held_out, bands.positions) == ("F_p", ("held_out",), (0.5, 2.5))
    (test,) = blow.data.select("whole_range", "test")
    model = simulate(result.parameter_set, test.data.matrix(("eta", "M_pa")))
    column = result.parameter_set.output_names.index("F_p")
    error = np.abs(model[:, column] - test.data.column("F_p"))[5000:]
    exact = float(np.quantile(error, 0.95, method="higher"))
    assert bands.total[0] is not None and 0.0 <= bands.total[0] / exact - 1.0 < 1e-3
    assert result.bands_remark == "" and result.summary()["residual_bands"] == [bands.model_dump(mode="json")]
    card = model_card(result.parameter_set, interface(result.parameter_set))
    page = result.page.read_text(encoding="utf-8") if result.page else ""
    for text in (result.text(), page, card):
        assert "held_out" in text and f"{bands.total[0]:.3g}" in text
    assert "<h2>How far off F_p is</h2>" in card and "15 to 500 Hz" in card


def test_without_held_out_data_there_are_no_bands_and_it_is_said(found: Identified) -> None:
    assert found.parameter_set.residual_bands == ()
    said = "there are no whole-range data of the split validation"
    assert f"error bands of predictions: none, {said}" in found.text()
    assert found.page is not None and f"Not known: {said}." in found.page.read_text(encoding="utf-8")
    assert found.summary()["residual_bands_remark"] == said
    assert "How far off" not in model_card(found.parameter_set, interface(found.parameter_set))


def test_bands_that_would_be_empty_are_left_out_with_the_reason(blow: WholePath, found: Identified) -> None:
    (test,) = blow.data.select("whole_range", "test")
    values = test.data.values.copy()
    values[:, test.data.names.index("eta")] += 5.0
    far = DataSet("far", test.data.sample_time, test.data.names, test.data.units, values)
    folder = replace(blow.data, experiments=(replace(test, name="far", split="validation", data=far),))
    result = banded(found.parameter_set, folder)
    assert result.parameter_set.residual_bands == ()
    assert result.remark == "far of the split validation: too short at every range of eta from 0.5 to 2.5"
    asked = ResidualSettings(outputs=())
    assert banded(found.parameter_set, folder, asked).remark == "residuals.outputs names no output"


def test_the_table_of_bands_keeps_its_columns_apart() -> None:
    row = ((-1.324e-05, 1.324e-05),)
    sizes = ((1.324e-05, 1.324e-05),)
    bands = ResidualBands(
        model_hash="", output="x", positions=(0.5, 1.0), frequencies=(0.0, 15.0, 500.0), coverage=0.95,
        rms=sizes, bound=sizes, total=(1.324e-05,), amplitude=((1.0, 1.0),), phase=row, seconds=(12345.6,),
        held_out=("one",),
    )  # fmt: skip
    cell = ["1.324e-05", "(1.0000,"]
    assert band_lines(bands, "m", "eta")[2].split() == [
        *("0.5", "-", "1", "12345.6", "1.324e-05"), *cell, "-0.0000)", *cell, "+0.0000)"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"outputs": ["nobody", "F_p"]}, r"there is no nobody; name some of xi.*F_p"),
        ({"frequencies": [15.0, 5.0]}, "ascend"),
        ({"heigths": 3}, "'heights'"),
    ],
)
def test_residuals_that_make_no_sense_are_refused_before_the_start(
    tmp_path: Path, given: dict[str, Any], said: str
) -> None:
    with pytest.raises(SettingsError, match=said):
        settings(tmp_path, residuals=given)


def test_the_region_is_found_again_from_the_data_and_nothing_else_changes(
    found: Identified, folder: Path, tmp_path: Path
) -> None:
    region = found.parameter_set.trained_region
    assert region is not None and set(region.derived_outputs) == {"F_H", "F_p"}
    assert set(region.frequency_bands) == {"eta", "M_pa"}
    path = tmp_path / "mine.json"
    found.parameter_set.replaced(trained_region=None).save(path)
    shown = region_of_file(path, folder / "data")
    assert not shown.stored and load(path).trained_region is None
    assert "eta moves by at most" in shown.text() and "--store" in shown.text()
    stored = region_of_file(path, folder / "data", store=True)
    assert path.read_bytes() == found.path.read_bytes()
    assert stored.summary()["trained_region"] == region.model_dump(mode="json")


def test_a_region_is_not_worked_out_of_other_data(found: Identified, blow: WholePath, tmp_path: Path) -> None:
    other = write_data(
        blow, tmp_path, op25_train=lambda data: data.rows(0, 7000), wr_train=lambda data: data.rows(1, 40000)
    )
    with pytest.raises(DataError) as caught:
        region_of_file(found.path, other / "data")
    named = [problem.place.rsplit(", ", 1)[1] for problem in caught.value.problems]
    assert named == ["op25_train", "wr_train"]
    nameless = tmp_path / "nameless.json"
    found.parameter_set.replaced(provenance={"training": "of old"}).save(nameless)
    with pytest.raises(ParameterSetError, match="names no training data"):
        region_of_file(nameless, other / "data")


def test_an_fmu_that_refuses_what_it_was_not_trained_on_takes_its_training_data(
    found: Identified, blow: WholePath, tmp_path: Path
) -> None:
    path = build_llmn(found.parameter_set, tmp_path / "mine.fmu", PLATFORMS)
    (whole,) = blow.data.select("whole_range", "train")
    heights = [item.data.rows(0, 8000) for item in blow.data.select("operating_point", "train")]
    for data in (whole.data.rows(0, 40000), *heights):
        rows = data.matrix(("eta", "M_pa"))
        with opened(path, rows[0], ready=False) as (slave, references):
            slave.setInteger([references["out_of_range"]], [3])
            slave.exitInitializationMode()
            for k, row in enumerate(rows.tolist()):
                slave.setReal([0, 1], row)
                slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
            slave.setReal([0], [row[0] + 1.001e-3 * region_rate(found)])
            with pytest.raises(FMICallException):
                slave.doStep(currentCommunicationPoint=len(rows) * 1e-3, communicationStepSize=1e-3)


def region_rate(found: Identified) -> float:
    region = found.parameter_set.trained_region
    assert region is not None
    return region.rate
