from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fmi import lti
from fmi.raw import Slave, load
from fmu_builder.compiler import host_platform

GUID = lti.INTERFACE.guid(lti.MODEL_HASH)
SAMPLED_GUID = lti.SAMPLED.guid(lti.MODEL_HASH)


@pytest.fixture(scope="session")
def lti_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    platforms = dict.fromkeys((host_platform(), "linux64", "win64"))
    return lti.build(tmp_path_factory.mktemp("a folder") / "lti_test.fmu", tuple(platforms))


@pytest.fixture(scope="session")
def lti_library(lti_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load(lti_fmu, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture(scope="session")
def sampled_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sampled") / "lti_sampled.fmu"
    return lti.build(path, [host_platform()], interface=lti.SAMPLED)


@pytest.fixture(scope="session")
def sampled_library(sampled_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load(sampled_fmu, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture
def new_slave(lti_library: ctypes.CDLL) -> Iterator[Callable[..., Slave]]:
    """Return a function that makes instances of the model with continuous states, freed at the end."""
    yield from _maker(lti_library, GUID)


@pytest.fixture
def new_sampled(sampled_library: ctypes.CDLL) -> Iterator[Callable[..., Slave]]:
    """Return a function that makes instances of the sampled model, freed at the end."""
    yield from _maker(sampled_library, SAMPLED_GUID)


def _maker(library: ctypes.CDLL, own_guid: str) -> Iterator[Callable[..., Slave]]:
    made: list[Slave] = []

    def make(guid: str = own_guid, **keywords: object) -> Slave:
        made.append(Slave(library, guid, **keywords))
        return made[-1]

    yield make
    for slave in made:
        slave.free()
