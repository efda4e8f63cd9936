"""Whether the numbers of a parameter set can be divided by each other and stay in the range of doubles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fmu_builder.errors import Problem
from fmu_builder.parameter_set.components import Offsets, Partition

_SMALLEST, _LARGEST = 1e-100, 1e100  # extents; squares and their quotients are then far from both ends
_NARROWEST = 1e-12  # of the range; a Gaussian below it is a step for every practical purpose


def magnitude_problems(read: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield every extent and every spread that the kernel could not compute with.

    Args:
        read: Field name to value, None where it could not be read.
    """
    partition: Partition | None = read.get("partition")
    if partition is not None:
        yield from _extent(partition.range[0], partition.range[1], "partition.range")
        yield from _spreads(partition)
    offsets: Offsets | None = read.get("offsets")
    if offsets is not None and offsets.static_map is not None and offsets.static_map.positions:
        positions = offsets.static_map.positions
        yield from _extent(positions[0], positions[-1], "offsets.static_map.positions")


def _extent(low: float, high: float, place: str) -> Iterator[Problem]:
    if high > low and not _SMALLEST <= high - low <= _LARGEST:
        yield Problem(place, f"spans {high - low!r}", "Choose a unit in which it is of ordinary size")


def _spreads(partition: Partition) -> Iterator[Problem]:
    """Precisions 1 / sigma^2 and log-weights stay finite when no sigma is absurdly small."""
    low, high = partition.range
    middle = 0.5 * low + 0.5 * high
    pairs = zip(partition.centres, partition.spreads or (), strict=False)
    for index, (centre, spread) in enumerate(pairs):
        sigma = spread * (1.0 if partition.k_sigma is None else partition.k_sigma)
        reach = max(high - low, abs(centre - middle))
        if sigma >= 0.0 and not _NARROWEST * reach <= sigma:
            what = f"gives a standard deviation of {sigma!r}, nothing against the range"
            yield Problem(f"partition.spreads[{index}]", what, "Give about the distance of the centres")
