"""Cubic validity functions and the node tables they are compiled to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from local_networks import local_models

from fmu_builder.kernel import validities
from fmu_builder.parameter_set import Partition, nested
from identification.n4sid import network
from identification.network import NetworkSettings
from identification.validity import (
    cell_widths,
    cubic_weights,
    equidistant_centres,
    equidistant_spreads,
    node_positions,
    warped,
    weights,
)
from tolerances import CUBIC_WEIGHTS, NODE_WEIGHTS

LOW, HIGH = 0.5, 2.5
X = np.linspace(LOW, HIGH, 401)
centres = st.lists(st.floats(LOW, HIGH), min_size=1, max_size=8, unique_by=lambda c: round(c, 1)).map(sorted)
warps = st.tuples(st.floats(-0.45, 0.45), st.floats(-0.2, 0.2))


def partition(c: list[float], warp: tuple[float, float] | None = None) -> Partition:
    validity = "cubic" if warp is None else "cubic_warp"
    return Partition(
        scheduling="eta", range=(LOW, HIGH), validity=validity, centres=nested(np.array(c)), warp=warp
    )


def rises(warp: tuple[float, float]) -> bool:
    return bool(np.diff(warped(np.linspace(LOW, HIGH, 2001), 1.5, warp)).min() > 1e-6)


@given(c=centres, warp=st.none() | warps)
def test_cubics_sum_to_one_and_are_exact_at_the_centres(
    c: list[float], warp: tuple[float, float] | None
) -> None:
    assume(warp is None or rises(warp))
    found = weights(partition(c, warp), X)
    assert np.abs(found.sum(axis=1) - 1.0).max() < CUBIC_WEIGHTS * np.abs(found).max()
    assert weights(partition(c, warp), np.array(c)).tolist() == np.eye(len(c)).tolist()


@given(c=centres, coefficients=st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4), warp=st.none() | warps)
def test_cubics_reproduce_polynomials(
    c: list[float], coefficients: list[float], warp: tuple[float, float] | None
) -> None:
    """Four centres and more carry any cubic, fewer what they determine; with warp in the warped variable."""
    assume(warp is None or rises(warp))
    curve = np.polynomial.Polynomial(coefficients[: min(len(c), 4)])
    here = X if warp is None else warped(X, 1.5, warp)
    at = np.array(c) if warp is None else warped(np.array(c), 1.5, warp)
    found = weights(partition(c, warp), X)
    size = np.abs(found).max() * (1.0 + np.abs(curve(here)).max())
    assert np.abs(found @ curve(at) - curve(here)).max() < CUBIC_WEIGHTS * size


def test_four_centres_are_the_polynomials_of_lagrange() -> None:
    c = np.array([0.7, 1.1, 1.9, 2.2])
    expected = np.ones((X.size, 4))
    for i, k in np.ndindex(4, 4):
        if i != k:
            expected[:, i] *= (X - c[k]) / (c[i] - c[k])
    assert np.abs(cubic_weights(X, c.tolist()) - expected).max() < CUBIC_WEIGHTS * np.abs(expected).max()


def test_more_centres_are_a_spline_not_a_wild_polynomial() -> None:
    """Two continuous derivatives, and a weight that fades away from its centre."""
    c = equidistant_centres(8, LOW, HIGH)
    fine = np.linspace(c[0], c[-1], 20001)
    found = cubic_weights(fine, c.tolist())
    second = np.diff(found, 2, axis=0) / (fine[1] - fine[0]) ** 2
    assert np.abs(np.diff(second, axis=0)).max() < 0.01 * np.abs(second).max()
    assert np.abs(found[:, 0][fine > 1.6]).max() < 0.05 and np.abs(found).max() < 1.2


def test_zero_warp_is_no_warp_and_the_warp_moves_the_middle_nowhere() -> None:
    c = [0.75, 1.25, 1.75, 2.25]
    np.testing.assert_array_equal(weights(partition(c, (0.0, 0.0)), X), weights(partition(c), X))
    assert warped(np.array([1.5]), 1.5, (0.3, -0.1))[0] == 1.5
    assert warped(np.array([2.0]), 1.5, (0.3, -0.1))[0] == pytest.approx(2.0 + 0.3 * 0.25 - 0.1 * 0.125)


@pytest.mark.parametrize("warp", [None, (-0.25, 0.07), (0.2, 0.05)])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_node_tables_carry_the_cubics(count: int, warp: tuple[float, float] | None) -> None:
    """Straight lines between nodes err by h^2/8 max |w''| at most, and not at all at the centres."""
    cut = partition(equidistant_centres(count, LOW, HIGH).tolist(), warp)
    exact = weights(cut, X)
    errors = []
    for nodes in (21, 41, 81):
        positions = node_positions(cut, nodes)
        assert positions[0] == LOW and positions[-1] == HIGH and set(cut.centres) <= set(positions)
        step = np.diff(positions).max()
        assert step <= (HIGH - LOW) / (nodes - 1) * (1.0 + 1e-9)
        table = weights(cut, positions)
        found = np.column_stack([np.interp(X, positions, column) for column in table.T])
        fine = np.linspace(LOW, HIGH, 4001)
        curvature = np.diff(weights(cut, fine), 2, axis=0) / (fine[1] - fine[0]) ** 2
        errors.append(np.abs(found - exact).max())
        assert errors[-1] <= step**2 / 8.0 * np.abs(curvature).max() * 1.01 + CUBIC_WEIGHTS
    assert errors[2] < errors[1] < errors[0] and errors[2] < NODE_WEIGHTS


def test_nodes_fall_on_centres_that_are_not_equidistant() -> None:
    cut = partition([0.5, 0.77, 1.3, 2.5])
    positions = node_positions(cut)
    assert {0.77, 1.3} <= set(positions) and positions.size <= 83 and np.diff(positions).min() > 0.0
    assert node_positions(partition([1.0, 2.0])).size == 81


@pytest.mark.parametrize("warp", [None, (-0.25, 0.07)])
def test_the_kernel_runs_cubics_from_the_table(warp: tuple[float, float] | None) -> None:
    c = [0.75, 1.25, 1.75, 2.25]
    settings = NetworkSettings(validity="cubic" if warp is None else "cubic_warp", warp=warp or (0.0, 0.0))
    built = network("cubic", local_models([1.0] * 4), settings)
    found = validities(built, X)
    assert np.abs(found - weights(partition(c, warp), X)).max() < NODE_WEIGHTS
    assert found.min() < -0.1 and validities(built, [9.0])[0].tolist() == found[-1].tolist()


def test_cell_widths() -> None:
    def widths(c: list[float]) -> list[float]:
        return cell_widths(c, LOW, HIGH).tolist()

    assert widths([0.75, 1.25, 1.75, 2.25]) == equidistant_spreads(4, LOW, HIGH).tolist()
    assert widths([1.0, 2.0, 2.2]) == pytest.approx([1.0, 0.6, 0.4])
    assert widths([0.9]) == [2.0]
