"""Every method of thesis Tables 3.7 to 3.9 under the noise it is made for, on a plant with known poles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_plants import (
    THREE_MASS_OUTPUTS,
    asymmetric,
    asymmetric_data,
    rest_state,
    three_mass,
    three_mass_data,
)
from pydantic import ValidationError
from scipy.optimize import linear_sum_assignment
from scipy.signal import lfilter

from identification.data_set import DataSet
from identification.excitation import random_stream
from identification.local_model import LocalModel, simulated_states
from identification.scores import fit_percent
from identification.subspace import METHODS, SubspaceSettings, estimate
from identification.subspace.covariance import LaggedSums
from identification.subspace.preparation import prepared
from identification.subspace.projection import project
from tolerances import FACTORISATION, NOISE_FREE_FIT, NOISE_FREE_POLE

PLANT = asymmetric()
NAMES = PLANT.inputs, PLANT.outputs
SEEDS = range(6)
FIVE = {"order": 5, "block_rows": 20}
INPUTS = ("eta", "M_pa")


def lowest_fit(model: LocalModel, data: DataSet) -> float:
    inputs, reference = data.matrix(model.inputs), data.matrix(model.outputs)
    simulated = model.simulate(inputs, rest_state(model, inputs[0]))
    return min(fit_percent(y, yhat) for y, yhat in zip(reference.T, simulated.T, strict=True))


def pole_error(model: LocalModel) -> float:
    """Largest distance of true and found poles, matched one to one."""
    distances = np.abs(PLANT.poles[:, None] - model.poles)
    return float(distances[linear_sum_assignment(distances)].max())


def with_noise(kind: str, seed: int, rows: int) -> DataSet:
    """White: 10 % of each output. Coloured: resonant at 10 Hz, 30 %. Process: white noise on all states."""
    data = asymmetric_data(seed, rows)
    outputs = data.matrix(PLANT.outputs)
    size = outputs.std(axis=0)
    random = random_stream(seed, 9)
    noise = random.standard_normal((rows, 2)) * size
    if kind == "white":
        noise *= 0.1
    elif kind == "coloured":
        noise = lfilter([1.0], [1.0, -1.94 * np.cos(0.25), 0.97**2], noise, axis=0)
        noise *= 0.3 * size / noise.std(axis=0)
    else:
        drive = random.standard_normal((rows, 5)) * np.abs(PLANT.B).max(axis=1)
        moved = simulated_states(PLANT.A, drive, np.zeros(5)) @ PLANT.C.T
        noise = 0.09 * noise + 0.3 * moved * size.mean() / moved.std(axis=0).mean()
    return replace(data, values=np.column_stack([data.values[:, :3], outputs + noise]))


def errors(kind: str, rows: int) -> dict[str, float]:
    """Mean error of the poles over some seeds, by method."""
    data = [with_noise(kind, seed, rows) for seed in SEEDS]
    found = {}
    for method in METHODS:
        chosen = SubspaceSettings(method=method, stabilisation="reflect", **FIVE)
        found[method] = float(np.mean([pole_error(estimate([one], *NAMES, chosen)) for one in data]))
    return found


def test_white_noise_on_outputs_leaves_moesp_unbiased() -> None:
    few, many = errors("white", 3000), errors("white", 12000)
    for method in ("MOESP", "PO-MOESP", "N4SID", "CVA"):
        assert many[method] < 0.002 and many[method] < 0.6 * few[method]
    assert many["MOESP"] <= min(many.values())
    assert many["PI-MOESP"] > 3.0 * many["MOESP"]  # instruments without outputs waste information


def test_coloured_noise_on_outputs_asks_for_instruments_without_outputs() -> None:
    found = errors("coloured", 12000)
    assert found["PI-MOESP"] < 0.06
    for method in ("MOESP", "PO-MOESP", "N4SID", "CVA"):
        assert found[method] > 2.0 * found["PI-MOESP"]  # they take the noise's resonance for the plant's


def test_noise_on_states_asks_for_past_outputs() -> None:
    few, many = errors("process", 3000), errors("process", 12000)
    for method in ("PO-MOESP", "N4SID", "CVA"):
        assert many[method] < 0.003 and many[method] < 0.6 * few[method]
        assert many[method] < 0.4 * min(many["MOESP"], many["PI-MOESP"])
    assert many["MOESP"] > 0.8 * few["MOESP"]  # biased: more data do not help


COMBINATIONS = [(instrument, weighting) for instrument in ("past_inputs", "past") for weighting in
                ("moesp", "n4sid", "cva")]  # fmt: skip


@pytest.mark.parametrize(("instrument", "weighting"), [("none", "moesp"), *COMBINATIONS])
@pytest.mark.parametrize("factorisation", ["covariance", "qr"])
def test_noise_free_fit_is_100_for_every_weighting(
    instrument: str, weighting: str, factorisation: str
) -> None:
    chosen = SubspaceSettings(instrument=instrument, weighting=weighting, factorisation=factorisation, **FIVE)
    model = estimate([asymmetric_data(1, 3000)], *NAMES, chosen)
    assert lowest_fit(model, asymmetric_data(2, 3000)) > 100.0 - NOISE_FREE_FIT
    assert pole_error(model) < NOISE_FREE_POLE


@pytest.mark.parametrize("method", METHODS)
def test_noise_free_lightly_damped_plant_with_nothing_given(method: str) -> None:
    model = estimate([three_mass_data(1)], INPUTS, THREE_MASS_OUTPUTS, SubspaceSettings(method=method))
    assert lowest_fit(model, three_mass_data(2)) > 100.0 - NOISE_FREE_FIT
    assert model.order == three_mass().order == model.diagnostics["order"]
    assert len(model.diagnostics["choices"]) == 2


def test_named_methods_are_their_instrument_and_weighting() -> None:
    data = with_noise("white", 1, 2000)
    for method, (instrument, weighting) in METHODS.items():
        named = estimate([data], *NAMES, SubspaceSettings(method=method, **FIVE))
        spelled = estimate(
            [data], *NAMES, SubspaceSettings(instrument=instrument, weighting=weighting, **FIVE)
        )
        assert np.array_equal(named.A, spelled.A)
    with pytest.raises(ValidationError, match="needs an instrument"):
        SubspaceSettings(method="MOESP", weighting="cva")


@pytest.mark.parametrize("method", METHODS)
def test_singular_values_are_those_of_the_projections_by_their_definition(method: str) -> None:
    """Thesis eq. 3.89 and Table 3.9 written out with N-column Hankel matrices and pseudo-inverses."""
    data = [with_noise("process", 3, 400), with_noise("process", 4, 330)]
    s, floor = 6, 0.02
    chosen = SubspaceSettings(order=5, block_rows=s, method=method, noise_floor=floor)
    scaled = prepared(data, *NAMES, chosen)
    projection = project(scaled, LaggedSums(scaled.stacked, 2 * s), s, chosen)
    depth = s if method == "MOESP" else 2 * s
    parts = [windows(one, depth) for one in scaled.stacked]
    hankel = np.hstack([part - part.mean(axis=1, keepdims=True) for part in parts])
    hankel /= np.sqrt(hankel.shape[1])
    blocks = np.arange(len(hankel)).reshape(depth, 5)
    noise = np.diag(np.where(np.arange(len(hankel)) % 5 >= 3, floor, 0.0))
    hankel = np.hstack([hankel, noise])  # the assumed white noise as further, independent columns
    U, Y = hankel[blocks[depth - s :, :3].ravel()], hankel[blocks[depth - s :, 3:].ravel()]
    past = blocks[: depth - s, :3] if method == "PI-MOESP" else blocks[: depth - s]
    Z = hankel[past.ravel()]
    off_inputs = np.eye(hankel.shape[1]) - np.linalg.pinv(U) @ U
    if method == "MOESP":
        weighted = Y @ off_inputs
    else:
        inner = Z @ off_inputs @ Z.T
        weights = {"N4SID": Z @ Z.T}.get(method, inner)
        weighted = Y @ off_inputs @ Z.T @ np.linalg.inv(inner) @ np.linalg.cholesky(weights)
    if method == "CVA":
        weighted = np.linalg.inv(np.linalg.cholesky(Y @ off_inputs @ Y.T)) @ weighted
    expected = np.linalg.svd(weighted, compute_uv=False)[: len(projection.singular_values)]
    assert np.allclose(projection.singular_values, expected, rtol=FACTORISATION, atol=FACTORISATION)


def windows(signals: np.ndarray, depth: int) -> np.ndarray:
    """Block Hankel matrix, index = lag * channels + channel."""
    columns = [signals[:, k : k + depth].T.ravel() for k in range(signals.shape[1] - depth + 1)]
    return np.array(columns).T


def test_qr_and_covariance_give_one_model() -> None:
    data = [with_noise("white", 1, 1500), with_noise("white", 2, 900)]
    one, other = (
        estimate(data, *NAMES, SubspaceSettings(factorisation=way, **FIVE)) for way in ("covariance", "qr")
    )
    frequencies = np.array([0.3, 2.0, 7.3, 20.0])
    difference = one.frequency_response(frequencies) - other.frequency_response(frequencies)
    assert np.abs(difference).max() <= FACTORISATION * np.abs(one.frequency_response(frequencies)).max()


def test_a_linear_plant_is_not_changed_by_the_noise_floor() -> None:
    data = asymmetric_data(1, 3000)
    for floor in (0.0, 1e-2):
        model = estimate([data], *NAMES, SubspaceSettings(noise_floor=floor, **FIVE))
        assert pole_error(model) < 1e2 * NOISE_FREE_POLE
