"""Resonances of step responses by the discrete Fourier transform, and what they have to be.

The figures are those a prototype of the same equations gave; set A is calibrated to thesis Table 2.1, so they
check the simulation, not the physics. Each row: minimum, maximum, mean, median over twenty steps, in Hz.
"""

from __future__ import annotations

import numpy as np

from fmus.wbm import PhysicalParameters, native, operating_point
from identification.resonances import amplitudes, highest_peak

SAMPLES = 16384
SAMPLE_TIME = 1e-3
BIN = 1.0 / (SAMPLES * SAMPLE_TIME)
HEIGHTS = 0.5 + 0.1 * np.arange(20)
STEP = 0.1
BANDS = {"f_L": (2.0, 6.0), "f_M": (8.0, 16.0), "f_H": (17.0, 29.0)}
SIGNALS = ("xi_dot", "zeta_dot", "F_H", "F_p")

EXPECTED: dict[str, dict[tuple[str, str], tuple[float, float, float, float]]] = {
    "A": {
        ("f_L", "xi_dot"): (3.113, 3.601, 3.214, 3.143),
        ("f_L", "zeta_dot"): (3.113, 3.601, 3.229, 3.174),
        ("f_L", "F_H"): (3.235, 3.662, 3.336, 3.296),
        ("f_L", "F_p"): (3.174, 3.662, 3.308, 3.235),
        ("f_M", "xi_dot"): (10.010, 13.184, 11.923, 12.115),
        ("f_M", "zeta_dot"): (10.071, 13.184, 11.957, 12.115),
        ("f_M", "F_H"): (10.071, 13.245, 11.969, 12.177),
        ("f_M", "F_p"): (10.071, 13.184, 11.957, 12.115),
        ("f_H", "xi_dot"): (20.691, 23.926, 22.400, 22.400),
        ("f_H", "zeta_dot"): (20.691, 23.621, 22.278, 22.308),
        ("f_H", "F_H"): (20.630, 23.682, 22.290, 22.308),
    },
    "A60": {
        ("f_L", "xi_dot"): (3.052, 3.601, 3.189, 3.113),
        ("f_L", "zeta_dot"): (3.113, 3.601, 3.214, 3.143),
        ("f_L", "F_H"): (3.235, 3.662, 3.329, 3.265),
        ("f_L", "F_p"): (3.174, 3.601, 3.290, 3.235),
        ("f_M", "xi_dot"): (10.010, 13.184, 11.920, 12.115),
        ("f_M", "zeta_dot"): (10.071, 13.245, 11.969, 12.146),
        ("f_M", "F_H"): (10.071, 13.245, 12.003, 12.177),
        ("f_M", "F_p"): (10.071, 13.245, 11.963, 12.115),
        ("f_H", "xi_dot"): (20.447, 23.926, 22.369, 22.430),
        ("f_H", "zeta_dot"): (20.386, 22.705, 21.793, 21.912),
        ("f_H", "F_H"): (20.203, 23.132, 21.964, 22.064),
    },
    "B": {
        ("f_L", "xi_dot"): (2.869, 3.357, 3.073, 3.052),
        ("f_L", "zeta_dot"): (2.991, 3.540, 3.214, 3.174),
        ("f_L", "F_H"): (3.052, 3.662, 3.278, 3.235),
        ("f_L", "F_p"): (3.052, 3.601, 3.250, 3.204),
        ("f_M", "zeta_dot"): (10.254, 13.977, 12.311, 12.390),
        ("f_H", "xi_dot"): (22.10, 22.52, 22.29, 22.28),
        ("f_H", "zeta_dot"): (21.67, 22.28, 21.95, 21.94),
        ("f_H", "F_H"): (22.03, 22.46, 22.23, 22.22),
    },
    "Blow": {
        ("f_L", "xi_dot"): (3.052, 3.601, 3.256, 3.235),
        ("f_L", "zeta_dot"): (3.113, 3.662, 3.317, 3.296),
        ("f_L", "F_H"): (3.113, 3.662, 3.323, 3.296),
        ("f_L", "F_p"): (3.113, 3.662, 3.320, 3.296),
        ("f_M", "xi_dot"): (10.071, 13.184, 11.880, 12.024),
        ("f_M", "zeta_dot"): (10.193, 13.367, 12.067, 12.238),
        ("f_M", "F_H"): (10.254, 13.550, 12.222, 12.390),
        ("f_M", "F_p"): (10.132, 13.245, 11.966, 12.115),
        ("f_H", "xi_dot"): (22.34, 22.40, 22.39, 22.40),
        ("f_H", "zeta_dot"): (22.34, 22.34, 22.34, 22.34),
        ("f_H", "F_H"): (22.34, 22.40, 22.38, 22.40),
    },
}
WITHOUT_PEAK = {("B", "f_M", "xi_dot"), ("B", "f_M", "F_H"), ("B", "f_M", "F_p")}
FOUND = {("A", "f_H", "F_p"), ("A60", "f_H", "F_p"), ("B", "f_H", "F_p"), ("Blow", "f_H", "F_p")}


def step_resonances(parameters: PhysicalParameters) -> dict[tuple[str, str], list[float]]:
    """The peaks found in steps from 0.5, 0.6, ... 2.4 m, by (band, signal)."""
    torque = operating_point()["M_pa"]
    found: dict[tuple[str, str], list[float]] = {
        (band, name): [] for band in BANDS for name in native.OUTPUTS
    }
    for height in HEIGHTS:
        start = native.equilibrium(parameters, (height, torque))
        path = native.simulate(
            parameters, np.tile((height + STEP, torque), (SAMPLES, 1)), SAMPLE_TIME, state=start
        )
        for band, limits in BANDS.items():
            for name in (*SIGNALS, "xi", "zeta"):
                spectrum = amplitudes(path[:, native.OUTPUTS.index(name)])
                frequency = highest_peak(spectrum, BIN, limits)
                if frequency is not None:
                    found[band, name].append(frequency)
    return found


def statistics(frequencies: list[float]) -> tuple[float, float, float, float]:
    """Minimum, maximum, mean and median."""
    values = np.array(frequencies)
    return float(values.min()), float(values.max()), float(values.mean()), float(np.median(values))
