"""Settings of LOLIMOT."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

StateSpaceForm = Literal["regressors", "observer", "controller", "modal"]
"""How a local ARX model becomes a state-space system; see `identification.lolimot.state_space`."""

Origin = Literal["common", "own"]
"""What a local model counts deviations from: one point for all, or its own centre and its outputs at rest."""

Limits = tuple[float, float]


class LolimotSettings(BaseModel):
    """Orders, tree, and the state-space form of a parameter set."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    past_outputs: int = Field(6, ge=1, le=60, description="na; twice the degrees of freedom")
    past_inputs: int = Field(6, ge=1, le=60, description="nb, of every input")
    delay: Literal[0, 1] = Field(1, description="rows until an input acts; 0: it acts on the output at once")
    every: int = Field(1, ge=1, description="rows of the data per row of the model")
    scheduling: dict[str, Limits] = Field(
        default_factory=lambda: {"eta": (0.5, 2.5)},
        min_length=1,
        description="inputs whose space the tree divides, and their operating ranges",
    )
    most_models: int = Field(4, ge=1, le=64, description="number of local models at which the tree stops")
    least_gain: float = Field(
        0.0,
        ge=0.0,
        lt=1.0,
        description="share of the sum of squared errors that a split must save, or the tree stops",
    )
    k_sigma: Annotated[float, Field(gt=0.0)] = Field(
        1.0 / 3.0, description="standard deviation of a Gaussian over the width of its cell"
    )
    form: StateSpaceForm = Field("regressors", description="of the local models in a parameter set")
    origin: Origin = Field("common", description="of the deviations in a parameter set")
    blending: Literal["parameter", "output"] = Field("parameter", description="of a parameter set")

    @model_validator(mode="after")
    def _ranges_ascend(self) -> LolimotSettings:
        wrong = [name for name, (low, high) in self.scheduling.items() if not low < high]
        if wrong:
            raise ValueError(f"scheduling: the range of {', '.join(wrong)} does not ascend")
        return self
