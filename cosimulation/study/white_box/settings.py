"""Tables of `white_box.toml`."""

from __future__ import annotations

from pydantic import Field, model_validator

from cosimulation.pantograph import INPUTS
from cosimulation.settings import Section
from cosimulation.study.data import Noise
from cosimulation.study.runner import StudySettings
from identification.subspace import SubspaceSettings

BANDS = {"f_L": (2.0, 6.0), "f_M": (8.0, 16.0), "f_H": (17.0, 29.0)}
"""Where the three resonances of a pantograph are looked for [Hz]."""


class StepSettings(Section):
    """Steps of the contact height whose responses are transformed (thesis Figures 2.5 to 2.7, Table 2.1)."""

    first: float = Field(0.5, description="height the first step starts from [m]")
    step: float = Field(0.1, gt=0, description="[m]")
    count: int = Field(20, ge=2)
    samples: int = Field(16384, ge=2)


class StaticSettings(Section):
    """Rest points over height and torque (Figure 2.4)."""

    heights: int = Field(41, ge=3)
    torques: int = Field(13, ge=3)
    torque_span: float = Field(150.0, gt=0, description="to either side of the operating point [N.m]")

    @model_validator(mode="after")
    def _has_a_middle(self) -> StaticSettings:
        if self.torques % 2 == 0:
            raise ValueError(f"torques = {self.torques} is even, so that none is the operating point")
        return self


class Route(Section):
    """How modes are identified from a record."""

    name: str
    inputs: tuple[str, ...] = Field(INPUTS, min_length=1, description="those that were measured")
    subspace: SubspaceSettings


class HeightSettings(Section):
    """Records at heights that nobody tells the estimator (section 2.1.3)."""

    low: float = 0.55
    high: float = 2.45
    count: int = Field(8, ge=1, description="records of every seed, one drawn in each of as many strata")
    durations: tuple[float, ...] = Field((2.0, 5.0, 10.0, 20.0, 42.0), min_length=1, description="[s]")
    noises: tuple[Noise, ...] = ("none", "1e-4 m, 1e-2 m/s")
    routes: tuple[Route, ...] = Field(min_length=1, description="the last one is drawn over the height")

    @model_validator(mode="after")
    def _rises(self) -> HeightSettings:
        if not self.low < self.high:
            raise ValueError(f"low {self.low:g} is not below high {self.high:g}")
        return self


class WhiteBoxSettings(StudySettings):
    """Tables of `white_box.toml`."""

    steps: StepSettings = StepSettings()
    static: StaticSettings = StaticSettings()
    linearisations: int = Field(81, ge=9, description="heights at which the FMU is linearised")
    height: HeightSettings
