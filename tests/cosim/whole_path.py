"""What the tests of this room share: one white-box set, its data, its models and their FMUs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cosimulation.candidates import Candidate
from cosimulation.data_folder import DataFolder
from cosimulation.settings import GenerateSettings
from fmu_builder.compiler import host_platform

PLATFORMS = (host_platform(),)
TEST_SECONDS = 20.0


@dataclass(frozen=True)
class WholePath:
    """White-box model, data, models and their FMUs."""

    white_box: Path
    settings: GenerateSettings
    data: DataFolder
    candidates: dict[str, Candidate]
    fmus: dict[str, Path]
