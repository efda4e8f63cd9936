"""Tables of `lolimot.toml`."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from cosimulation.pantograph import SIGNALS
from cosimulation.settings import Section
from cosimulation.study.runner import StudySettings
from identification.lolimot import LolimotSettings

ANGLE = "phi_1"
"""The output of the thesis's LOLIMOT model: the angle of the lower arm."""
ALL_SIGNALS = (*SIGNALS, ANGLE)
ONE_STEP, FREE_RUN = "one step", "free run"
FROM_XI = ", from xi"

Form = Literal["regressors", "observer", "controller", "modal", "modal, own centre", "outputs blended"]
FORMS: dict[Form, dict[str, str]] = {
    "regressors": {"form": "regressors"},
    "observer": {"form": "observer"},
    "controller": {"form": "controller"},
    "modal": {"form": "modal"},
    "modal, own centre": {"form": "modal", "origin": "own"},
    "outputs blended": {"form": "regressors", "blending": "output"},
}
"""What a parameter set is built with, by the name a form has in score records."""


class LolimotConfiguration(Section):
    """One way to identify networks, one network per output."""

    name: str
    outputs: tuple[str, ...] = Field((ANGLE,), min_length=1)
    lolimot: LolimotSettings = LolimotSettings()
    forms: tuple[Form, ...] = Field((), description="state-space forms that are built and simulated")
    noise: float = Field(0.0, ge=0, description="standard deviation on training data of the outputs [unit]")
    dense: bool = Field(False, description="whether training data stay longer in one part of the range")
    detailed: bool = Field(False, description="whether blends are measured; drawings for the first seed")
    sets: tuple[str, ...] = ("A", "Blow")

    @model_validator(mode="after")
    def _knows_its_outputs(self) -> LolimotConfiguration:
        if unknown := sorted(set(self.outputs) - set(ALL_SIGNALS)):
            raise ValueError(f"configuration {self.name!r}: no output {', '.join(unknown)}")
        if self.detailed and ANGLE not in self.outputs:
            raise ValueError(f"configuration {self.name!r}: {ANGLE} is what is shown in detail")
        return self


class DenseData(Section):
    """Additional training data that stay in one part of the range."""

    low: float = 0.6
    high: float = 1.0
    duration: float = Field(120.0, gt=0, description="[s]")


class LolimotStudySettings(StudySettings):
    """Tables of `lolimot.toml`."""

    training_duration: float = Field(120.0, gt=0, description="of whole-range data [s]")
    test_duration: float = Field(70.0, gt=0, description="of whole-range data [s]")
    dense: DenseData = DenseData()
    configurations: tuple[LolimotConfiguration, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _names_differ(self) -> LolimotStudySettings:
        names = [one.name for one in self.configurations]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"configurations: twice: {', '.join(twice)}")
        return self


Record = dict[str, Any]
