"""What must agree between a model and the evidence that comes with it: trained region, residual bands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from fmu_builder.errors import Problem

Names = Sequence[str] | None
LOWEST_BAND_EDGE = 0.01
"""Between bands of frequency [Hz]; far below it low-passes cannot be computed in double precision."""


def evidence_problems(
    region: Any, bands: Sequence[Any], inputs: Names, outputs: Names, derived: Names
) -> Iterator[Problem]:
    """Yield everything that does not fit.

    Args:
        region: A `TrainedRegion`, or None.
        bands: `ResidualBands`; None where one is unreadable.
        inputs: Names of the inputs; None where they cannot all be read.
        outputs: The same of the outputs.
        derived: The same of the derived outputs.
    """
    if region is not None:
        yield from _region(region, inputs, derived)
    named: list[str] = []
    for index, one in enumerate(bands):
        if one is not None:
            known = None if outputs is None or derived is None else [*outputs, *derived]
            yield from _bands(one, f"residual_bands[{index}]", known, named)
            named.append(one.output)


def _region(region: Any, inputs: Names, derived: Names) -> Iterator[Problem]:
    if region.rate < 0.0:
        yield Problem(
            "trained_region.rate", f"{region.rate!r} is negative", "Give the largest rate, 0 or more"
        )
    yield from _spans(region.derived_outputs, "trained_region.derived_outputs", derived, "a derived output")
    yield from _spans(region.frequency_bands, "trained_region.frequency_bands", inputs, "an input")
    for name, (low, _) in region.frequency_bands.items():
        if low < 0.0:
            place = f"trained_region.frequency_bands[{name!r}]"
            yield Problem(place, f"begins at {low!r} Hz", "Give frequencies of 0 Hz or more")


def _spans(
    spans: Mapping[str, tuple[float, float]], place: str, names: Names, what: str
) -> Iterator[Problem]:
    for name, (low, high) in spans.items():
        if names is not None and name not in names:
            mend = f"Choose of {', '.join(names)}" if names else "Leave it out"
            yield Problem(f"{place}[{name!r}]", f"is not {what}", mend)
        if high < low:
            yield Problem(f"{place}[{name!r}]", f"{high!r} is below {low!r}", "Give the smaller one first")


def _bands(one: Any, place: str, outputs: Names, named: Sequence[str]) -> Iterator[Problem]:
    if outputs is not None and one.output not in outputs:
        yield Problem(f"{place}.output", f"there is no {one.output!r}", f"Choose of {', '.join(outputs)}")
    if one.output in named:
        yield Problem(f"{place}.output", f"{one.output!r} is there twice", "Leave one out")
    for name in ("positions", "frequencies"):
        edges = getattr(one, name)
        if len(edges) < 2:
            yield Problem(f"{place}.{name}", f"has {len(edges)} edges", "Give at least two")
        for index, (left, right) in enumerate(pairwise(edges), start=1):
            if right <= left:
                yield Problem(f"{place}.{name}[{index}]", f"{right!r} does not exceed {left!r}", "Sort them")
    if one.frequencies and one.frequencies[0] < 0.0:
        yield Problem(
            f"{place}.frequencies[0]", f"{one.frequencies[0]!r} is negative", "Begin at 0 Hz or above"
        )
    for index, edge in enumerate(one.frequencies[1:-1], start=1):
        if 0.0 < edge < LOWEST_BAND_EDGE:
            mend = f"Give edges of {LOWEST_BAND_EDGE:g} Hz or more"
            yield Problem(f"{place}.frequencies[{index}]", f"{edge!r} is too low to tell bands apart", mend)
    if not 0.0 < one.coverage < 1.0:
        yield Problem(f"{place}.coverage", f"{one.coverage!r} is no share", "Give a number between 0 and 1")
    yield from _sizes(one, place)


def _sizes(one: Any, place: str) -> Iterator[Problem]:
    heights, bands = len(one.positions) - 1, len(one.frequencies) - 1
    for name in ("total", "seconds"):
        if len(found := getattr(one, name)) != heights:
            yield Problem(f"{place}.{name}", f"has {len(found)} entries, not {heights}", "Give one per range")
    for name in ("rms", "bound", "amplitude", "phase"):
        rows = getattr(one, name)
        if len(rows) != heights or any(len(row) != bands for row in rows):
            yield Problem(
                f"{place}.{name}", f"is not {heights} x {bands}", "Give a row per range, a column per band"
            )
    for name, entries in (
        *((name, [x for row in getattr(one, name) for x in row]) for name in ("rms", "bound", "amplitude")),
        ("total", one.total),
        ("seconds", one.seconds),
    ):
        if any(value is not None and value < 0.0 for value in entries):
            yield Problem(f"{place}.{name}", "holds a negative number", "Give sizes")
