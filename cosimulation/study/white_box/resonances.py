"""Resonances of step responses over the operating range: Table 2.1 and the surfaces of Figures 2.5 to 2.7."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosimulation.fmu_driver import running_fmu
from cosimulation.fmu_file import OpenFmu
from cosimulation.pantograph import INPUTS, SIGNALS, TORQUE
from cosimulation.study.white_box.settings import BANDS, StepSettings
from cosimulation.study.white_box.table_2_1 import POSITIONS, STATISTICS, TABLE
from identification.arrays import Array
from identification.excitation import ACCEPTANCE
from identification.resonances import amplitudes, highest_peak, spread

Record = dict[str, Any]
HIGHEST = 30.0
"""The surfaces end here [Hz]."""
AWAY, FOUND, EXTRA = "away from Table 2.1", "resonance", "peaks where the thesis has none"


@dataclass(frozen=True, eq=False)
class StepResonances:
    """What the steps of one white-box set show.

    Attributes:
        heights: That the steps start from, (steps,) [m].
        peaks: By resonance and signal: its frequency in every step, NaN where there is none, (steps,) [Hz].
        frequencies: Of the surfaces, up to `HIGHEST`, (bins,) [Hz].
        surfaces: By signal: |DFT| over the highest entry of its row without the mean, (steps, bins).
    """

    heights: Array
    peaks: dict[tuple[str, str], Array]
    frequencies: Array
    surfaces: dict[str, Array]


def step_resonances(fmu: OpenFmu, wbm: str, settings: StepSettings) -> StepResonances:
    """Step the contact height from rest at every start height and transform what the outputs do.

    Every record begins with the step: no window, mean not removed; in each of `BANDS` the highest peak of
    enough prominence counts.

    Raises:
        FmuError: The FMU has not these signals or refuses a height.
    """
    sample_time = ACCEPTANCE.sample_time
    bin_width = 1.0 / (settings.samples * sample_time)
    heights: Array = settings.first + settings.step * np.arange(settings.count, dtype=np.float64)
    frequencies: Array = bin_width * np.arange(int(HIGHEST / bin_width) + 1, dtype=np.float64)
    peaks = {(band, name): np.full(heights.size, np.nan) for band in BANDS for name in SIGNALS}
    surfaces = {name: np.zeros((heights.size, frequencies.size)) for name in SIGNALS}
    for row, height in enumerate(heights):
        inputs = np.tile((height + settings.step, TORQUE), (settings.samples + 1, 1))
        inputs[0, 0] = height  # the FMU comes to rest at the first row, which is no part of the record
        with running_fmu(fmu, f"step_{row}") as instance:
            outputs = instance.run(inputs, INPUTS, SIGNALS, sample_time, {"preset": wbm})[1:]
        for name, values in zip(SIGNALS, outputs.T, strict=True):
            spectrum = amplitudes(values)
            shown = spectrum[: frequencies.size]
            surfaces[name][row, : shown.size] = shown / max(shown[1:].max(initial=0.0), np.finfo(float).tiny)
            for band, limits in BANDS.items():
                found = highest_peak(spectrum, bin_width, limits)
                peaks[band, name][row] = np.nan if found is None else found
    return StepResonances(heights, peaks, frequencies, surfaces)


def resonance_records(found: StepResonances, labels: Record) -> Iterator[Record]:
    """Yield what stands in Table 2.1 with the thesis's figure, how far away it is, and peaks it has not."""
    for (band, signal), published in TABLE.items():
        seen = _seen(found, band, signal)
        statistics = spread(seen)
        place = {**labels, "band": band, "signal": signal, "unit": "Hz"}
        for index, statistic in enumerate(STATISTICS):
            ours = None if statistics is None else getattr(statistics, statistic)
            theirs = None if published is None else published[index]
            cell = {**place, "statistic": statistic, "thesis": theirs, "steps": len(seen)}
            yield {"measure": FOUND, **cell, "value": ours}
            if theirs is not None and statistic != "mode":  # which of many values comes twice is chance
                away = None if ours is None else abs(ours - theirs)
                yield {"measure": AWAY, **cell, "value": away}
    without = [(band, name) for (band, name), row in TABLE.items() if row is None]
    without += [(band, name) for band in BANDS for name in POSITIONS]
    for band, name in without:
        place = {**labels, "band": band, "signal": name, "unit": "steps"}
        yield {"measure": EXTRA, **place, "kind": _kind(name), "value": len(_seen(found, band, name))}


def _kind(signal: str) -> str:
    return "position" if signal in POSITIONS else "force"


def _seen(found: StepResonances, band: str, signal: str) -> list[float]:
    values = found.peaks[band, signal]
    return [float(value) for value in values[np.isfinite(values)]]
