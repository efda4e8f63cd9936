"""The height of records nobody tells the height of, from modes identified in them (thesis 2.1.3)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from cosimulation.pantograph import OUTPUTS
from cosimulation.report.modes import mode_name
from cosimulation.study.data import noisy
from cosimulation.study.white_box.settings import HeightSettings, Route
from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import random_stream
from identification.height import HeightEstimate, ModeTable, height_from_modes
from identification.subspace import estimate

Record = dict[str, Any]
ERROR, CURVE = "height error", "height deviation"
_HEIGHT_STREAM = 2000


def drawn_heights(settings: HeightSettings, seed: int) -> list[float]:
    """Return one height in every stratum of the range, drawn anew for every seed [m]."""
    edges = np.linspace(settings.low, settings.high, settings.count + 1)
    share = random_stream(seed, _HEIGHT_STREAM).uniform(size=settings.count)
    return [float(height) for height in edges[:-1] + share * np.diff(edges)]


def identified_modes(data: DataSet, route: Route, table: ModeTable) -> Array:
    """Return the frequencies of a record's modes, NaN for those that were not found, (modes,) [Hz].

    The record's mean, which would tell the height at once, is removed by the estimator.
    """
    try:
        model = estimate([data], route.inputs, OUTPUTS, route.subspace)
    except IdentificationError:
        return np.full(table.modes, np.nan)
    return table.named(model.poles, model.sample_time)


def height_records(
    experiments: Sequence[tuple[float, DataSet]],
    table: ModeTable,
    settings: HeightSettings,
    labels: Record,
) -> Iterator[Record]:
    """Yield the error of the height for every record, length, noise and route to the modes.

    Args:
        experiments: True heights [m] and their records, of the longest duration.
        table: Modes over the height, from linearisations.
        settings: Of the study.
        labels: Of every record; `seed` draws the noise.
    """
    for stream, (height, data) in enumerate(experiments):
        for noise in settings.noises:
            measured = noisy(data, noise, labels["seed"], stream)
            for route, duration in itertools.product(settings.routes, settings.durations):
                rows = round(duration / data.sample_time)
                found = identified_modes(measured.rows(0, rows), route, table)
                for chosen in _subsets(table.modes, every=duration == max(settings.durations)):
                    modes = ", ".join(mode_name(index, table.modes) for index in chosen)
                    place = {"noise": noise, "route": route.name, "duration": duration, "modes": modes}
                    yield {
                        "measure": ERROR,
                        **labels,
                        **place,
                        **_compared(table, found, chosen, height, duration),
                    }


def _subsets(modes: int, every: bool) -> list[tuple[int, ...]]:
    """Return which modes are used together: all of them, or every choice."""
    sizes = range(1, modes + 1) if every else (modes,)
    return [chosen for size in sizes for chosen in itertools.combinations(range(modes), size)]


def _compared(
    table: ModeTable, frequencies: Array, chosen: Sequence[int], height: float, duration: float
) -> Record:
    """Return estimate and error from some of the modes; None where none of them was found."""
    used = np.full(table.modes, np.nan)
    used[list(chosen)] = frequencies[list(chosen)]
    found: HeightEstimate | None = None
    if np.isfinite(used).any():
        found = height_from_modes(table, used, duration)
    known = found is not None and np.isfinite(found.deviation)
    return {
        "height": height,
        "estimate": None if found is None else found.height,
        "value": None if found is None else abs(found.height - height),
        "foretold": found.deviation if found is not None and known else None,
        "others": None if found is None else len(found.others),
        "missing": int(np.isnan(frequencies[list(chosen)]).sum()),
        "unit": "m",
    }


def deviation_curve(table: ModeTable, settings: HeightSettings, labels: Record) -> Record:
    """Return the standard deviation of the height to expect over the height, by mode and together."""
    heights = np.linspace(table.heights[0], table.heights[-1], 161)
    duration = max(settings.durations)
    names = [mode_name(index, table.modes) for index in range(table.modes)]
    each = np.eye(table.modes, dtype=np.bool_)
    curves = {
        name: table.height_deviations(heights, duration, used).tolist()
        for name, used in zip(names, each, strict=True)
    }
    curves[", ".join(names)] = table.height_deviations(heights, duration).tolist()
    finite = {
        name: [value if np.isfinite(value) else None for value in curve] for name, curve in curves.items()
    }
    return {
        "information": CURVE, **labels, "duration": duration, "heights": heights.tolist(), "curves": finite,
    }  # fmt: skip
