"""Models that could be identified and are doubtful all the same say so; good ones say nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_plants import asymmetric, asymmetric_data, recorded
from scipy.signal import lfilter

from fmu_builder.errors import IdentificationError
from identification.data_set import DataSet
from identification.excitation import random_stream, with_measurement_noise
from identification.local_model import LocalModel
from identification.subspace import SubspaceSettings, estimate
from identification.subspace.regression import fit_inputs
from identification.warning import stray_data

PLANT = asymmetric()
NAMES = PLANT.inputs, PLANT.outputs
SIZES = np.array([0.1, 5.0, 2.0])
FIVE = SubspaceSettings(order=5)


def together(apart: float, noise: float, seed: int = 1, feed_through: bool = False) -> DataSet:
    """Data in which the second input is the first and a share of its own; noise in std of each output."""
    white = random_stream(seed).standard_normal((6000, 3))
    white[:, 1] = white[:, 0] + apart * white[:, 1]
    base = asymmetric_data(1, feed_through=feed_through)
    values = PLANT.input_operating_point + white * SIZES
    inputs = replace(base, names=base.names[:3], units=base.units[:3], values=values)
    data = recorded(asymmetric(feed_through), inputs, ("rad", "rad/s"))
    size = data.matrix(PLANT.outputs).std(axis=0)
    return with_measurement_noise(data, dict(zip(PLANT.outputs, (noise * size).tolist(), strict=True)), seed)


def warnings(model: LocalModel) -> list[str]:
    return [f"{one['place']}: {one['what']}" for one in model.diagnostics["warnings"]]


def test_inputs_that_move_together_are_refused_with_noise_and_not_without() -> None:
    with pytest.raises(IdentificationError, match=r"'drive': what it does alone is uncertain") as refused:
        estimate([together(1e-5, 0.01)], *NAMES, FIVE)
    assert [one.place for one in refused.value.problems] == ["input 'drive'", "input 'load'"]
    assert warnings(estimate([together(1e-5, 0.0)], *NAMES, FIVE)) == []


def test_inputs_that_hardly_move_apart_are_doubtful() -> None:
    model = estimate([together(1e-3, 0.01)], *NAMES, FIVE)
    assert [one.split(" is uncertain")[0] for one in warnings(model)] == [
        "input 'drive': what it does alone", "input 'load': what it does alone",
    ]  # fmt: skip
    assert warnings(estimate([together(1.0, 0.01)], *NAMES, FIVE)) == []


@pytest.mark.parametrize("feed_through", [False, True])
def test_the_uncertainty_of_inputs_is_what_comes_of_it(feed_through: bool) -> None:
    """Against the errors that thirty draws of the noise lead to when one input moves at a time."""
    plant, apart = asymmetric(feed_through), 0.02
    squares, told = [], []
    clean = together(apart, 0.0, 1, feed_through)
    size = clean.matrix(plant.outputs).std(axis=0)
    u = (clean.matrix(plant.inputs) - plant.input_operating_point).T
    for seed in range(30):
        noisy = clean.matrix(plant.outputs) + 0.05 * size * random_stream(9, seed).standard_normal((6000, 2))
        y = ((noisy - plant.output_operating_point) / size).T
        found = fit_inputs(plant.A, plant.C / size[:, None], [u], [y], feed_through)
        told.append(found.input_errors)
        moved = replace(plant, B=found.B - plant.B, D=found.D * size[:, None] - plant.D)
        one_by_one = []
        for j in range(3):
            alone = np.where(np.arange(3) == j, u.T, 0.0) + plant.input_operating_point
            one_by_one.append((((moved.simulate(alone) - plant.output_operating_point) / size) ** 2).mean())
        squares.append(one_by_one)
    np.testing.assert_allclose(np.mean(told, axis=0), np.sqrt(np.mean(squares, axis=0)), rtol=0.25)


@pytest.mark.parametrize("seed", [0, 1])
def test_an_integrator_is_doubtful(seed: int) -> None:
    """Its pole comes out just below 1, and what it answers cannot be told from where it began."""
    drive = random_stream(3, seed).standard_normal(8000)
    place, speed = lfilter([0.0, 1.0], [1.0, -1.0], drive), lfilter([0.0, 0.1], [1.0, -0.9], drive)
    values = np.column_stack([drive, place, speed])
    data = DataSet("integrator", 0.01, ("drive", "place", "speed"), ("", "", ""), values)
    model = estimate([data], ("drive",), ("place", "speed"))
    assert model.spectral_radius > 1.0 - 1e-9
    assert model.diagnostics["training_fit"][0] < 50.0
    assert [one.partition(":")[0] for one in warnings(model)] == ["input 'drive'", "output 'place'"]
    assert "FIT on its training data is" in warnings(model)[1]


def test_data_that_leave_the_range_are_told_by_their_share() -> None:
    height = np.repeat([0.4, 1.0, 2.6], [15, 1970, 15])
    data = DataSet("long way", 0.01, ("eta", "xi"), ("m", "m"), np.column_stack([height, height]))
    (found,) = stray_data([data], "eta", (0.5, 2.5))
    assert found.place == "data set 'long way'"
    assert found.what.startswith("1.5 % of its rows have eta outside 0.5 .. 2.5")
    assert stray_data([data], "eta", (0.4, 2.5)) == []
