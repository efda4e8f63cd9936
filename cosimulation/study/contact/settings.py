"""Tables of `contact.toml`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from cosimulation.pantograph import TORQUE
from cosimulation.settings import Section
from cosimulation.study.runner import StudySettings

Amplitude = Annotated[float, Field(gt=0)]


class FrictionCase(Section):
    """Friction of the white-box model."""

    name: str = Field(description="of its rows")
    coulomb: float = Field(ge=0, description="T_c of the base joint, where the case stands on the axis [N.m]")
    start_values: dict[str, float] = Field(
        default_factory=dict, description="further start values of the white-box FMU; replace T_c"
    )
    axis: bool = Field(True, description="whether it is a level on the curve of T_c, or stands alone")

    @property
    def options(self) -> dict[str, float]:
        """Start values of the white-box FMU."""
        return {"friction_base": self.coulomb, **self.start_values}


class Combination(Section):
    """Friction and lift-off at once."""

    friction: str = Field(description="name of a friction case")
    amplitude: Amplitude = Field(description="of the excitation, 1 is the acceptance recipe's")
    torque: float = TORQUE


class ContactSettings(StudySettings):
    """What is varied; amplitudes scale the acceptance recipe's wire noise and torque steps alike."""

    duration: float = Field(120.0, gt=0, description="of every whole-range record [s]")
    frictions: tuple[FrictionCase, ...]
    friction_amplitudes: tuple[Amplitude, ...] = Field(min_length=1, description="where friction is tried")
    amplitudes: tuple[Amplitude, ...] = Field(min_length=1, description="where lift-off is tried")
    torques: tuple[float, ...] = Field(
        (TORQUE,), min_length=1, description="mean torques at which lift-off is tried [N.m]"
    )
    combinations: tuple[Combination, ...] = ()
    jump: float = Field(0.02, gt=0, description="the wire is raised and dropped by this at once [m]")
    jump_height: float = Field(1.5, description="from this height [m]")
    jump_duration: float = Field(1.0, gt=0, description="of the record after it [s]")
    twin_rise: float = Field(
        1e-6, gt=0, description="the white-box model beside itself: its wire is this much higher [m]"
    )
    ramp_speed: float = Field(0.072, gt=0, description="of the slow ramp for the hysteresis [m/s]")
    ramp: tuple[float, float] = Field((0.8, 2.0), description="from this height to that and back [m]")
    ramp_counted: tuple[float, float] = Field((1.3, 1.6), description="heights over which it is averaged [m]")
    shown_amplitude: float = Field(0.2, description="lift-off drawn over time at this amplitude")
    usable_fit: float = Field(90.0, description="a network whose F_p has this FIT is called usable [%]")
    usable_loss: float = Field(
        1.0, gt=0, description="so are its statistics where the loss is this near, in percentage points"
    )
    usable_deviation: float = Field(5.0, gt=0, description="and the standard deviation is this near [%]")

    @model_validator(mode="after")
    def _fits_together(self) -> ContactSettings:
        names = [case.name for case in self.frictions]
        if not names or self.frictions[0].options != {"friction_base": 0.0}:
            raise ValueError("the first of the frictions must be without any")
        if len(set(names)) != len(names):
            raise ValueError("two frictions have one name")
        unknown = sorted({one.friction for one in self.combinations} - set(names))
        if unknown:
            raise ValueError(f"combinations name no friction: {', '.join(unknown)}")
        low, high = self.ramp
        if not low < self.ramp_counted[0] < self.ramp_counted[1] < high:
            raise ValueError("ramp_counted must lie inside ramp")
        return self

    def friction(self, name: str) -> FrictionCase:
        """Return a friction case by its name."""
        return next(case for case in self.frictions if case.name == name)
