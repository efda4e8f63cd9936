"""Settings of a sweep: which models, on which signals, with which parameters and seeds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

from pydantic import Field, field_validator, model_validator

from cosimulation.fmu_driver import StartValue
from cosimulation.settings import Section
from identification.excitation import ACCEPTANCE, ExcitationSettings

_NAME = r"^[A-Za-z0-9_.\-]+$"


class ModelSettings(Section):
    """One FMU of a sweep."""

    fmu: str = Field(min_length=1, description="a file, or the name of an FMU that comes with the project")
    name: str | None = Field(None, pattern=_NAME, description="in the results; that of the FMU by default")
    start_values: dict[str, StartValue] = Field(
        default_factory=dict, description="of its parameters, and of inputs that no signal drives"
    )
    names: dict[str, str] = Field(
        default_factory=dict, description="what the FMU calls our signals, where it calls them otherwise"
    )
    reuse: bool = Field(
        True, description="reset one instance for run after run; false for an FMU that resets badly"
    )

    @property
    def label(self) -> str:
        """Name in the results."""
        return self.name or Path(self.fmu).stem


class SignalSettings(Section):
    """Inputs of runs: a recipe that every seed draws anew, or a recorded file."""

    name: str = Field(pattern=_NAME)
    kind: Literal["operating_point", "whole_range"] | None = Field(None, description="not for a file")
    file: Path | None = Field(None, description="recorded .csv or .npz, run once whatever the seeds")
    duration: float | None = Field(None, gt=0, le=1e6, description="[s]; not for a file")
    height: float | None = Field(None, description="operating point of eta [m]; kind operating_point")
    low: float = Field(0.6, description="lowest height of a whole-range run, without noise [m]")
    high: float = Field(2.4, description="highest [m]")
    excitation: ExcitationSettings = ACCEPTANCE

    @field_validator("excitation")
    @classmethod
    def _finite(cls, excitation: ExcitationSettings) -> ExcitationSettings:
        if wrong := [name for name, value in excitation.model_dump().items() if not math.isfinite(value)]:
            raise ValueError(f"not a finite number: {', '.join(wrong)}")
        return excitation

    @model_validator(mode="after")
    def _fits_its_kind(self) -> SignalSettings:
        wrong = []
        if (self.file is None) == (self.kind is None):
            wrong.append("a signal needs either a file or a kind")
        if (self.kind is None) != (self.duration is None):
            wrong.append("a duration goes with a kind, and a kind with a duration")
        if (self.kind == "operating_point") != (self.height is not None):
            wrong.append("a height goes with the kind operating_point, and with no other")
        if self.duration is not None and round(self.duration / self.excitation.sample_time) < 1:
            wrong.append("the duration is below one sample time")
        if not self.low < self.high:
            wrong.append(f"low {self.low:g} is not below high {self.high:g}")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self


class ParameterSettings(Section):
    """One parameter that is varied: values of a grid, or a range that every sample draws from."""

    name: str = Field(min_length=1)
    values: tuple[StartValue, ...] | None = Field(None, min_length=1, description="of the grid")
    low: float | None = Field(None, description="of the range that samples are drawn from")
    high: float | None = None
    scale: Literal["uniform", "log"] = Field("uniform", description="log: uniform in the logarithm")
    models: tuple[str, ...] | None = Field(None, description="of which models; of all by default")
    reference: bool = Field(False, description="set in the reference as well")

    @model_validator(mode="after")
    def _is_one_of_both(self) -> ParameterSettings:
        wrong = []
        ranged = self.low is not None and self.high is not None
        if (self.low is None) != (self.high is None):
            wrong.append("a range needs low and high")
        elif ranged == (self.values is not None):
            wrong.append("a parameter needs either values or low and high")
        if self.low is not None and self.high is not None and not self.low < self.high:
            wrong.append(f"low {self.low:g} is not below high {self.high:g}")
        if self.scale == "log" and (self.values is not None or (self.low is not None and self.low <= 0)):
            wrong.append("the scale log needs a range above 0")
        if self.values is not None and len({(type(one), one) for one in self.values}) < len(self.values):
            wrong.append("a value appears more than once")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    @property
    def sampled(self) -> bool:
        """Whether every sample draws it."""
        return self.values is None


class SweepSettings(Section):
    """`llmn sweep`: models x signals x parameters x seeds."""

    output: Path = Path("runs/sweep")
    seeds: tuple[int, ...] = Field((1,), min_length=1, description="of the signals drawn")
    samples: int = Field(1, ge=1, le=1_000_000, description="draws of the parameters that have a range")
    sample_seed: int = Field(1, ge=0, description="of those draws")
    outputs: tuple[str, ...] = Field((), description="that are scored; all shared ones by default")
    models: tuple[ModelSettings, ...] = Field(min_length=1)
    signals: tuple[SignalSettings, ...] = Field(min_length=1)
    parameters: tuple[ParameterSettings, ...] = ()
    reference: ModelSettings | None = Field(None, description="gives the outputs that models are scored by")
    processes: int | None = Field(None, ge=1, description="all cores by default")
    chunk_rows: int = Field(200_000, ge=1, description="samples that a worker is given at a time, about")
    time_limit: float = Field(3600.0, gt=0, description="of one run on this machine [s]")

    @field_validator("seeds")
    @classmethod
    def _are_seeds(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        if min(seeds) < 0 or len(set(seeds)) < len(seeds):
            raise ValueError("seeds are different whole numbers from 0 on")
        return seeds

    @model_validator(mode="after")
    def _has_different_names(self) -> SweepSettings:
        wrong = []
        tables = {
            "models": [item.label for item in self.models],
            "signals": [item.name for item in self.signals],
            "parameters": [item.name for item in self.parameters],
        }
        for table, names in tables.items():
            for name in sorted({name for name in names if names.count(name) > 1}):
                wrong.append(f"{table}: the name {name!r} appears more than once; give each its own")
        for item in self.parameters:
            for name in item.models or ():
                if name not in tables["models"]:
                    wrong.append(f"parameter {item.name!r} is of the model {name!r}, which is not there")
            if item.reference and self.reference is None:
                wrong.append(f"parameter {item.name!r} is of the reference, and there is none")
        if self.samples > 1 and not any(item.sampled for item in self.parameters):
            wrong.append("samples needs a parameter with low and high")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self
