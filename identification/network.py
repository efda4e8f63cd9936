"""From local models to a network: a `ParameterSet` with validity, blending, offsets and its node table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from fmu_builder.errors import IdentificationError, Problem
from fmu_builder.parameter_set import (
    DerivedOutput,
    InputSignal,
    LocalLinearModel,
    NodeTable,
    Offsets,
    OutputSignal,
    ParameterSet,
    Partition,
    Validity,
    nested,
    warp_rises,
)
from identification.arrays import Array
from identification.blending import as_parts, blended, stacked
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.static_map import StaticMap
from identification.validity import LARGEST_NODE_COUNT, NODES, cell_widths, node_positions, weights

AnySignal = TypeVar("AnySignal", InputSignal, OutputSignal)


class NetworkSettings(BaseModel):
    """How local models become a network; "tuned" and "best" are left to whole-range training data."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    validity: Validity = "hat"
    k_sigma: Annotated[float, Field(gt=0.0)] | Literal["tuned"] = Field(
        default=1.0 / 3.0, description="Gaussians: sigma = k_sigma * spread"
    )
    warp: tuple[float, float] | Literal["tuned"] = Field(
        default="tuned", description="v0 and v1 of cubic_warp"
    )
    nodes: int = Field(
        default=NODES, ge=2, le=LARGEST_NODE_COUNT, description="of the table that cubics are compiled to"
    )
    deviation_output: str | None = Field(default=None, description="output whose deviation also schedules")
    deviation_gain: float | Literal["tuned"] = Field(default=0.0, description="kappa of that deviation")
    coordinates: Literal["aligned", "tuned"] = Field(
        default="aligned", description="state coordinates in which parameters are blended"
    )
    blending: Literal["output", "parameter", "best"] = "parameter"
    offsets: Literal["none", "affine", "low_pass", "scheduled_equilibrium"] = "scheduled_equilibrium"
    corner_frequency: float = Field(default=0.25, gt=0.0, description="of the low-pass of the offsets [Hz]")

    @model_validator(mode="after")
    def _deviation_of_what(self) -> NetworkSettings:
        if self.deviation_gain != 0.0 and self.deviation_output is None:
            raise ValueError("a deviation_gain needs a deviation_output")
        return self

    @property
    def _nodes_of_equilibria(self) -> bool:
        """Whether a deviation can schedule: parameters, a node table, a scheduled equilibrium."""
        tabled = self.blending != "output" and self.validity != "gaussian"
        return tabled and self.offsets == "scheduled_equilibrium"

    @property
    def open_choices(self) -> tuple[str, ...]:
        """Names of the settings that whole-range training data have to decide."""
        relevant = {
            "k_sigma": self.validity == "gaussian",
            "warp": self.validity == "cubic_warp",
            "deviation_gain": self._nodes_of_equilibria,
            "coordinates": self.blending != "output" and self.offsets == "scheduled_equilibrium",
            "blending": True,
        }
        return tuple(name for name in relevant if relevant[name] and getattr(self, name) in ("tuned", "best"))


RECOMMENDED = NetworkSettings()
"""Aligned matrices blended by hats that go on to the ends of the range, about the scheduled equilibrium."""

AUTOMATIC = NetworkSettings(validity="cubic_warp", coordinates="tuned", blending="best")
"""What whole-range training data can decide is left to them; only the scheduling input schedules."""

THESIS = NetworkSettings(validity="gaussian", blending="output", offsets="low_pass")
"""Gaussians with k_sigma = 1/3, outputs blended, 0.25 Hz low-pass and look-up table (thesis 3.3, 3.5.4)."""


