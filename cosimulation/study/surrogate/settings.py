"""Tables of `surrogate.toml`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from pydantic import Field, model_validator

from cosimulation.settings import Section
from cosimulation.study.data import Noise
from cosimulation.study.local_models import Origin
from cosimulation.study.runner import StudySettings
from identification.network import NetworkSettings
from identification.subspace import SubspaceSettings
from identification.surrogate import SurrogateSettings

ACCEPTANCE_NOISE: Noise = "1e-5 m, 1e-3 m/s"
RECOMMENDED = "recommended"
Theta = Literal["physical", "tuned", "recommended"]


class SurrogateConfiguration(Section):
    """One way to a surrogate, or a network of black-box models to stand beside it."""

    name: str
    table: str = Field(description="of the page that it stands in")
    surrogate: SurrogateSettings | None = None
    network: NetworkSettings | None = None
    models: Origin = "n4sid"
    llms: tuple[int, ...] = (4,)
    noises: tuple[Noise, ...] = (ACCEPTANCE_NOISE,)
    sets: tuple[str, ...] = ("A", "Blow")
    thetas: tuple[Theta, ...] = Field(("recommended",), min_length=1, description="which thetas are scored")
    detailed: bool = Field(False, description="whether its theta and poles are shown and compared")

    @model_validator(mode="after")
    def _is_one_thing(self) -> SurrogateConfiguration:
        if (self.surrogate is None) == (self.network is None):
            raise ValueError(f"configuration {self.name!r}: either surrogate or network")
        if self.detailed and (self.surrogate is None or self.models != "n4sid"):
            raise ValueError(f"configuration {self.name!r}: only identified surrogates are shown in detail")
        return self

    @property
    def routes(self) -> tuple[str, ...]:
        """Names of its score records."""
        if self.surrogate is None or self.models != "n4sid":
            return (self.name,)
        return tuple(f"{self.name}, {which}" for which in self.thetas)

    def cells(self) -> Iterator[tuple[str, str, int, Noise]]:
        """Return what identifies each of its models on one seed: name, set, number of models, noise."""
        return ((self.name, wbm, n, noise) for wbm in self.sets for n in self.llms for noise in self.noises)


class ComparisonTable(Section):
    """One table of the page."""

    name: str
    title: str
    text: str
    reasons: bool = Field(False, description="whether it is told why each tuning stops where it does")


class LocalOptimaSettings(Section):
    """The search for the global optimum of the frequency-response fit, again and again."""

    structure: Literal["chain7", "chain8", "chain9", "chain10"] = "chain8"
    noise: Noise = ACCEPTANCE_NOISE
    data_seeds: int = Field(20, ge=1, description="data sets at every operating point of a white-box set")
    starts: int = Field(20, ge=1, description="random starts that the fit has to stand up to")


class SurrogateStudySettings(StudySettings):
    """Tables of `surrogate.toml`."""

    duration: float = Field(42.0, gt=0, description="of operating-point data [s]")
    whole_range_duration: float = Field(120.0, gt=0, description="[s]")
    tables: tuple[ComparisonTable, ...]
    configurations: tuple[SurrogateConfiguration, ...]
    local_optima: LocalOptimaSettings | None = None
    subspace: SubspaceSettings = SubspaceSettings()

    @model_validator(mode="after")
    def _fit_together(self) -> SurrogateStudySettings:
        cells = [cell for one in self.configurations for cell in one.cells()]
        if len(set(cells)) != len(cells):
            twice = next(cell for cell in cells if cells.count(cell) > 1)
            raise ValueError(f"configurations: the same model twice: {', '.join(map(str, twice))}")
        known = {table.name for table in self.tables}
        for one in self.configurations:
            if one.table not in known:
                raise ValueError(f"configuration {one.name!r}: no table {one.table}")
        return self
