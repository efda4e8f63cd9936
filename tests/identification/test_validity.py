from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from linear_plants import asymmetric, three_mass
from numpy.typing import NDArray

from fmu_builder.errors import DataError, IdentificationError
from fmu_builder.parameter_set import Partition
from identification import static_map
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import random_stream
from identification.local_model import LocalModel
from identification.static_map import StaticMap
from identification.subspace import aligned
from identification.validity import (
    equidistant_centres,
    equidistant_spreads,
    gaussian_weights,
    hat_weights,
    node_positions,
    weights,
)
from tolerances import ALIGNMENT, STATIC_REGRESSION

CENTRES = [0.75, 1.25, 1.75, 2.25]
positions = st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=20)
centres = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=6, unique_by=lambda c: round(c, 2)).map(sorted)


def test_centres_and_spreads_of_the_thesis_in_metres() -> None:
    assert equidistant_centres(1, 0.5, 2.5).tolist() == [1.5]
    assert equidistant_centres(2, 0.5, 2.5).tolist() == [1.0, 2.0]
    assert equidistant_centres(4, 0.5, 2.5).tolist() == CENTRES
    assert equidistant_spreads(4, 0.5, 2.5).tolist() == [0.5] * 4


def test_gaussians_by_the_formula() -> None:
    row = gaussian_weights(np.array([1.1]), CENTRES, [0.5] * 4, 1.0 / 3.0)[0]
    bells = [math.exp(-0.5 * ((1.1 - c) / (0.5 / 3.0)) ** 2) for c in CENTRES]
    assert row == pytest.approx([bell / sum(bells) for bell in bells], rel=1e-13)


@given(x=positions, c=centres, k=st.floats(0.05, 2.0))
def test_gaussians_sum_to_one_however_far(x: list[float], c: list[float], k: float) -> None:
    spreads = np.linspace(0.2, 0.9, len(c)).tolist()
    rows = gaussian_weights(np.array(x), c, spreads, k)
    assert rows.shape == (len(x), len(c))
    assert np.allclose(rows.sum(axis=1), 1.0, rtol=0, atol=1e-14) and rows.min() >= 0.0


@given(x=positions, c=centres, clamped=st.booleans())
def test_hats_sum_to_one_and_two_of_them_count(x: list[float], c: list[float], clamped: bool) -> None:
    rows = hat_weights(np.array(x), c, clamped)
    assert np.allclose(rows.sum(axis=1), 1.0, rtol=0, atol=1e-11)
    assert (np.count_nonzero(rows, axis=1) <= 2).all()
    if clamped:
        assert rows.min() >= 0.0 and rows.max() <= 1.0


@pytest.mark.parametrize("clamped", [True, False])
def test_hats_are_exact_at_the_centres(clamped: bool) -> None:
    uneven = [0.61, 1.3, 1.7000001, 2.49]
    assert hat_weights(np.array(uneven), uneven, clamped).tolist() == np.eye(4).tolist()


def test_hats_between_and_beyond_the_centres() -> None:
    assert hat_weights(np.array([1.4]), CENTRES, True)[0] == pytest.approx([0.0, 0.7, 0.3, 0.0])
    assert hat_weights(np.array([0.5, 9.0]), CENTRES, True).tolist() == [[1, 0, 0, 0], [0, 0, 0, 1]]
    assert hat_weights(np.array([0.5, 2.5]), CENTRES, False) == pytest.approx(
        np.array([[1.5, -0.5, 0, 0], [0, 0, -0.5, 1.5]])
    )
    assert hat_weights(np.array([0.5, 9.0]), [1.0], False).tolist() == [[1.0], [1.0]]


@given(x=positions, slope=st.floats(-5.0, 5.0))
def test_extrapolating_hats_reproduce_a_straight_line(x: list[float], slope: float) -> None:
    line = hat_weights(np.array(x), CENTRES, False) @ (slope * np.array(CENTRES) + 1.0)
    assert np.allclose(line, slope * np.array(x) + 1.0, rtol=0, atol=1e-10)


