"""Python FMUs run in the process of the tests, and must leave it as it was."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def unchanged_interpreter() -> Iterator[None]:
    """Take out again what pythonfmu's binary puts into sys.path and sys.modules: an FMU's own modules."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if name.split(".")[0] == "pythonfmu" or name.endswith(("_slave", "_network")):
            del sys.modules[name]
