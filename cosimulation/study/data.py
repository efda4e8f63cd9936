"""Reference data of a study: one white-box set, one seed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, get_args

from cosimulation.data_folder import DataFolder
from cosimulation.generate import make_data
from cosimulation.settings import ExperimentSettings, GenerateSettings, Reference, Signals, Split
from identification.data_set import DataSet
from identification.excitation import with_measurement_noise
from identification.validity import equidistant_centres

RANGE = (0.5, 2.5)
"""Operating range of eta [m]."""

Noise = Literal["none", "1e-5 m, 1e-3 m/s", "1e-4 m, 1e-2 m/s"]
NOISES: dict[Noise, tuple[float, float]] = dict(
    zip(get_args(Noise), ((0.0, 0.0), (1e-5, 1e-3), (1e-4, 1e-2)), strict=True)
)
"""Measurement noise on training data by name, in order of size: standard deviation of positions [m] and of
velocities [m/s]."""

_NOISE_STREAM = 1000
_PANTOGRAPH = Signals()


def centres(count: int) -> list[float]:
    """Return the heights of `count` equidistant operating points [m]."""
    return [float(height) for height in equidistant_centres(count, *RANGE)]


def operating_points(
    heights: Sequence[float], split: Split, duration: float = 42.0
) -> tuple[ExperimentSettings, ...]:
    """Return one operating-point experiment per height."""
    return tuple(
        ExperimentSettings(
            name=f"op_{round(height * 1000):04d}_{split}",
            kind="operating_point",
            split=split,
            height=height,
            duration=duration,
        )
        for height in heights
    )


def whole_range(split: Split, duration: float = 120.0) -> ExperimentSettings:
    """Return a whole-range experiment."""
    return ExperimentSettings(name=f"wr_{split}", kind="whole_range", split=split, duration=duration)


def study_data(
    fmu: Path,
    wbm: str,
    seed: int,
    experiments: Sequence[ExperimentSettings],
    signals: Signals = _PANTOGRAPH,
) -> tuple[DataFolder, GenerateSettings]:
    """Drive the white-box FMU by the acceptance recipe; see `generate.make_data`."""
    settings = GenerateSettings(
        seed=seed,
        reference=Reference(fmu=fmu, start_values={"preset": wbm}),
        signals=signals,
        experiments=tuple(experiments),
    )
    return make_data(settings), settings


def noisy(data: DataSet, noise: Noise, seed: int, stream: int) -> DataSet:
    """Return training data with measurement noise by its name in `NOISES`; forces follow the positions.

    Args:
        data: Without noise.
        noise: A key of `NOISES`.
        seed: Of the run.
        stream: Different for every experiment of the run.
    """
    position, velocity = NOISES[noise]
    if position == velocity == 0.0:
        return data
    by_unit = {"m": position, "m/s": velocity}
    units = dict(zip(data.names, data.units, strict=True))
    deviations: dict[str, float] = {
        name: by_unit[units[name]] for name in ("xi", "xi_dot", "zeta", "zeta_dot") if name in data.names
    }
    return with_measurement_noise(data, deviations, seed, (_NOISE_STREAM, stream))
