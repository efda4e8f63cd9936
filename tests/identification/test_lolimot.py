from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from arx_plants import (
    INPUTS,
    OUTPUT_POINT,
    POINT,
    SAMPLE_TIME,
    SETTINGS,
    data_set,
    drawn_inputs,
    known_network,
    run,
    validities,
)
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fmu_builder.errors import DataError, IdentificationError
from identification.arrays import Array
from identification.data_set import DataSet
from identification.lolimot import ArxNetwork, LolimotSettings, identify
from identification.lolimot.regression import Orders, differences, regressors, weighted_least_squares
from identification.lolimot.tree import Cells, Grower
from tolerances import ARX_RECOVERY, BITS, LEAST_SQUARES, SAME_NETWORK, WEIGHT_SUM


def test_one_local_model_is_recovered_from_its_own_data() -> None:
    """Noise-free data of one ARX model: nothing but rounding is left."""
    stream = np.random.default_rng(3)
    u = stream.standard_normal((400, 2)) * [0.3, 40.0] + POINT
    a, b, c = (1.5, -0.7), ((0.3, -0.2, 0.1), (2e-3, 1e-3, -3e-3)), 0.05
    y = [0.0, 0.1, 0.0]
    for k in range(3, len(u)):
        driven = sum(b[j][lag - 1] * u[k - lag, j] for j in range(2) for lag in (1, 2, 3))
        y.append(a[0] * y[k - 1] + a[1] * y[k - 2] + driven + c)
    settings = SETTINGS.model_copy(update={"past_outputs": 2, "past_inputs": 3, "most_models": 1})
    found = identify([data_set(u, np.array(y))], INPUTS, "y", settings)
    assert found.parameters[0, :8] == pytest.approx([*a, *b[0], *b[1]], rel=ARX_RECOVERY)
    constant = found.parameters[0, 8] + found.output_point * (1.0 - sum(a))
    constant -= found.input_point @ [sum(b[0]), sum(b[1])]
    assert constant == pytest.approx(c, rel=1e3 * ARX_RECOVERY)


def test_local_models_that_do_not_overlap_are_recovered_exactly() -> None:
    """Cells so sharp that no row belongs to two: the tree finds the switch and both models."""
    stream = np.random.default_rng(4)
    eta = np.where(np.sin(np.linspace(0.0, 30.0, 900)) > 0.0, 2.0, 1.0) + 0.2 * stream.uniform(-1, 1, 900)
    u = np.column_stack([eta, stream.standard_normal(900)])
    models = ((0.8, 0.3, 0.05, 0.2), (-0.5, 0.1, 0.4, -0.1))  # y, eta, M_pa, 1
    y = [0.0]
    for k in range(1, 900):
        one = models[int(u[k - 1, 0] > 1.5)]
        y.append(one[0] * y[k - 1] + one[1] * u[k - 1, 0] + one[2] * u[k - 1, 1] + one[3])
    settings = LolimotSettings(past_outputs=1, past_inputs=1, most_models=2, k_sigma=0.05)
    found = identify([data_set(u, np.array(y))], INPUTS, "y", settings)
    assert found.cells.centres.ravel().tolist() == [1.0, 2.0]
    for parameters, one in zip(found.parameters, models, strict=True):
        assert parameters[:3] == pytest.approx(one[:3], rel=ARX_RECOVERY)


def test_one_step_predictions_of_a_known_network_are_its_outputs() -> None:
    """Against the plain loop, from a start that is no rest, with inputs beyond the range."""
    u = drawn_inputs(1, 300)
    y = run(u, (0.2, -0.1, 0.05))
    assert known_network().predict(u, y) == pytest.approx(y, abs=SAME_NETWORK * np.abs(y).max())


def test_the_free_run_is_the_difference_equation() -> None:
    u = drawn_inputs(2, 300)
    u[:4] = u[0]
    network = known_network()
    rest = float(network.at_rest(u[:1])[0]) - OUTPUT_POINT
    expected = run(u, (rest, rest, rest))
    assert expected[3] == pytest.approx(expected[0], abs=SAME_NETWORK)  # it is a rest, says the plain loop
    assert network.free_run(u) == pytest.approx(expected, abs=SAME_NETWORK * np.abs(expected).max())


def test_an_unstable_network_runs_away_without_a_warning() -> None:
    network = known_network()
    wild = ArxNetwork(**{**vars(network), "parameters": network.parameters * 3.0})
    assert not np.isfinite(wild.free_run(drawn_inputs(1, 3000))).all()
    assert wild.spectral_radii(np.array([[1.0, 900.0]]))[0] > 1.0


