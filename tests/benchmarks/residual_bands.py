"""Whether error bands hold on data nobody saw. Run: python -m tests.benchmarks.residual_bands

The four networks that ship, F_p: the bands in their parameter sets; then bands from one validation record,
the first of the seed they were identified with, and from four, one of each of four seeds, as `llmn identify`
would make them; judged on test records of other seeds. The bands that ship and those from four records are
held to the limits, those from one record show why there are four.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence

import numpy as np

import fmus
from cosimulation.demo import generate_settings
from cosimulation.generate import make_data
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet, ResidualBands
from identification.arrays import Array
from identification.data_set import DataSet
from identification.residuals import SPECIFIED, Inside, counted_rows, inside, residual_bands, split

FORCE = "F_p"
LEAST, MOST = 0.90, 0.99
"""Share of errors inside a 95 % bound, by height over all records."""
AMPLITUDE, PHASE = 0.02, np.radians(1.0)
"""What amplitude (relative) and phase [rad] may be off in a band up to 15 Hz, on the records that judge."""
RECORDS = 4
"""Validation records of the second kind of bands: the shipped seed's and those of the next seeds."""
DRIVES = 1
"""The band of frequency, 1 to 5 Hz, whose swing the errors are compared with."""


def whole_range(wbm: str, seed: int) -> dict[str, DataSet]:
    """Whole-range records of the recipe by split; operating points, not needed here, are cut short."""
    recipe = generate_settings(fmus.path("wbm"), wbm, quick=False)
    experiments = tuple(
        item if item.kind == "whole_range" else item.model_copy(update={"duration": 0.1})
        for item in recipe.experiments
    )
    data = make_data(recipe.model_copy(update={"seed": seed, "experiments": experiments}))
    return {split: data.having("whole_range", split)[0].data for split in ("validation", "test")}


def judged(network: ParameterSet, bands: ResidualBands, records: Sequence[DataSet]) -> list[Inside]:
    """Share of errors inside the bounds, per record."""
    column = network.output_names.index(FORCE)
    found = []
    for data in records:
        model = simulate(network, data.matrix(network.input_names))[:, column]
        height = data.column(network.partition.scheduling)
        found.append(inside(bands, data.sample_time, height, data.column(FORCE), model))
    return found


def pooled(shares: Sequence[Inside]) -> tuple[Array, Array]:
    """Share over all records by height, [H], and by height and band, [H, F]."""
    weights = np.array([one.seconds for one in shares])
    weights /= weights.sum(axis=0)
    total = (np.array([one.total for one in shares]) * weights).sum(axis=0)
    return total, (np.array([one.bands for one in shares]) * weights[:, :, None]).sum(axis=0)


def told(label: str, good: bool, text: str) -> bool:
    print(f"  {label:<42}{text:<60}{'pass' if good else 'FAIL'}")
    return good


def listed(shares: Array) -> str:
    return "  ".join(f"{100.0 * share:5.1f}" for share in shares)


def coverage(network: ParameterSet, bands: ResidualBands, tests: Sequence[DataSet], label: str) -> bool:
    """Print the shares by height and by band; judge those by height."""
    shares = judged(network, bands, tests)
    total, parts = pooled(shares)
    singles = np.array([one.total for one in shares])
    good = bool(np.all((total >= LEAST) & (total <= MOST)))
    print(f"  {label}: bound by height [{FORCE}, N]  " + "  ".join(f"{bound:.4g}" for bound in bands.total))
    told(f"inside, % by height, {len(tests)} records", good, listed(total))
    print(f"  {'single records, lowest':<42}{listed(singles.min(axis=0))}")
    print(f"  {'single records, highest':<42}{listed(singles.max(axis=0))}")
    for column, (low, high) in enumerate(zip(bands.frequencies, bands.frequencies[1:], strict=False)):
        print(f"  {f'{low:g} to {high:g} Hz':<42}{listed(parts[:, column])}")
    return good


def answered(bands: ResidualBands) -> tuple[Array, Array]:
    """Amplitude and phase [rad] by height and band up to the specified frequency."""
    columns = [k for k, high in enumerate(bands.frequencies[1:]) if high <= SPECIFIED]
    amplitude, phase = (np.array(part, dtype=np.float64) for part in (bands.amplitude, bands.phase))
    return amplitude[:, columns], phase[:, columns]


def matched(network: ParameterSet, tests: Sequence[DataSet]) -> bool:
    """Judge amplitude and phase up to the specified frequency on the records nobody saw."""
    (bands,) = residual_bands(network, tests)
    amplitude, phase = answered(bands)
    text = f"{amplitude.min():.4f} to {amplitude.max():.4f}"
    good = told(f"amplitude up to {SPECIFIED:g} Hz", bool(np.abs(amplitude - 1.0).max() <= AMPLITUDE), text)
    text = f"{np.degrees(np.abs(phase).max()):.3f} degrees at most"
    return told(f"phase up to {SPECIFIED:g} Hz", bool(np.abs(phase).max() <= PHASE), text) and good


def swing(network: ParameterSet, bands: ResidualBands, tests: Sequence[DataSet]) -> None:
    """Print why single records differ: the rms error goes with the rms of the reference's slow swing."""
    errors, swings = [], []
    for data in tests:
        rows = counted_rows(len(data), data.sample_time)
        model = simulate(network, data.matrix(network.input_names))[:, network.output_names.index(FORCE)]
        slow = split(data.column(FORCE), bands.frequencies, data.sample_time)[rows, DRIVES]
        where = np.digitize(data.column(network.partition.scheduling)[rows], bands.positions) - 1
        error = (model - data.column(FORCE))[rows]
        heights = range(len(bands.total))
        errors.append([np.sqrt(np.mean(error[where == height] ** 2)) for height in heights])
        swings.append([np.sqrt(np.mean(slow[where == height] ** 2)) for height in heights])
    for name, values in (("rms error", np.array(errors)), ("rms of F_p from 1 to 5 Hz", np.array(swings))):
        scatter = values.std(axis=0) / values.mean(axis=0)
        print(f"  {name + ', scatter over records, %':<42}{listed(scatter)}")
    both = zip(np.log(errors).T, np.log(swings).T, strict=True)
    print(
        f"  {'correlation of the two':<42}" + "  ".join(f"{np.corrcoef(*pair)[0, 1]:5.2f}" for pair in both)
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=12, help="other seeds, one test record each")
    count = parser.parse_args().seeds
    begin, good = time.perf_counter(), True
    for wbm in dict.fromkeys(fmus.NETWORKS.values()):
        data = {seed: whole_range(wbm, seed) for seed in range(1, max(count, RECORDS) + 2)}
        tests = [data[seed]["test"] for seed in range(2, count + 2)]
        validation = [data[seed]["validation"] for seed in range(1, RECORDS + 1)]
        for name in (name for name, own in fmus.NETWORKS.items() if own == wbm):
            network = fmus.network(name)
            (shipped,) = (item for item in network.residual_bands if item.output == FORCE)
            (one,), (several,) = residual_bands(network, validation[:1]), residual_bands(network, validation)
            print(f"{name}, heights {'  '.join(f'{edge:g}' for edge in one.positions)} m")
            good &= coverage(network, shipped, tests, "bands that ship")
            amplitude = answered(shipped)[0]
            print(f"  {'amplitude in them':<42}{amplitude.min():.4f} to {amplitude.max():.4f}")
            coverage(network, one, tests, "bands from one record")
            good &= coverage(network, several, tests, f"bands from {RECORDS} records")
            good &= matched(network, tests)
            swing(network, one, tests)
    print(f"{time.perf_counter() - begin:.0f} s")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
