"""FMUs that several files of this room share."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from trained_networks import Built, build


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Built]:
    """The FMU of one of the networks with a trained region, built when it is first asked for."""
    made: dict[str, Built] = {}

    def one(name: str) -> Built:
        if name not in made:
            made[name] = build(name, tmp_path_factory.mktemp(name))
        return made[name]

    return one
