"""Balanced reduction and stabilisation against formulas that share nothing with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_plants import (
    THREE_MASS_OUTPUTS,
    asymmetric,
    asymmetric_data,
    row_by_row,
    three_mass,
    three_mass_data,
)
from pydantic import ValidationError
from scipy.linalg import hankel as hankel_of
from scipy.linalg import svdvals

from fmu_builder.errors import IdentificationError
from identification.excitation import with_measurement_noise
from identification.local_model import LocalModel
from identification.subspace import SubspaceSettings, estimate, reduced
from identification.subspace.reduction import balanced_reduction
from identification.subspace.stability import reflected
from tolerances import GLOVER, HANKEL, INVARIANCE, STATIC_GAIN

NAMES = asymmetric().inputs, asymmetric().outputs
NOISE = {"xi": 1e-5, "zeta": 1e-5, "xi_dot": 1e-3, "zeta_dot": 1e-3}
INPUTS = ("eta", "M_pa")
CIRCLE = np.exp(1j * np.linspace(0.0, np.pi, 1500))


def random_model(seed: int, order: int, inputs: int = 3, outputs: int = 2) -> LocalModel:
    random = np.random.default_rng(seed)
    A = random.standard_normal((order, order))
    A *= random.uniform(0.5, 0.98) / np.abs(np.linalg.eigvals(A)).max()
    B, C = random.standard_normal((order, inputs)), random.standard_normal((outputs, order))
    D = random.standard_normal((outputs, inputs))
    names = tuple(f"u{i}" for i in range(inputs)), tuple(f"y{i}" for i in range(outputs))
    return LocalModel(A, B, C, D, 0.01, *names, np.zeros(inputs), np.zeros(outputs))


def response(model: LocalModel) -> np.ndarray:
    frequencies = np.angle(CIRCLE) / (2.0 * np.pi * model.sample_time)
    return model.frequency_response(frequencies)


def largest_gain(difference: np.ndarray) -> float:
    return float(np.linalg.norm(difference, ord=2, axis=(1, 2)).max())


def markov_hankel_values(model: LocalModel, length: int) -> np.ndarray:
    """Singular values of the block Hankel matrix of the impulse response: the definition itself."""
    still = np.zeros((2 * length, len(model.inputs)))
    channels = []
    for i in range(len(model.inputs)):
        impulse = still.copy()
        impulse[0, i] = 1.0
        channels.append(row_by_row(model, impulse, np.zeros(model.order))[1:])
    rows = [
        np.hstack([hankel_of(one[:length, o], one[length - 1 : 2 * length - 1, o]) for one in channels])
        for o in range(len(model.outputs))
    ]
    return svdvals(np.vstack(rows))


def test_hankel_singular_values_are_those_of_the_impulse_response() -> None:
    model = random_model(1, 7)
    model = replace(model, A=0.7 * model.A / model.spectral_radius)
    found = np.array(reduced(model, 3).diagnostics["hankel_singular_values"])
    assert np.allclose(found, markov_hankel_values(model, 150)[:7], rtol=HANKEL, atol=HANKEL * found[0])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), order=st.integers(2, 12), data=st.data())
def test_error_keeps_glover_s_bound_and_the_result_is_stable(
    seed: int, order: int, data: st.DataObject
) -> None:
    model = random_model(seed, order)
    kept = data.draw(st.integers(1, order - 1))
    for method in ("truncation", "residualisation"):
        small = reduced(model, kept, method)
        values = small.diagnostics["hankel_singular_values"]
        bound = 2.0 * sum(values[kept:])
        assert largest_gain(response(model) - response(small)) <= bound * (1.0 + GLOVER) + GLOVER * values[0]
        assert small.order == kept and small.spectral_radius < 1.0


def test_the_first_value_left_out_is_reached() -> None:
    """The lower bound sigma_(r+1) of any reduction: the oracle would notice values that are too small."""
    model = random_model(5, 6)
    small = reduced(model, 3)
    values = small.diagnostics["hankel_singular_values"]
    assert largest_gain(response(model) - response(small)) >= values[3] * (1.0 - GLOVER)


def test_coordinates_of_the_original_do_not_matter() -> None:
    model = random_model(7, 8)
    turned = model.transformed(np.random.default_rng(8).standard_normal((8, 8)))
    one, other = (response(reduced(given_model, 4)) for given_model in (model, turned))
    assert np.abs(one - other).max() < INVARIANCE * np.abs(one).max()


def test_residualisation_keeps_the_static_gain_and_truncation_the_feed_through() -> None:
    model = random_model(3, 8)
    still, cut = reduced(model, 4, "residualisation"), reduced(model, 4)
    assert np.allclose(still.dc_gain, model.dc_gain, rtol=STATIC_GAIN)
    assert np.array_equal(cut.D, model.D) and not np.allclose(cut.dc_gain, model.dc_gain, rtol=1e-3)


def test_what_is_not_coupled_falls_away_exactly() -> None:
    plant, extra = asymmetric(), random_model(9, 4)
    A = np.block([[plant.A, np.zeros((5, 4))], [np.zeros((4, 5)), extra.A]])
    B, C = np.vstack([plant.B, extra.B]), np.hstack([plant.C, np.zeros((2, 4))])
    back = reduced(replace(plant, A=A, B=B, C=C), 5)
    frequencies = np.array([0.5, 2.0, 7.3, 30.0])
    expected = plant.frequency_response(frequencies)
    assert np.allclose(back.frequency_response(frequencies), expected, atol=HANKEL * np.abs(expected).max())
    with pytest.raises(IdentificationError, match="of the 9 states to reduce 5 are reachable and observable"):
        reduced(replace(plant, A=A, B=B, C=C), 6, input_scale=np.ones(3), output_scale=np.ones(2))


def test_units_of_signals_do_not_decide_what_is_weak() -> None:
    """Scales from the estimator's diagnostics: the same reduction in metres and in millimetres."""
    data = with_measurement_noise(three_mass_data(3, duration=6.0), NOISE, 3)
    size = np.ones(len(data.names))
    size[data.names.index("zeta")], size[data.names.index("M_pa")] = 1e3, 1e-3
    settings_ = SubspaceSettings(order=14, block_rows=30)
    models = [
        estimate([one], INPUTS, THREE_MASS_OUTPUTS, settings_)
        for one in (data, replace(data, values=data.values * size))
    ]
    values = [reduced(model, 6).diagnostics["hankel_singular_values"] for model in models]
    assert np.allclose(values[0], values[1], rtol=1e-4, atol=1e-4 * values[0][0])
    assert reduced(models[0], 14) is models[0]


