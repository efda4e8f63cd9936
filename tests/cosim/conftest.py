"""The whole path once on the white-box set Blow, shared by the tests of this room."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import identify_data, sweeps
from cosim.whole_path import PLATFORMS, TEST_SECONDS, WholePath
from cosimulation.candidates import identify_candidates
from cosimulation.demo import generate_settings
from cosimulation.fmu_file import open_fmu
from cosimulation.generate import make_data
from cosimulation.identify import Identified, identify_from_folder
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm


@pytest.fixture(scope="session")
def white_box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wbm(tmp_path_factory.mktemp("wbm") / "pantograph_wbm.fmu", PLATFORMS)


@pytest.fixture(scope="session")
def vendor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU that does wrong what it is told to."""
    return sweeps.build_vendor(tmp_path_factory.mktemp("vendor") / "vendor.fmu")


@pytest.fixture(scope="session")
def blow(white_box: Path, tmp_path_factory: pytest.TempPathFactory) -> WholePath:
    full = generate_settings(white_box, "Blow", quick=False)
    experiments = tuple(
        item.model_copy(update={"duration": TEST_SECONDS}) if item.split == "test" else item
        for item in full.experiments
        if item.split != "validation"
    )
    settings = full.model_copy(update={"experiments": experiments})
    data = make_data(settings)
    with open_fmu(white_box) as fmu:
        found = {item.name: item for item in identify_candidates("Blow", data, fmu, settings)}
    folder = tmp_path_factory.mktemp("blow fmus")  # a space in the path on purpose
    fmus = {
        name: build_llmn(item.parameter_set, folder / f"{name}.fmu", PLATFORMS)
        for name, item in found.items()
    }
    return WholePath(white_box, settings, data, found, fmus)


@pytest.fixture(scope="session")
def identify_folder(blow: WholePath, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return identify_data.write_data(blow, tmp_path_factory.mktemp("identify"))


@pytest.fixture(scope="session")
def identified(identify_folder: Path) -> Identified:
    return identify_from_folder(identify_data.settings(identify_folder))