@pytest.mark.parametrize("validity", ["hat", "hat_clamped"])
def test_nodes_carry_the_hats(validity: str) -> None:
    partition = Partition(scheduling="eta", range=(0.5, 2.5), validity=validity, centres=tuple(CENTRES))
    nodes = node_positions(partition)
    assert nodes.tolist() == [0.5, *CENTRES, 2.5]
    x = np.linspace(0.3, 2.7, 97)
    table = weights(partition, nodes)
    between = np.column_stack([np.interp(x, nodes, column) for column in table.T])
    assert np.allclose(weights(partition, x), between, rtol=0, atol=1e-14)
    at_the_end = Partition(scheduling="eta", range=(0.75, 2.25), validity=validity, centres=tuple(CENTRES))
    assert node_positions(at_the_end).tolist() == CENTRES


def family(transforms: list[Array]) -> list[LocalModel]:
    plants = [three_mass(scale) for scale in (0.7, 1.0, 1.3)]
    return [plant.transformed(T) for plant, T in zip(plants, transforms, strict=True)]


def blend_response(models: list[LocalModel], shares: list[float]) -> NDArray[np.complex128]:
    A, B, C = (np.tensordot(shares, [getattr(m, name) for m in models], 1) for name in "ABC")
    z = np.exp(2j * np.pi * np.array([1.0, 3.3, 12.0, 22.0]) * 0.001)
    return np.asarray(C @ np.linalg.solve(z[:, None, None] * np.eye(6) - A, np.broadcast_to(B, (4, 6, 2))))


@pytest.mark.parametrize("seed", range(5))
def test_alignment_undoes_any_similarity_transform(seed: int) -> None:
    """Aligned, blends do not depend on the coordinates they came in, and nearly are the physical ones."""
    random = random_stream(seed)
    scale = np.array([0.0024, 0.05, 0.002, 0.05])
    identity = np.eye(6)
    transforms = [random.standard_normal((6, 6)), identity, random.standard_normal((6, 6))]
    shares = [0.3, 0.5, 0.2]
    expected = aligned(family([identity] * 3), scale)
    found = aligned(family(transforms), scale)
    for one, other in zip(found, expected, strict=True):
        assert np.abs(one.A - other.A).max() < ALIGNMENT * np.abs(other.A).max() * 100
    good = blend_response(expected, shares)
    assert np.abs(blend_response(found, shares) - good).max() < 100 * ALIGNMENT * np.abs(good).max()
    raw = blend_response(family(transforms), shares)
    assert np.abs(raw - good).max() > 0.1 * np.abs(good).max()
    physical = blend_response([three_mass(s) for s in (0.7, 1.0, 1.3)], shares)
    assert np.abs(good - physical).max() < 0.02 * np.abs(physical).max()


def test_alignment_changes_coordinates_only() -> None:
    frequencies = np.array([1.0, 12.0])
    models = family([random_stream(k).standard_normal((6, 6)) for k in range(3)])
    for model, same in zip(models, aligned(models, np.ones(4)), strict=True):
        assert np.allclose(same.frequency_response(frequencies), model.frequency_response(frequencies))
    assert aligned(models, np.ones(4), reference=0)[0] is models[0]


def test_alignment_refuses_models_that_differ() -> None:
    with pytest.raises(IdentificationError, match="local model 2: has 5 states"):
        aligned([three_mass(), asymmetric(), three_mass()], np.ones(4), reference=0)