def test_an_unstable_model_is_not_reduced() -> None:
    model = random_model(2, 5)
    with pytest.raises(IdentificationError, match="unstable"):
        reduced(replace(model, A=1.3 * model.A / model.spectral_radius), 3)
    for order in (5, 0, -1):
        with pytest.raises(IdentificationError, match=r"Give 1 \.\. 4"):
            balanced_reduction(model.A, model.B, model.C, model.D, order, "truncation")


def test_high_order_then_reduced_finds_the_plant() -> None:
    data = with_measurement_noise(three_mass_data(3, duration=20.0), NOISE, 3)
    for method in ("truncation", "residualisation"):
        chosen = SubspaceSettings(order=6, block_rows=40, high_order=30, reduction=method)
        model = estimate([data], INPUTS, THREE_MASS_OUTPUTS, chosen)
        values = model.diagnostics["hankel_singular_values"]
        assert model.order == 6 and not model.D.any() and len(values) == 30
        assert values[6] < 0.02 * values[5]
        error = np.abs(np.sort_complex(model.poles) - np.sort_complex(three_mass().poles)).max()
        assert error < 1e-4


def test_high_order_must_exceed_the_order() -> None:
    with pytest.raises(ValidationError, match="high_order must be above order"):
        SubspaceSettings(order=6, high_order=6)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10**6), order=st.integers(1, 9))
def test_reflection_moves_unstable_poles_only(seed: int, order: int) -> None:
    A = random_model(seed, order).A * 1.4
    poles = np.linalg.eigvals(A)
    stable, moved = reflected(A, 0.999)
    expected = np.where(np.abs(poles) > 0.999, np.minimum(0.999, 1.0 / np.abs(poles)), np.abs(poles))
    expected = expected * np.exp(1j * np.angle(poles))
    found = np.linalg.eigvals(stable)
    assert np.abs(found[:, None] - expected).min(axis=0).max() < 1e-6
    assert moved == int(np.sum(np.abs(poles) > 0.999))


def test_an_unstable_result_is_refused_or_reflected_as_asked() -> None:
    plant = asymmetric()
    growing = replace(plant, A=plant.A * 1.004)
    data = asymmetric_data(1, 1200)
    outputs = growing.simulate(data.matrix(plant.inputs))
    data = replace(data, values=np.column_stack([data.values[:, :3], outputs]))
    with pytest.raises(IdentificationError, match=r'unstable at order 5 .*stabilisation = "reflect"'):
        estimate([data], *NAMES, SubspaceSettings(order=5, block_rows=20))
    model = estimate([data], *NAMES, SubspaceSettings(order=5, block_rows=20, stabilisation="reflect"))
    assert model.spectral_radius < 1.0
    assert any(
        "reflected into the unit circle, as asked for" in one["reason"]
        for one in model.diagnostics["choices"]
    )
