"""Tables of `compare.toml`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from cosimulation.settings import ExperimentSettings
from cosimulation.study.data import centres
from cosimulation.study.runner import StudySettings

POINTS = 4
"""Local models of every network, at equidistant heights: OP25, OP45, OP65, OP85."""
_MOST_DRAWS = 9
_BY_SPEED = "slew_{:03d}_mm_s"


class CompareSettings(StudySettings):
    """Tables of `compare.toml`; the seeds are those of the training draws, M21 and M31 of the first."""

    duration: float = Field(42.0, gt=0, description="of operating-point data [s]")
    whole_range_duration: float = Field(120.0, gt=0, description="of training and validation data [s]")
    signal_duration: float = Field(70.0, gt=0, description="of the test signals [s]")
    signal_seed: int = Field(ge=0, description="of the noise on all test signals, each its own stream")
    slew_rates: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        min_length=1, description="speed of the wire in each test signal [m/s]"
    )
    linearised_at: tuple[float, ...] = Field((1.25, 1.5, 1.75), description="M11, M12, ... [m]")
    operating_point: float = Field(1.75, description="of the networks with one local model [m]")
    timing_repeats: int = Field(20, ge=1, description="the fastest batch call of so many counts")
    loop_repeats: int = Field(2, ge=1, description="the fastest of fmpy's own loops")

    @model_validator(mode="after")
    def _fits_together(self) -> CompareSettings:
        wrong = []
        names = [signal_name(rate) for rate in self.slew_rates]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            wrong.append(f"slew_rates: the same to a millimetre per second: {', '.join(twice)}")
        if self.signal_seed in self.seeds:
            wrong.append(f"signal_seed {self.signal_seed} is a seed of training data, too")
        if len(self.seeds) > _MOST_DRAWS:
            wrong.append(f"seeds: {_MOST_DRAWS} at most, a digit each")
        if self.operating_point not in centres(POINTS):
            known = ", ".join(f"{height:g}" for height in centres(POINTS))
            wrong.append(
                f"operating_point {self.operating_point:g}: no local model stands there; use {known}"
            )
        if len(set(self.linearised_at)) != len(self.linearised_at) or not self.linearised_at:
            wrong.append("linearised_at: at least one height, each of them once")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    def signals(self) -> tuple[ExperimentSettings, ...]:
        """Return the test signals: up and down at one speed each for as long as they last."""
        return tuple(
            ExperimentSettings(
                name=signal_name(rate),
                kind="whole_range",
                split="test",
                duration=self.signal_duration,
                slew_rate=rate,
            )
            for rate in self.slew_rates
        )


def signal_name(slew_rate: float) -> str:
    """Return the name of the test signal with a slew rate [m/s]."""
    return _BY_SPEED.format(round(1000.0 * slew_rate))
