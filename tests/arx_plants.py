"""Networks of ARX models with known coefficients, simulated by a plain loop, and inputs for them."""

from __future__ import annotations

import math

import numpy as np

from identification.arrays import Array
from identification.data_set import DataSet
from identification.lolimot import ArxNetwork, LolimotSettings
from identification.lolimot.regression import Orders
from identification.lolimot.tree import Cells

INPUTS = ("eta", "M_pa")
SAMPLE_TIME = 0.01
POINT = (1.3, 900.0)
OUTPUT_POINT = 0.4
COEFFICIENTS = (
    # y(k-1), y(k-2), y(k-3); eta(k-1), eta(k-2); M_pa(k-1), M_pa(k-2); 1
    (1.2, -0.5, 0.05, 0.3, -0.1, 1e-4, 2e-4, 0.011),
    (0.9, -0.3, -0.02, -0.2, 0.25, 3e-4, -1e-4, -0.023),
    (0.4, 0.2, -0.1, 0.15, 0.05, -2e-4, 1e-4, 0.007),
)
"""Three local models with three past outputs and two past values of either input; all stable."""
CENTRES = (0.75, 1.25, 2.0)
WIDTHS = (0.5, 0.5, 1.0)
"""Cells of [0.5, 2.5]: the upper half stays whole, the lower one is halved."""
K_SIGMA = 0.3
SETTINGS = LolimotSettings(past_outputs=3, past_inputs=2, most_models=3, k_sigma=K_SIGMA)


def drawn_inputs(seed: int, rows: int, low: float = 0.45, high: float = 2.55) -> Array:
    """Rough inputs that go through the whole range, and a little beyond it."""
    stream = np.random.default_rng(seed)
    path = 0.5 * (low + high) + 0.45 * (high - low) * np.sin(np.linspace(0.0, 23.0, rows))
    eta = np.clip(path + 0.1 * stream.standard_normal(rows), low, high)
    return np.column_stack([eta, POINT[1] + 40.0 * stream.standard_normal(rows)])


def validities(z: float) -> list[float]:
    """Normalised Gaussians over the cells, one number at a time (thesis eq. 3.10-3.11)."""
    inside = min(max(z, 0.5), 2.5)
    bells = [
        math.exp(-0.5 * ((inside - centre) / (K_SIGMA * width)) ** 2)
        for centre, width in zip(CENTRES, WIDTHS, strict=True)
    ]
    return [bell / sum(bells) for bell in bells]


def run(inputs: Array, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """The difference equation in a plain loop; the first three outputs are given, as deviations."""
    u = [[float(eta) - POINT[0], float(torque) - POINT[1]] for eta, torque in inputs]
    y = list(start)
    for k in range(3, len(inputs)):
        total = 0.0
        for share, c in zip(validities(float(inputs[k - 1, 0])), COEFFICIENTS, strict=True):
            past = c[0] * y[k - 1] + c[1] * y[k - 2] + c[2] * y[k - 3]
            driven = c[3] * u[k - 1][0] + c[4] * u[k - 2][0] + c[5] * u[k - 1][1] + c[6] * u[k - 2][1]
            total += share * (past + driven + c[7])
        y.append(total)
    return OUTPUT_POINT + np.array(y)


def data_set(inputs: Array, output: Array, name: str = "train") -> DataSet:
    values = np.column_stack([inputs, output])
    return DataSet(name, SAMPLE_TIME, (*INPUTS, "y"), ("m", "N.m", "rad"), values, {})


def known_network(settings: LolimotSettings = SETTINGS) -> ArxNetwork:
    """The network of `COEFFICIENTS`, not identified."""
    centres, widths = np.array(CENTRES)[:, None], np.array(WIDTHS)[:, None]
    return ArxNetwork(
        settings,
        INPUTS,
        "y",
        SAMPLE_TIME,
        Orders(3, 2, 2),
        Cells(centres - 0.5 * widths, centres + 0.5 * widths),
        np.array(COEFFICIENTS),
        np.array(POINT),
        OUTPUT_POINT,
    )
