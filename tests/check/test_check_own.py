"""Nothing is found on the FMUs that come with the project, alone and together, and on other networks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import networks
import pytest
from fmpy.validation import validate_fmu

import fmus
from fmi import lti
from fmu_builder.check import Options, check_fmu, check_image
from fmu_builder.check.behaviour.worker import EXPERIMENTS
from fmu_builder.compiler import host_platform
from fmu_builder.llmn_fmu import build_llmn

ONE_OF_A_KIND = ("wbm", "surrogate", "n4sid")
"""Committed FMUs that every experiment is made with; those from Blow are the same code with other numbers."""
NETWORKS = {
    "random_matrices": ("output", "gaussian"),
    "random_hats": ("parameter", "hat_clamped"),
}
EVERYTHING = {"archive", "description", "binaries", "sources", *EXPERIMENTS}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """Two networks and the test model, for this machine and win64."""
    folder = tmp_path_factory.mktemp("own")
    platforms = tuple(dict.fromkeys((host_platform(), "win64")))
    found = {"lti": lti.build(folder / "lti_test.fmu", platforms)}
    for name, (blending, validity) in NETWORKS.items():
        network = networks.network(43, blending=blending, validity=validity, feedthrough=True)
        found[name] = build_llmn(network, folder / f"{name}.fmu", platforms, model_identifier=name)
    return found


@pytest.mark.parametrize("name", ONE_OF_A_KIND)
def test_nothing_is_found_on_what_comes_with_the_project(name: str) -> None:
    report = check_fmu(fmus.path(name), Options(time_limit=600.0))
    assert report.findings == (), report.text()
    assert set(report.checked) == EVERYTHING


@pytest.mark.parametrize("name", sorted(set(fmus.NAMES) - set(ONE_OF_A_KIND)))
def test_nothing_is_found_in_the_others_and_they_run(name: str) -> None:
    report = check_fmu(fmus.path(name), Options(experiments=(), time_limit=600.0))
    assert report.findings == (), report.text()


@pytest.mark.parametrize("name", NETWORKS)
def test_nothing_is_found(name: str, own: Mapping[str, Path]) -> None:
    assert validate_fmu(str(own[name])) == []
    report = check_fmu(own[name], Options(time_limit=600.0))
    assert report.findings == (), report.text()
    assert set(report.checked) == EVERYTHING


def test_all_link_into_one_image(own: Mapping[str, Path]) -> None:
    report = check_image([*map(fmus.path, fmus.NAMES), *own.values()], 60.0)
    assert report.findings == (), report.text()
    assert report.checked == ("one image",)
