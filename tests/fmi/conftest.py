from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fmi import lti
from fmi.raw import Slave, load
from fmu_builder.compiler import host_platform

GUID = lti.INTERFACE.guid(lti.MODEL_HASH)


@pytest.fixture(scope="session")
def lti_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    platforms = dict.fromkeys((host_platform(), "linux64", "win64"))
    return lti.build(tmp_path_factory.mktemp("a folder") / "lti_test.fmu", tuple(platforms))


@pytest.fixture(scope="session")
def lti_library(lti_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load(lti_fmu, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture
def new_slave(lti_library: ctypes.CDLL) -> Iterator[Callable[..., Slave]]:
    """Return a function that makes instances, freed at the end."""
    made: list[Slave] = []

    def make(guid: str = GUID, **keywords: object) -> Slave:
        made.append(Slave(lti_library, guid, **keywords))
        return made[-1]

    yield make
    for slave in made:
        slave.free()