def test_the_tree_halves_where_a_plant_changes() -> None:
    """A static plant, straight above 1.5 and in two pieces below: the lower half is halved, once."""
    z = np.linspace(0.5, 2.5, 2001)
    target = np.where(z < 1.0, 3.0 * z, np.where(z < 1.5, 5.0 - 2.0 * z, z))
    columns = np.column_stack([z, np.ones_like(z)])
    grower = Grower(columns, target, z[:, None], 0.02)
    cells, parameters, growth = grower.grow(np.array([0.5]), np.array([2.5]), 3, 0.2)
    assert cells.centres.ravel().tolist() == [0.75, 1.25, 2.0]
    assert [stage.place for stage in growth] == [None, 1.5, 1.0]
    expected = np.array([(3.0, 0.0), (-2.0, 5.0), (1.0, 0.0)])
    assert np.abs(parameters - expected).max() < 0.1  # neighbours reach across the edges
    losses = [stage.loss for stage in growth]
    assert losses == sorted(losses, reverse=True)


def test_the_tree_halves_across_the_axis_that_matters() -> None:
    stream = np.random.default_rng(5)
    places = stream.uniform(0.0, 1.0, (3000, 3))
    target = np.where(places[:, 1] < 0.5, places[:, 0], -places[:, 0])
    columns = np.column_stack([places[:, 0], np.ones(3000)])
    cells, _, growth = Grower(columns, target, places, 0.1).grow(np.zeros(3), np.ones(3), 2, 0.0)
    assert growth[1].axis == 1
    assert cells.centres.tolist() == [[0.5, 0.25, 0.5], [0.5, 0.75, 0.5]]


def test_the_tree_stops_where_nothing_is_gained_and_where_rows_run_out() -> None:
    z = np.linspace(0.0, 1.0, 101)
    columns = np.column_stack([z, np.ones_like(z)])
    straight = Grower(columns, 2.0 * z, z[:, None], 0.3)
    assert len(straight.grow(np.zeros(1), np.ones(1), 8, 0.99)[1]) == 1
    few = Grower(columns[::20], z[::20] ** 2, z[::20, None], 0.3)  # 6 rows for two regressors
    assert len(few.grow(np.zeros(1), np.ones(1), 64, 0.0)[1]) == 2


def test_weighted_least_squares_are_those_of_numpy() -> None:
    stream = np.random.default_rng(6)
    columns = stream.standard_normal((80, 5)) * [1.0, 1e3, 1e-4, 5.0, 1.0]
    target, shares = stream.standard_normal(80), stream.uniform(0.0, 1.0, 80)
    root = np.sqrt(shares)
    expected = np.linalg.lstsq(columns * root[:, None], target * root)[0]
    assert weighted_least_squares(columns, target, shares) == pytest.approx(expected, rel=LEAST_SQUARES)


def test_least_squares_leave_alone_what_the_data_do_not_tell() -> None:
    stream = np.random.default_rng(7)
    known = stream.standard_normal((50, 2))
    columns = np.column_stack([known, np.zeros(50)])
    found = weighted_least_squares(columns, known @ [2.0, -1.0], np.ones(50))
    assert found == pytest.approx([2.0, -1.0, 0.0], abs=LEAST_SQUARES)


@pytest.mark.parametrize("delay", [0, 1])
def test_a_row_of_regressors_holds_what_it_says(delay: int) -> None:
    u, y = np.arange(24.0).reshape(12, 2) ** 2, np.arange(12.0) ** 3
    orders = Orders(2, 3, 2, delay)
    rows = regressors(u, y, orders)
    assert orders.before == 2 + delay
    for row, k in zip(rows, range(orders.before, 12), strict=True):
        past = [k - delay, k - delay - 1, k - delay - 2]
        assert row.tolist() == [y[k - 1], y[k - 2], *u[past, 0], *u[past, 1], 1.0]


def test_differences_are_those_of_the_signals() -> None:
    stream = np.random.default_rng(8)
    u, y = stream.standard_normal((9, 2)), stream.standard_normal(9)
    orders = Orders(4, 3, 2)
    turned = (regressors(u, y, orders) @ differences(orders).T)[-1]
    newest_first = y[7::-1][:4]
    expected = [(-1) ** order * np.diff(newest_first, order)[0] for order in range(4)]
    assert turned[:4] == pytest.approx(expected, rel=LEAST_SQUARES)
    assert turned[4:7] == pytest.approx([u[7, 0], u[7, 0] - u[6, 0], u[7, 0] - 2 * u[6, 0] + u[5, 0]])


def test_an_input_that_acts_at_once_needs_no_delay() -> None:
    """y(k) = 0.5 y(k-1) - 3 eta(k): without u(k) among the regressors nothing can be found."""
    u = drawn_inputs(9, 500)
    y = [0.0]
    for k in range(1, 500):
        y.append(0.5 * y[-1] - 3.0 * (u[k, 0] - 1.5))
    orders = {"past_outputs": 1, "past_inputs": 1, "most_models": 1}
    found = identify([data_set(u, np.array(y))], INPUTS, "y", LolimotSettings(**orders, delay=0))
    assert found.parameters[0, :2] == pytest.approx([0.5, -3.0], rel=ARX_RECOVERY)
    late = identify([data_set(u, np.array(y))], INPUTS, "y", LolimotSettings(**orders))
    assert late.growth[0].loss > 1e-3 > 1e3 * found.growth[0].loss


