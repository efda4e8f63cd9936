"""Whether the parts of a parameter set fit each other: shapes, order, names, stability."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from fmu_builder.errors import Problem
from fmu_builder.parameter_set.components import (
    DerivedOutput,
    InputSignal,
    LocalLinearModel,
    NodeTable,
    Offsets,
    OutputSignal,
    Partition,
    StaticMap,
)
from fmu_builder.parameter_set.evidence import evidence_problems
from fmu_builder.parameter_set.magnitudes import magnitude_problems

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_LONGEST_NAME = 55  # the strictest importer's limit
_WEIGHT_SUM = 1e-9  # rows of a node table are sums of a few rounded numbers


@dataclass(frozen=True)
class Parts:
    """The fields that could be read; a missing field, and an unreadable item of a list, is None."""

    read: Mapping[str, Any]

    def list_of(self, name: str) -> Sequence[Any]:
        """Return a list field, empty when it could not be read."""
        return self.read.get(name) or ()

    def names_of(self, name: str) -> list[str]:
        """Return the names of the readable signals in a list field."""
        return [signal.name for signal in self.list_of(name) if signal is not None]

    def count(self, name: str) -> int | None:
        """Return the length of a list field, None when it could not be read."""
        items = self.read.get(name)
        return None if items is None else len(items)

    @property
    def states(self) -> int | None:
        """Number of states: of the first readable local model."""
        return next((len(model.A) for model in self.list_of("local_models") if model is not None), None)


def consistency_problems(parts: Parts) -> list[Problem]:
    """Return everything that does not fit, as far as the readable parts can tell."""
    return [
        *_general(parts),
        *_names(parts),
        *_limits(parts),
        *_partition(parts),
        *_local_models(parts),
        *_node_table(parts),
        *_offsets(parts),
        *_derived_outputs(parts),
        *_evidence(parts),
        *magnitude_problems(parts.read),
    ]


def _general(parts: Parts) -> Iterator[Problem]:
    sample_time = parts.read.get("sample_time")
    if sample_time is not None and sample_time <= 0.0:
        yield Problem("sample_time", f"is {sample_time!r} s", "Give a positive time")
    for name in ("inputs", "outputs", "local_models"):
        if parts.count(name) == 0:
            yield Problem(name, "is empty", "Give at least one")


def _names(parts: Parts) -> Iterator[Problem]:
    name = parts.read.get("name")
    if name is not None:
        yield from _identifier(name, "name")
    taken = dict.fromkeys(("in_range", "out_of_range", "outside_certificate"), "the network itself")
    for number in range(1, (parts.count("local_models") or 0) + 1):
        taken[f"validity_{number}"] = "the network itself"
    for field in ("inputs", "outputs", "derived_outputs"):
        for index, signal in enumerate(parts.list_of(field)):
            if signal is None:
                continue
            place = f"{field}[{index}].name"
            yield from _identifier(signal.name, place)
            if signal.name in taken:
                what = f"{signal.name!r} is already the name of {taken[signal.name]}"
                yield Problem(place, what, "Give every variable its own name")
            taken[signal.name] = f"{field}[{index}]"


def _identifier(name: str, place: str) -> Iterator[Problem]:
    if not _IDENTIFIER.match(name) or len(name) > _LONGEST_NAME:
        mend = f"Use letters, digits and underscores, no digit first, at most {_LONGEST_NAME}"
        yield Problem(place, f"{name!r} is not a portable variable name", mend)


def _limits(parts: Parts) -> Iterator[Problem]:
    for field in ("inputs", "outputs"):
        signal: InputSignal | OutputSignal | None
        for index, signal in enumerate(parts.list_of(field)):
            if signal is None:
                continue
            low, point, high = signal.minimum, signal.operating_point, signal.maximum
            if low > high:
                yield Problem(f"{field}[{index}]", f"minimum {low!r} > maximum {high!r}", "Swap them")
            elif field == "inputs" and (point < low or point > high):
                what = f"{point!r} lies outside [{low!r}, {high!r}]"
                yield Problem(f"{field}[{index}].operating_point", what, "Put it inside the limits")


def _partition(parts: Parts) -> Iterator[Problem]:
    partition: Partition | None = parts.read.get("partition")
    if partition is None:
        return
    names = parts.names_of("inputs")
    if names and partition.scheduling not in names and None not in parts.list_of("inputs"):
        what = f"{partition.scheduling!r} is not an input"
        yield Problem("partition.scheduling", what, f"Name one of {', '.join(names)}")
    if partition.range[0] >= partition.range[1]:
        yield Problem("partition.range", f"{list(partition.range)} is not ascending", "Give [low, high]")
    count = parts.count("local_models")
    yield from _length(partition.centres, count, "partition.centres", "local model")
    yield from _ascending(partition.centres, "partition.centres")
    gaussian = partition.validity == "gaussian"
    for name in ("spreads", "k_sigma"):
        if (getattr(partition, name) is None) == gaussian:
            what = "is missing" if gaussian else f"does not belong to validity {partition.validity!r}"
            yield Problem(f"partition.{name}", what, "Give it for Gaussians, and only for them")
    if partition.spreads is not None:
        yield from _length(partition.spreads, count, "partition.spreads", "local model")
        for index, spread in enumerate(partition.spreads):
            if spread <= 0.0:
                yield Problem(f"partition.spreads[{index}]", f"is {spread!r}", "Give a positive spread")
    if partition.k_sigma is not None and partition.k_sigma <= 0.0:
        yield Problem("partition.k_sigma", f"is {partition.k_sigma!r}", "Give a positive factor")
    yield from _warp(partition)
    yield from _deviation(partition, parts)


def _warp(partition: Partition) -> Iterator[Problem]:
    """The warp belongs to its validity, and the warped variable rises."""
    wanted = partition.validity == "cubic_warp"
    if (partition.warp is None) == wanted:
        what = "is missing" if wanted else f"does not belong to validity {partition.validity!r}"
        yield Problem("partition.warp", what, "Give it for 'cubic_warp', and only for it")
    if partition.warp is None:
        return
    if not warp_rises(partition.warp, 0.5 * (partition.range[1] - partition.range[0])):
        what = f"{list(partition.warp)} makes the warped variable fall within the range"
        yield Problem("partition.warp", what, "Give smaller numbers")


def warp_rises(warp: tuple[float, float], reach: float) -> bool:
    """Return whether e + v0 (e - e_mid)^2 + v1 (e - e_mid)^3 rises from e_mid - reach to e_mid + reach."""
    quadratic, cubic = warp
    turning = -quadratic / (3.0 * cubic) if cubic != 0.0 else reach
    places = (-reach, reach, min(max(turning, -reach), reach))
    return all(1.0 + 2.0 * quadratic * d + 3.0 * cubic * d * d > 0.0 for d in places)


def _deviation(partition: Partition, parts: Parts) -> Iterator[Problem]:
    """A deviation in the schedule needs an output, a node table of models and a scheduled equilibrium."""
    output, gain = partition.deviation_output, partition.deviation_gain
    names = parts.names_of("outputs")
    if output is not None and names and output not in names and None not in parts.list_of("outputs"):
        yield Problem("partition.deviation_output", f"{output!r} is not an output", f"Name one of {names}")
    if gain == 0.0:
        return
    if output is None:
        what = f"is {gain!r}, but no output is named"
        yield Problem("partition.deviation_gain", what, "Name the output in deviation_output, or give 0")
    offsets: Offsets | None = parts.read.get("offsets")
    equilibrium = offsets is None or offsets.kind == "scheduled_equilibrium"
    if not equilibrium or partition.validity == "gaussian" or parts.read.get("blending") == "output":
        what = f"is {gain!r}: only parameters of a node table about a scheduled equilibrium know deviations"
        yield Problem("partition.deviation_gain", what, "Give 0, or change blending, validity or offsets")


def _local_models(parts: Parts) -> Iterator[Problem]:
    declared = bool(parts.read.get("declared_unstable"))
    for index, model in enumerate(parts.list_of("local_models")):
        if model is None:
            continue
        place = f"local_models[{index}]"
        yield from _one_model(model, place, parts)
        radius = _spectral_radius(model)
        if radius is not None and radius >= 1.0 and not declared:
            what = f"is unstable: spectral radius {radius:.6g}"
            yield Problem(f"{place}.A", what, "Identify a stable model, or set declared_unstable")


def _one_model(model: LocalLinearModel, place: str, parts: Parts) -> Iterator[Problem]:
    """Shapes, and which of the offset vectors the offset handling wants."""
    states, inputs, outputs = parts.states, parts.count("inputs"), parts.count("outputs")
    if states == 0:
        yield Problem(f"{place}.A", "is empty", "Give at least one state")
    for name, rows, columns in (
        ("A", states, states),
        ("B", states, inputs),
        ("C", outputs, states),
        ("D", outputs, inputs),
    ):
        yield from _shape(getattr(model, name), rows, columns, f"{place}.{name}")
    offsets: Offsets | None = parts.read.get("offsets")
    if offsets is None:
        return
    for name, length, owner in (
        ("g", states, "scheduled_equilibrium"),
        ("x0", states, "affine"),
        ("u0", inputs, "affine"),
        ("y0", outputs, "affine"),
    ):
        vector, wanted = getattr(model, name), offsets.kind == owner
        if (vector is None) == wanted:
            what = "is missing" if wanted else f"does not belong to offsets {offsets.kind!r}"
            yield Problem(f"{place}.{name}", what, f"Give it with offsets {owner!r}, and only with them")
        elif vector is not None:
            yield from _length(vector, length, f"{place}.{name}", "row")
    yield from _feedthrough(model, place, parts, offsets)


def _feedthrough(model: LocalLinearModel, place: str, parts: Parts, offsets: Offsets) -> Iterator[Problem]:
    partition: Partition | None = parts.read.get("partition")
    names = [None if signal is None else signal.name for signal in parts.list_of("inputs")]
    if partition is None or offsets.kind != "scheduled_equilibrium" or partition.scheduling not in names:
        return
    column = names.index(partition.scheduling)
    if any(column < len(row) and row[column] != 0.0 for row in model.D):
        what = "the scheduling input acts on an output at once, which a scheduled equilibrium cannot express"
        yield Problem(
            f"{place}.D", what, "Set its column to zero; a direct effect belongs into a derived output"
        )


def _spectral_radius(model: LocalLinearModel) -> float | None:
    """Return max |eigenvalue of A|, None when A is not a square matrix of finite numbers."""
    rows = model.A
    if not rows or any(len(row) != len(rows) for row in rows):
        return None
    matrix = np.array(rows)
    return float(np.abs(np.linalg.eigvals(matrix)).max()) if np.isfinite(matrix).all() else None


def _node_table(parts: Parts) -> Iterator[Problem]:
    partition: Partition | None = parts.read.get("partition")
    table: NodeTable | None = parts.read.get("node_table")
    blending = parts.read.get("blending")
    if partition is None or "node_table" not in parts.read:
        return
    gaussian = partition.validity == "gaussian"
    if gaussian and blending == "theta":
        yield Problem(
            "blending", "theta blending runs from a node table", "Use another validity than Gaussians"
        )
    if (table is None) != gaussian:
        what = (
            "does not belong to Gaussians" if gaussian else f"is missing for validity {partition.validity!r}"
        )
        yield Problem("node_table", what, "Give it for every validity but the Gaussian, and only then")
    if table is None:
        return
    place = "node_table.positions"
    yield from _ascending(table.positions, place)
    if len(table.positions) < 2:
        yield Problem(place, "has fewer than two nodes", "Give at least the two ends of the range")
    elif (table.positions[0], table.positions[-1]) != partition.range:
        what = f"reaches from {table.positions[0]!r} to {table.positions[-1]!r}, not over the range"
        yield Problem(
            place, what, f"Let it begin at {partition.range[0]!r} and end at {partition.range[1]!r}"
        )
    nodes = len(table.positions)
    yield from _shape(table.weights, nodes, parts.count("local_models"), "node_table.weights")
    for index, row in enumerate(table.weights):
        if abs(sum(row) - 1.0) > _WEIGHT_SUM:
            yield Problem(f"node_table.weights[{index}]", f"sums to {sum(row)!r}", "Weights sum to 1")
    wanted = 0 if blending == "output" else nodes
    if blending is not None and len(table.models) != wanted:
        what = f"holds {len(table.models)} models, {wanted} are needed for {blending} blending"
        yield Problem("node_table.models", what, "Give one per node, or none for output blending")
    for index, model in enumerate(table.models):
        yield from _one_model(model, f"node_table.models[{index}]", parts)


def _offsets(parts: Parts) -> Iterator[Problem]:
    offsets: Offsets | None = parts.read.get("offsets")
    if offsets is None:
        return
    low_pass = offsets.kind == "low_pass"
    mapped = offsets.kind in ("low_pass", "scheduled_equilibrium")
    for name, wanted in (("corner_frequency", low_pass), ("static_map", mapped)):
        if (getattr(offsets, name) is None) == wanted:
            what = "is missing" if wanted else "does not belong here"
            yield Problem(f"offsets.{name}", f"{what} with kind {offsets.kind!r}", "Add or remove it")
    if offsets.corner_frequency is not None and offsets.corner_frequency <= 0.0:
        what = f"is {offsets.corner_frequency!r} Hz"
        yield Problem("offsets.corner_frequency", what, "Give a positive frequency")
    table: StaticMap | None = offsets.static_map
    if table is None:
        return
    place = "offsets.static_map"
    if len(table.positions) < 2:
        yield Problem(f"{place}.positions", "has fewer than two points", "Give at least two")
    yield from _ascending(table.positions, f"{place}.positions")
    yield from _shape(table.values, len(table.positions), parts.count("outputs"), f"{place}.values")


def _derived_outputs(parts: Parts) -> Iterator[Problem]:
    signals = {*parts.names_of("inputs"), *parts.names_of("outputs")}
    complete = None not in (*parts.list_of("inputs"), *parts.list_of("outputs"))
    derived: DerivedOutput | None
    for index, derived in enumerate(parts.list_of("derived_outputs")):
        if derived is None:
            continue
        place = f"derived_outputs[{index}]"
        if not derived.terms:
            yield Problem(f"{place}.terms", "is empty", "Give at least one term")
        for number, term in enumerate(derived.terms):
            if complete and signals and term.signal not in signals:
                what = f"{term.signal!r} is neither an input nor an output"
                yield Problem(f"{place}.terms[{number}].signal", what, "Name an input or an output")
            if term.parameter not in derived.parameters:
                what = f"{term.parameter!r} is not among the parameters of {derived.name!r}"
                yield Problem(f"{place}.terms[{number}].parameter", what, "Define it there")


def _evidence(parts: Parts) -> Iterator[Problem]:
    def names(name: str) -> list[str] | None:
        items = parts.read.get(name)
        return None if items is None or None in items else parts.names_of(name)

    yield from evidence_problems(
        parts.read.get("trained_region"),
        parts.list_of("residual_bands"),
        names("inputs"),
        names("outputs"),
        names("derived_outputs"),
    )


def _length(vector: Sequence[float], wanted: int | None, place: str, per: str) -> Iterator[Problem]:
    if wanted is not None and len(vector) != wanted:
        yield Problem(place, f"has {len(vector)} entries, not {wanted}", f"Give one per {per}")


def _shape(
    matrix: Sequence[Sequence[float]], rows: int | None, columns: int | None, place: str
) -> Iterator[Problem]:
    widths = sorted({len(row) for row in matrix})
    wrong_rows = rows is not None and len(matrix) != rows
    wrong_columns = columns is not None and len(matrix) > 0 and widths != [columns]
    if wrong_rows or wrong_columns:
        found = f"{len(matrix)} x {' or '.join(map(str, widths)) or '0'}"
        wanted = f"{'any' if rows is None else rows} x {'any' if columns is None else columns}"
        yield Problem(place, f"is {found}, not {wanted}", "Give a matrix of that shape")


def _ascending(positions: Iterable[float], place: str) -> Iterator[Problem]:
    for index, (left, right) in enumerate(pairwise(positions), start=1):
        if right <= left:
            yield Problem(f"{place}[{index}]", f"{right!r} does not exceed {left!r}", "Give ascending values")