def partition_of(
    settings: NetworkSettings, scheduling: str, limits: tuple[float, float], centres: Sequence[float]
) -> Partition:
    """Return the partition of the range `limits` of the scheduling input into cells around the centres.

    Raises:
        IdentificationError: A number of the settings is still to be chosen, centres that do not ascend, a
            warp that folds the range; all at once.
    """
    found = []
    if settings.open_choices:
        open_ones = ", ".join(settings.open_choices)
        mend = "Give a number, or whole-range training data (identification.tuning)"
        found.append(Problem("network", f"{open_ones} still to be chosen", mend))
    if not all(left < right for left, right in pairwise(centres)):
        what = f"the centres {', '.join(f'{centre:g}' for centre in centres)} do not ascend"
        found.append(Problem("network", what, "Sort the local models by their centres, each of them once"))
    folds = settings.warp != "tuned" and not warp_rises(settings.warp, 0.5 * (limits[1] - limits[0]))
    if settings.validity == "cubic_warp" and folds:
        what = f"the warp {settings.warp} makes the warped variable fall within the range"
        found.append(Problem("network", what, "Give smaller numbers"))
    if found:
        raise IdentificationError(found)
    gaussian = settings.validity == "gaussian"
    warp, gain, k_sigma = settings.warp, settings.deviation_gain, settings.k_sigma
    return Partition(
        scheduling=scheduling,
        range=limits,
        validity=settings.validity,
        centres=tuple(float(centre) for centre in centres),
        spreads=nested(cell_widths(centres, *limits)) if gaussian else None,
        k_sigma=k_sigma if gaussian and k_sigma != "tuned" else None,
        warp=warp if settings.validity == "cubic_warp" and warp != "tuned" else None,
        deviation_output=settings.deviation_output,
        deviation_gain=gain if gain != "tuned" else 0.0,
    )


def signals_of(
    experiments: Sequence[DataSet],
    inputs: Sequence[str],
    outputs: Sequence[str],
    operating_point: Mapping[str, float],
    output_operating_point: Array,
    descriptions: Mapping[str, str] | None = None,
) -> tuple[tuple[InputSignal, ...], tuple[OutputSignal, ...]]:
    """Return the signals of a network with the units and the limits of its training data.

    Args:
        experiments: The training data.
        inputs: Names of the m inputs.
        outputs: Names of the p outputs.
        operating_point: u_op by name.
        output_operating_point: y_op, shape (p,).
        descriptions: One line per name, where there is one.

    Raises:
        DataError: Columns are missing.
    """
    names = [*inputs, *outputs]
    selected = [data.select(names) for data in experiments]
    low = np.min([data.values.min(axis=0) for data in selected], axis=0)
    high = np.max([data.values.max(axis=0) for data in selected], axis=0)
    rest = [*(operating_point[name] for name in inputs), *output_operating_point]
    fields: list[dict[str, Any]] = [
        {
            "name": name,
            "unit": selected[0].units[k],
            "description": (descriptions or {}).get(name, ""),
            "operating_point": float(rest[k]),
            "minimum": float(low[k]),
            "maximum": float(high[k]),
        }
        for k, name in enumerate(names)
    ]
    m = len(inputs)
    return tuple(InputSignal(**f) for f in fields[:m]), tuple(OutputSignal(**f) for f in fields[m:])


Signals = tuple[tuple[InputSignal, ...], tuple[OutputSignal, ...]]


def widened(
    signals: Signals, experiments: Sequence[DataSet], scheduling: str, limits: tuple[float, float]
) -> Signals:
    """Return signals whose limits take in further training data.

    Args:
        signals: Inputs and outputs.
        experiments: Further training data, in the same units.
        scheduling: The input whose limits grow up to `limits` only: beyond, weights are held.
        limits: Low and high end of the operating range.

    Raises:
        DataError: Columns are missing.
    """

    def wider(signal: AnySignal) -> AnySignal:
        columns = [data.column(signal.name) for data in experiments]
        low, high = min(float(one.min()) for one in columns), max(float(one.max()) for one in columns)
        if signal.name == scheduling:
            low, high = max(low, limits[0]), min(high, limits[1])
        update = {"minimum": min(signal.minimum, low), "maximum": max(signal.maximum, high)}
        return signal.model_copy(update=update)

    return tuple(map(wider, signals[0])), tuple(map(wider, signals[1]))


