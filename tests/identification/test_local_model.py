from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_plants import asymmetric, asymmetric_data, rest_state, row_by_row, three_mass

from fmu_builder.errors import DataError, IdentificationError
from identification.local_model import LocalModel
from identification.scores import (
    FIELDS,
    fit_percent,
    max_error,
    recommendation_problems,
    records,
    scored_rows,
)
from tolerances import SIMULATION


@pytest.mark.parametrize("rows", [1, 63, 64, 65, 1000])
def test_simulation_is_the_equations_row_by_row(rows: int) -> None:
    plant = asymmetric(feed_through=True)
    random = np.random.default_rng(rows)
    inputs = plant.input_operating_point + random.standard_normal((rows, 3))
    start = random.standard_normal(5)
    expected = row_by_row(plant, inputs, start)
    assert np.allclose(
        plant.simulate(inputs, start), expected, rtol=0, atol=SIMULATION * np.abs(expected).max()
    )


def test_rest_is_rest() -> None:
    plant = three_mass()
    inputs = np.tile([1.7, 1250.0], (300, 1))
    outputs = plant.simulate(inputs, rest_state(plant, inputs[0]))
    assert np.allclose(outputs, outputs[0], atol=1e-10)
    expected = plant.output_operating_point + plant.dc_gain @ (inputs[0] - plant.input_operating_point)
    assert np.allclose(outputs[0], expected, atol=1e-10)


def test_frequency_response_matches_a_sine() -> None:
    plant = asymmetric(feed_through=True)
    response = plant.frequency_response(np.array([3.0, 11.0]))
    assert response.shape == (2, 2, 3)
    time = np.arange(40_000) * plant.sample_time
    inputs = np.tile(plant.input_operating_point, (time.size, 1))
    inputs[:, 1] += np.sin(2 * np.pi * 11.0 * time)
    late = (plant.simulate(inputs) - plant.output_operating_point)[-2500:]
    carrier = np.exp(-2j * np.pi * 11.0 * time[-2500:])
    assert np.allclose(2j * (late.T @ carrier) / 2500, response[1, :, 1], rtol=1e-3, atol=1e-5)


def test_coordinates_do_not_matter() -> None:
    plant = asymmetric(feed_through=True)
    transform = np.random.default_rng(1).standard_normal((5, 5))
    other = plant.transformed(transform)
    f = np.array([0.1, 2.0, 20.0])
    assert not np.allclose(other.A, plant.A)
    assert np.allclose(other.frequency_response(f), plant.frequency_response(f))
    start = np.ones(5)
    inputs = asymmetric_data(1, 200).matrix(plant.inputs)
    assert np.allclose(other.simulate(inputs, transform @ start), plant.simulate(inputs, start))


def test_wrong_shapes_and_numbers_are_named_together() -> None:
    plant = asymmetric()
    with pytest.raises(IdentificationError) as error:
        replace(plant, B=plant.B.T, C=plant.C * np.nan, D=plant.D[:1])
    assert [p.place for p in error.value.problems] == ["local model, B", "local model, C", "local model, D"]
    assert isinstance(plant, LocalModel) and plant.order == 5 and plant.spectral_radius < 1.0


def test_fit_by_hand_and_only_on_the_last_three_quarters() -> None:
    reference = np.array([50.0, -50.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    simulated = np.array([0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0])
    # |e| = 2, |y - mean| = sqrt(17.5)
    assert fit_percent(reference, simulated) == pytest.approx(100.0 * (1.0 - 2.0 / np.sqrt(17.5)), rel=1e-14)
    assert max_error(reference, simulated) == 2.0
    assert fit_percent(reference, reference) == 100.0
    assert fit_percent(reference, np.full(8, 3.5)) == pytest.approx(0.0, abs=1e-13)
    assert [scored_rows(n) for n in (8, 10, 1)] == [slice(2, 8), slice(2, 10), slice(0, 1)]


def test_fit_of_what_has_none() -> None:
    with pytest.raises(DataError, match="constant"):
        fit_percent(np.ones(8), np.zeros(8))
    with pytest.raises(DataError, match="constant"):  # the mean is not 0.3 to the last bit
        fit_percent(np.full(1001, 0.3), np.zeros(1001))
    with pytest.raises(DataError, match="shapes"):
        fit_percent(np.ones(8), np.zeros(7))
    assert fit_percent(np.arange(8.0), np.full(8, np.nan)) == -np.inf
    assert max_error(np.arange(8.0), np.full(8, np.inf)) == np.inf


def test_records_hold_every_field_and_no_infinity() -> None:
    reference = np.column_stack([np.arange(8.0), np.ones(8), np.arange(8.0) ** 2])
    simulated = reference + np.array([0.0, 0.0, np.nan])
    found = records(reference, simulated, ("a", "b", "c"), {"wbm": "A", "llms": 4, "recommended": True})
    assert [tuple(entry) for entry in found] == [FIELDS] * 3
    assert [entry["fit"] for entry in found] == [100.0, None, None]
    assert [entry["max_error"] for entry in found] == [0.0, 0.0, None]
    assert found[0]["wbm"] == "A" and found[0]["route"] is None and found[2]["signal"] == "c"
    with pytest.raises(DataError, match="colour"):
        records(reference, simulated, ("a", "b", "c"), {"colour": 1})
    with pytest.raises(DataError, match="one column per signal"):
        records(reference, simulated, ("a", "b"), {})


def test_exactly_one_recommended_record() -> None:
    entry = dict.fromkeys(FIELDS)
    one = [{**entry, "offsets": "low_pass", "recommended": False}, {**entry, "recommended": True}]
    assert recommendation_problems(one) == []
    assert len(recommendation_problems([*one, {**entry, "recommended": True}])) == 1
    assert len(recommendation_problems([*one, {**entry, "signal": "xi", "recommended": False}])) == 1
