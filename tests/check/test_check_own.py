"""Nothing is found on the FMUs that come with the project, alone and together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import networks
import pytest

from fmi import lti
from fmu_builder.check import Options, check_fmu, check_image
from fmu_builder.check.behaviour.worker import EXPERIMENTS
from fmu_builder.compiler import host_platform
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm

NETWORKS = {
    "random_matrices": ("output", "gaussian"),
    "random_hats": ("parameter", "hat_clamped"),
}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """The white-box model, two networks and the test model, for this machine and win64."""
    folder = tmp_path_factory.mktemp("own")
    platforms = tuple(dict.fromkeys((host_platform(), "win64")))
    found = {
        "wbm": build_wbm(folder / "pantograph_wbm.fmu", platforms),
        "lti": lti.build(folder / "lti_test.fmu", platforms),
    }
    for name, (blending, validity) in NETWORKS.items():
        network = networks.network(43, blending=blending, validity=validity, feedthrough=True)
        found[name] = build_llmn(network, folder / f"{name}.fmu", platforms, model_identifier=name)
    return found


@pytest.mark.parametrize("name", ["wbm", *NETWORKS])
def test_nothing_is_found(name: str, own: Mapping[str, Path]) -> None:
    report = check_fmu(own[name], Options(time_limit=600.0))
    assert report.findings == (), report.text()
    assert {"archive", "description", "binaries", "sources", *EXPERIMENTS} == set(report.checked)


def test_all_link_into_one_image(own: Mapping[str, Path]) -> None:
    report = check_image(list(own.values()), 60.0)
    assert report.findings == (), report.text()
    assert report.checked == ("one image",)