def test_several_experiments_count_together_without_a_row_across_them() -> None:
    u = drawn_inputs(10, 600)
    y = run(u, (0.1, 0.0, 0.0))
    again = run(u[200:], (-0.1, 0.2, 0.1))
    settings = SETTINGS.model_copy(update={"most_models": 1})
    found = identify([data_set(u, y), data_set(u[200:], again, "second")], INPUTS, "y", settings)
    centred = [(a - found.input_point, b - found.output_point) for a, b in ((u, y), (u[200:], again))]
    rows = np.vstack([regressors(a, b, found.orders) for a, b in centred])
    target = np.concatenate([b[3:] for _, b in centred])
    assert found.parameters[0] == pytest.approx(np.linalg.lstsq(rows, target)[0], rel=1e-6)


def test_every_second_row_is_a_model_of_twice_the_sample_time() -> None:
    u = drawn_inputs(11, 800)
    y = run(u)
    half = identify([data_set(u, y)], INPUTS, "y", SETTINGS.model_copy(update={"every": 2}))
    direct = identify([data_set(u[::2], y[::2])], INPUTS, "y", SETTINGS)
    assert half.sample_time == 2 * SAMPLE_TIME
    assert np.abs(half.parameters - direct.parameters).max() == BITS


@given(
    edges=st.lists(st.floats(0.0, 1.0), min_size=0, max_size=5, unique=True),
    places=st.lists(st.floats(-3.0, 4.0), min_size=1, max_size=20),
    k_sigma=st.floats(0.01, 3.0),
)
def test_validities_sum_to_one(edges: list[float], places: list[float], k_sigma: float) -> None:
    corners = sorted({0.0, 1.0, *(round(edge, 2) for edge in edges)})
    cells = Cells(np.array(corners[:-1])[:, None], np.array(corners[1:])[:, None])
    shares = cells.weights(np.array(places)[:, None], k_sigma)
    assert shares.min() >= 0.0
    assert np.abs(shares.sum(axis=1) - 1.0).max() <= 4 * WEIGHT_SUM


def test_validities_are_normalised_gaussians() -> None:
    network = known_network()
    u = drawn_inputs(12, 50, 0.2, 3.0)
    expected = [validities(float(eta)) for eta in u[:, 0]]
    assert network.weights(u) == pytest.approx(np.array(expected), abs=4 * WEIGHT_SUM)


def broken(**changes: Any) -> tuple[DataSet, LolimotSettings]:
    u = drawn_inputs(13, changes.pop("rows", 200))
    y = run(u)
    column = changes.pop("constant", None)
    if column is not None:
        u[:, column] = u[0, column]
    return data_set(u, y), SETTINGS.model_copy(update=changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rows": 8}, r"has 8 rows at every 1, 11 are needed for these orders"),
        ({"rows": 100, "every": 20}, r"has 5 rows at every 20, 11 are needed"),
        ({"constant": 0}, r"has 'eta' constant"),
        ({"constant": 1}, r"has 'M_pa' constant"),
        ({"scheduling": {"eta": (2.6, 4.0)}}, r"has 0 rows in the range 2.6 .. 4 of 'eta', 8 are needed"),
    ],
)
def test_data_that_tell_nothing_are_refused(changes: dict[str, Any], message: str) -> None:
    data, settings = broken(**changes)
    with pytest.raises(DataError, match=message):
        identify([data], INPUTS, "y", settings)


def test_all_problems_of_all_data_sets_are_told_at_once() -> None:
    short, settings = broken(rows=8)
    still, _ = broken(constant=0)
    with pytest.raises(DataError) as refused:
        identify([short, still], INPUTS, "y", settings)
    assert len(refused.value.problems) == 2
    with pytest.raises(DataError, match="no training data"):
        identify([], INPUTS, "y", settings)


def test_a_scheduling_signal_is_an_input() -> None:
    data, settings = broken(scheduling={"speed": (0.0, 1.0)})
    with pytest.raises(IdentificationError, match="speed is no input"):
        identify([data], INPUTS, "y", settings)
    with pytest.raises(ValidationError, match="does not ascend"):
        LolimotSettings(scheduling={"eta": (1.0, 1.0)})


def test_rest_is_where_the_free_run_stays() -> None:
    network = known_network()
    u: Array = np.tile([1.1, 870.0], (400, 1))
    assert np.ptp(network.free_run(u)) <= SAME_NETWORK
    moved = np.vstack([np.tile([1.9, 950.0], (5, 1)), u])
    assert network.free_run(moved)[-1] == pytest.approx(network.at_rest(u[:1])[0], abs=SAME_NETWORK)
