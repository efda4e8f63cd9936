"""What can be said about a surrogate before it is identified; the thesis's route as one of these settings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from fmu_builder.kernel import CHAINS
from fmu_builder.parameter_set import Validity
from identification.n4sid import N4sidSettings
from identification.network import NetworkSettings
from identification.surrogate.chain import STATE_NAMES
from identification.surrogate.frequency_response import FrequencyResponseSettings
from identification.surrogate.output_error import OutputErrorSettings
from identification.surrogate.problem import DEVIATION_OUTPUT
from identification.validity import NODES

StructureName = Literal["chain7", "chain8", "chain9", "chain10"]


def _not_finite(value: object, place: str = "") -> Iterator[str]:
    """Yield every number in nested settings that is infinite or not a number."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _not_finite(item, f"{place}.{key}" if place else str(key))
    elif isinstance(value, tuple):
        for item in value:
            yield from _not_finite(item, place)
    elif isinstance(value, float) and not math.isfinite(value):
        yield f"{place} is {value}: give a finite number"


class SurrogateSettings(BaseModel):
    """What kind of surrogate is identified, and how; the defaults are what ships.

    Attributes:
        structure: A key of `STRUCTURES`.
        blending: `theta`: physical parameters are blended over the height and discretised at the nodes of a
            table; `matrices`: the discrete matrices are blended (thesis 3.6.2).
        validity: Validity functions. `automatic`: cubics, over a warped height where theta is blended, except
            for structures that cannot follow the reference (`chain7`, `chain10`): their outer models are held
            beyond their centres, because what they compensate must not be extrapolated.
        warp: v0 and v1 of the warped height of "cubic_warp"; "tuned" lets the training data decide.
        k_sigma: Gaussians only: the standard deviation is k_sigma times the spread.
        nodes: Nodes of the table of theta blending over the whole range.
        offsets: `scheduled_equilibrium`, or `affine` (eq. 3.33-3.34), which needs blended matrices.
        deviation_gain: kappa: zeta's deviation from rest, times this, is added to the height that schedules;
            0 is off, "tuned" lets the training data decide. Theta blending only.
        training_rows: First and last sample of the training data used for tuning, counted from 1.
        frequency_response: The fit that gives the physical theta and, unless said otherwise, the start of the
            tuning.
        output_error: The tuning.
        standard_errors: Whether standard errors are computed (Fisher information, jackknife).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    structure: StructureName = "chain8"
    blending: Literal["theta", "matrices"] = "theta"
    validity: Literal["automatic", "gaussian", "hat_clamped", "hat", "cubic", "cubic_warp"] = "automatic"
    warp: tuple[float, float] | Literal["tuned"] = "tuned"
    k_sigma: float = Field(1.0 / 3.0, gt=0.0)
    nodes: int = Field(NODES, ge=2)
    offsets: Literal["scheduled_equilibrium", "affine"] = "scheduled_equilibrium"
    deviation_gain: float | Literal["tuned"] = 0.0
    training_rows: tuple[int, int] | None = None
    frequency_response: FrequencyResponseSettings = FrequencyResponseSettings()
    output_error: OutputErrorSettings = OutputErrorSettings()
    standard_errors: bool = True

    @model_validator(mode="after")
    def _fits_together(self) -> SurrogateSettings:
        theta = self.blending == "theta"
        if theta and self.validity == "gaussian":
            raise ValueError("theta blending runs from a node table: use another validity than Gaussians")
        if not theta and self.validity == "cubic_warp":
            raise ValueError("the warp belongs to theta blending: use another validity for matrices")
        if theta and self.offsets == "affine":
            raise ValueError('affine offsets belong to blended matrices: blending = "matrices"')
        if self.deviation_gain != 0.0 and not theta:
            raise ValueError("a deviation can schedule only where theta is blended")
        if self.training_rows is not None and not 1 <= self.training_rows[0] < self.training_rows[1]:
            raise ValueError("training_rows are the first and the last sample, counted from 1")
        if any(count < 1 for count in self.output_error.stages):
            raise ValueError("every stage has at least one local model")
        if self.warp != "tuned" and self.chosen_validity != "cubic_warp":
            raise ValueError(f"the warp belongs to cubic_warp, the validity is {self.chosen_validity}")
        if wrong := [*_not_finite(self.model_dump()), *self._start_problems()]:
            raise ValueError("; ".join(wrong))
        return self

    def _start_problems(self) -> Iterator[str]:
        """Yield what is wrong with the start that output error is given."""
        start = self.output_error.single_start
        if start is None:
            return
        known = {one.name: one for one in CHAINS[self.structure]}
        place = "output_error.single_start"
        if strange := [name for name in start if name not in known]:
            yield f"{place}: {self.structure} has no {', '.join(strange)}"
        if missing := [name for name in known if name not in start]:
            yield f"{place}: lacks {', '.join(missing)}"
        for name in set(start) & set(known):
            low, high = known[name].lower, known[name].upper
            if not low <= start[name] <= high:
                yield f"{place}: {name} = {start[name]:g} lies outside {low:g} .. {high:g} {known[name].unit}"

    @property
    def chosen_validity(self) -> Validity:
        """The validity functions, `automatic` resolved."""
        if self.validity != "automatic":
            return self.validity
        if self.structure not in ("chain8", "chain9"):
            return "hat_clamped"
        return "cubic_warp" if self.blending == "theta" else "cubic"

    @property
    def first_warp(self) -> tuple[float, float]:
        """The warp that is given, or none to begin with."""
        return (0.0, 0.0) if self.warp == "tuned" else self.warp

    def network(self, warp: tuple[float, float] | None = None, gain: float = 0.0) -> NetworkSettings:
        """Return how the local models become a network with a warp and a kappa."""
        return NetworkSettings(
            warp=self.first_warp if warp is None else warp,
            validity=self.chosen_validity,
            k_sigma=self.k_sigma,
            nodes=self.nodes,
            blending="parameter",
            offsets=self.offsets,
            deviation_output=DEVIATION_OUTPUT if gain != 0.0 else None,
            deviation_gain=gain,
        )


def local_model_settings(chosen: N4sidSettings) -> N4sidSettings:
    """Return settings of local models with a state for each of a chain's, where the order is automatic.

    Noise hides weak modes from the singular values; that the chain has them is known.

    Args:
        chosen: What is asked for otherwise.
    """
    least = max(chosen.subspace.least_order, len(STATE_NAMES))
    return chosen.model_copy(update={"subspace": chosen.subspace.model_copy(update={"least_order": least})})


REASONED_START = {
    "m_H": 8.0,  # bars reduced to the head: the upper arm near the crossbar, the rest below
    "m_M": 20.0,
    "k_L": 25000.0,  # an elastic upper arm: the second mode near 12 Hz
    "c_L": 40.0,  # a few percent of damping, here and at the wall
    "r_M": 0.4,
    "k_W": 500.0,  # a frame in nearly neutral balance
    "c_W": 40.0,
}
"""What a mechanical engineer would begin with who has weighed the bars (thesis 4.4)."""

THESIS = SurrogateSettings(
    structure="chain7",
    blending="matrices",
    validity="gaussian",
    offsets="affine",
    training_rows=(25001, 35000),
    output_error=OutputErrorSettings(stages=(1, 2, 4), single_start=REASONED_START, iterations=100),
)
"""The thesis's route: one start, 1 -> 2 -> 4 local models, ten seconds of training data (3.4, 4.3, 4.4)."""