def test_static_map_between_and_beyond() -> None:
    table = StaticMap(np.array([0.0, 1.0, 3.0]), np.array([[0.0, 5.0], [1.0, 5.0], [5.0, 4.0]]), ("a", "b"))
    assert table.at(np.array([0.5, 2.0, 4.0, -1.0])).tolist() == [
        [0.5, 5.0],
        [3.0, 4.5],
        [7.0, 3.5],
        [-1.0, 5.0],
    ]
    assert table.select(("b",)).values.tolist() == [[5.0], [5.0], [4.0]]
    assert table.as_part().positions == (0.0, 1.0, 3.0)
    with pytest.raises(DataError, match="no output 'c'"):
        table.select(("a", "c"))
    with pytest.raises(DataError) as error:
        StaticMap(np.array([1.0, 1.0]), np.array([[1.0, np.nan, 2.0]]), ("a", "b"))
    assert len(error.value.problems) == 3


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6])
def test_static_map_of_local_models_runs_through_their_rest_points(count: int) -> None:
    """Rest points of a polynomial of the degree that `count` points determine, seen off the centre."""
    plant = three_mass()
    grid = equidistant_centres(count, 0.5, 2.5)
    curve = np.polynomial.Polynomial([0.3, 1.0, 0.2, -0.05][: min(count, 4)])
    models, slopes = [], plant.dc_gain
    for centre in grid:
        u = np.array([centre + 0.01, 1320.0])
        y = curve(centre) + slopes @ np.array([0.01, 1320.0 - 1310.9])
        fields = {
            name: getattr(plant, name) for name in ("A", "B", "C", "D", "sample_time", "inputs", "outputs")
        }
        models.append(type(plant)(**fields, input_operating_point=u, output_operating_point=y))
    found = static_map.from_local_models(models, grid.tolist(), {"M_pa": 1310.9}, "eta", (0.5, 2.5))
    x = np.linspace(0.5, 2.5, 41)
    expected = (
        np.tile(curve(x)[:, None], (1, 4)) if count > 1 else curve(1.5) + np.outer(x - 1.5, slopes[:, 0])
    )
    assert np.allclose(found.at(x), expected, atol=1e-9)


def test_static_map_of_local_models_does_not_depend_on_the_origin_of_the_height() -> None:
    maps = []
    for origin in (0.0, 65536.0):
        models = [
            replace(model, input_operating_point=np.array([origin + centre, 1310.9]))
            for centre, model in zip((0.75, 1.5, 2.25), map(three_mass, (0.8, 1.0, 1.2)), strict=True)
        ]
        centres = [float(model.input_operating_point[0]) for model in models]
        limits = (origin + 0.5, origin + 2.5)
        maps.append(static_map.from_local_models(models, centres, {"M_pa": 1310.9}, "eta", limits).values)
    assert np.allclose(*maps, rtol=1e-12, atol=1e-12)


def test_static_map_by_regression_and_its_refusal() -> None:
    plant = three_mass()
    random = random_stream(3)
    eta = np.linspace(0.6, 2.4, 60_000) + 0.001 * random.standard_normal(60_000)
    torque = 1310.9 + random.uniform(-75.0, 75.0, 60_000)
    inputs = np.column_stack([eta, torque])
    values = np.column_stack([inputs, plant.simulate(inputs)])[3000:]
    names, units = ("eta", "M_pa", *plant.outputs), ("m", "N.m", "m", "m/s", "m", "m/s")
    data = DataSet("ramp", 0.001, names, units, values)
    found = static_map.from_data([data], "eta", {"M_pa": 1310.9}, plant.outputs)
    x = np.linspace(0.7, 2.3, 9)
    expected = plant.output_operating_point + np.outer(x - 1.5, plant.dc_gain[:, 0])
    assert np.abs(found.at(x) - expected)[:, [0, 2]].max() < STATIC_REGRESSION
    gap = DataSet("gap", 0.001, names, units, values[(values[:, 0] < 1.0) | (values[:, 0] > 2.0)])
    with pytest.raises(IdentificationError, match="gaps at eta"):
        static_map.from_data([gap], "eta", {"M_pa": 1310.9}, plant.outputs)
