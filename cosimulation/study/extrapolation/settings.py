"""Tables of `extrapolation.toml`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from cosimulation.settings import Section
from cosimulation.study.runner import StudySettings

CauseName = Literal["height", "speed", "noise", "frequency", "torque"]


class Cause(Section):
    """One way out of the trained region; everything else stays as in training."""

    name: CauseName
    values: tuple[float, ...] = Field(min_length=1, description="in rising order, in the cause's unit")
    inside: float = Field(
        description="one of the values, inside the trained region: errors are compared with it"
    )
    trained: tuple[float, float] | None = Field(
        None, description="the trained region, where the parameter set does not tell it"
    )
    duration: float = Field(30.0, gt=0, description="of every record [s]")

    @model_validator(mode="after")
    def _fits_together(self) -> Cause:
        if list(self.values) != sorted(set(self.values)):
            raise ValueError(f"cause {self.name!r}: values must rise")
        if self.inside not in self.values:
            raise ValueError(f"cause {self.name!r}: inside = {self.inside:g} is none of its values")
        if self.name in ("speed", "noise", "frequency") and self.values[0] <= 0.0:
            raise ValueError(f"cause {self.name!r}: {self.values[0]:g} is not above zero")
        return self


class ExtrapolationSettings(StudySettings):
    """What is varied, and how."""

    causes: tuple[Cause, ...] = Field(min_length=1)
    height: float = Field(1.5, description="where torque and frequency are tried [m]")
    travel: tuple[float, float] = Field(
        (0.6, 2.4), description="the fast wire goes between these heights [m]"
    )
    sine_amplitude: float = Field(0.0005, gt=0, description="of the wire where the frequency is tried [m]")
    usable_fit: float = Field(90.0, description="a network whose F_p has this FIT is called usable [%]")

    @model_validator(mode="after")
    def _once_each(self) -> ExtrapolationSettings:
        names = [cause.name for cause in self.causes]
        if len(set(names)) != len(names):
            raise ValueError("a cause stands there twice")
        if not self.travel[0] < self.travel[1]:
            raise ValueError("travel must go up")
        return self

    def cause(self, name: str) -> Cause:
        """Return a cause by its name."""
        return next(cause for cause in self.causes if cause.name == name)
