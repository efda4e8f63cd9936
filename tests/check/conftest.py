from __future__ import annotations

from pathlib import Path

import pytest

from fmi import lti
from fmu_builder.compiler import host_platform


@pytest.fixture(scope="session")
def right_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU without a defect, to plant one in."""
    platforms = tuple(dict.fromkeys((host_platform(), "linux64", "win64")))
    return lti.build(tmp_path_factory.mktemp("right one") / "lti_test.fmu", platforms)
