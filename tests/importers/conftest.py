from __future__ import annotations

import os
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import fmpy.logging
import networks
import pytest
from theta_networks import theta_network

from fmu_builder.compiler import host_platform
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm
from importers.wire import build_wire

PACKAGES = ("ecospy", "fmu_manipulation_toolbox", "libcosimpy")


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """The white-box model, a surrogate with physical parameters, a network of matrices, and a wire."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        # Where everything that is tested must be tested, a missing importer is a fault.
        stop = pytest.fail if os.environ.get("CI") == "true" else pytest.skip
        stop(f"these importers are not installed: {', '.join(missing)}")
    folder = tmp_path_factory.mktemp("for importers")
    here = (host_platform(),)
    n4sid = networks.network(43, blending="output", validity="gaussian")
    return {
        "wbm": build_wbm(folder / "pantograph_wbm.fmu", here),
        "surrogate": build_llmn(
            theta_network(), folder / "surrogate.fmu", here, model_identifier="surrogate"
        ),
        "n4sid": build_llmn(n4sid, folder / "n4sid.fmu", here, model_identifier="n4sid"),
        "wire": build_wire(folder / "wire.fmu", here),
    }


@pytest.fixture(scope="session", autouse=True)
def loggers_that_never_go_away() -> None:
    """Keep every logger given to fmpy: its library goes on calling the last one, also in runs without."""
    kept, add = [], fmpy.logging.addLoggerProxy

    def add_and_keep(callbacks: object) -> None:
        kept.append(callbacks)
        add(callbacks)

    fmpy.logging.addLoggerProxy = add_and_keep