def assemble(
    name: str,
    models: Sequence[LocalModel],
    partition: Partition,
    settings: NetworkSettings,
    signals: tuple[tuple[InputSignal, ...], tuple[OutputSignal, ...]],
    static_map: StaticMap | None = None,
    derived_outputs: Sequence[DerivedOutput] = (),
    kind: Literal["n4sid", "surrogate", "linear"] = "n4sid",
    **rest: Any,
) -> ParameterSet:
    """Return the network of local models as a parameter set.

    Args:
        name: C identifier; the FMU's default model identifier.
        models: One per centre; for parameter blending in common state coordinates (`subspace.aligned`).
        partition: Scheduling input, range, centres and validity functions.
        settings: Blending and offsets.
        signals: Inputs and outputs in the order of the models' columns and rows.
        static_map: Outputs at rest; needed by the offsets "low_pass" and "scheduled_equilibrium".
        derived_outputs: Outputs computed from inputs and outputs.
        kind: Where the local models come from.
        rest: Further fields of the parameter set (surrogate, provenance, documentation, ...).

    Raises:
        IdentificationError: A static map is needed and missing.
        ParameterSetError: The parts do not make a valid parameter set; every problem is named.
    """
    common = settings.offsets == "affine" and settings.blending == "parameter"
    rests = rest_states(models) if common else [np.zeros(model.order) for model in models]
    parts = [
        _part(model, rest_state, partition.scheduling, settings.offsets)
        for model, rest_state in zip(models, rests, strict=True)
    ]
    return ParameterSet(
        name=name,
        kind=kind,
        sample_time=models[0].sample_time,
        inputs=signals[0],
        outputs=signals[1],
        partition=partition,
        blending="output" if settings.blending == "output" else "parameter",
        local_models=tuple(parts),
        node_table=_node_table(parts, partition, settings),
        offsets=_offsets(settings, static_map, models[0].outputs),
        derived_outputs=tuple(derived_outputs),
        **rest,
    )


def equilibrium_shift(model: LocalModel, scheduling: str) -> Array:
    """Return g = (I - A)^-1 B_scheduling: by this the scheduling input moves the state at rest, (n,)."""
    column = model.B[:, model.inputs.index(scheduling)]
    return np.asarray(np.linalg.solve(np.eye(model.order) - model.A, column))


def rest_states(models: Sequence[LocalModel]) -> list[Array]:
    """Return where each model's operating point lies in state coordinates that have one origin for all.

    The state at rest moves by S = (I - A)^-1 B per input; between two operating points the mean of their S
    counts. The first operating point is the origin.

    Args:
        models: Local models in common state coordinates, in the order of the scheduling input.
    """
    moves = [np.linalg.solve(np.eye(model.order) - model.A, model.B) for model in models]
    rests = [np.zeros(models[0].order)]
    for k, (left, right) in enumerate(pairwise(models)):
        step = right.input_operating_point - left.input_operating_point
        rests.append(rests[-1] + 0.5 * (moves[k] + moves[k + 1]) @ step)
    return rests


def _part(model: LocalModel, rest: Array, scheduling: str, offsets: str) -> LocalLinearModel:
    """Return a model as a parameter set holds it.

    Thesis eq. 3.33-3.34 read x+ = A (x - x_0) + B (u - u_0), y = C (x - x_0) + y_0, where x_0 is not the
    state at rest: for rest at x_s and y_op, x_0 = x_s - A^-1 x_s and y_0 = y_op - C A^-1 x_s.
    """
    affine = offsets == "affine"
    before = np.linalg.lstsq(model.A, rest)[0] if affine else rest
    return LocalLinearModel(
        A=nested(model.A),
        B=nested(model.B),
        C=nested(model.C),
        D=nested(model.D),
        g=nested(equilibrium_shift(model, scheduling)) if offsets == "scheduled_equilibrium" else None,
        x0=nested(rest - before) if affine else None,
        u0=nested(model.input_operating_point) if affine else None,
        y0=nested(model.output_operating_point - model.C @ before) if affine else None,
    )


def _offsets(settings: NetworkSettings, static_map: StaticMap | None, outputs: Sequence[str]) -> Offsets:
    if settings.offsets in ("none", "affine"):
        return Offsets(kind=settings.offsets)
    if static_map is None:
        mend = "Give one, or use the offsets 'affine' or 'none'"
        raise IdentificationError.of(f"offsets {settings.offsets!r}", "need a static map", mend)
    table = static_map.select(outputs).as_part()
    frequency = settings.corner_frequency if settings.offsets == "low_pass" else None
    return Offsets(kind=settings.offsets, corner_frequency=frequency, static_map=table)


def _node_table(
    parts: Sequence[LocalLinearModel], partition: Partition, settings: NetworkSettings
) -> NodeTable | None:
    """Compile weights into nodes; for parameter blending every entry is sum_i w_i entry_i there."""
    if partition.validity == "gaussian":
        return None
    positions = node_positions(partition, settings.nodes)
    shares = weights(partition, positions)
    models = () if settings.blending == "output" else as_parts(blended(stacked(parts), shares))
    return NodeTable(positions=nested(positions), weights=nested(shares), models=models)
