"""The closed-form start and the exact chain of a lower framework, against white-box linearisations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_builder.errors import IdentificationError
from fmus.wbm import parameter_sets
from fmus.wbm.native import OUTPUTS, STATES, linearise
from identification.local_model import LocalModel
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_MATRIX, OUTPUT_NAMES, Head
from identification.surrogate.closed_form import closed_forms, continuous_response
from identification.surrogate.exact import exact_chain9, lower_framework
from identification.surrogate.structure import STRUCTURES
from tolerances import CLOSED_FORM, EXACT_CHAIN

CHAIN9 = STRUCTURES["chain9"]
FREQUENCIES = np.geomspace(0.4, 40.0, 60)
HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
WBM = pytest.mark.parametrize("name", parameter_sets())
HEIGHT = pytest.mark.parametrize("height", [0.75, 1.45, 2.25])


def response(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    s = 2j * np.pi * FREQUENCIES
    return np.array([C @ np.linalg.solve(one * np.eye(len(A)) - A, B) for one in s])


def linearised(name: str, height: float) -> tuple[Head, np.ndarray, np.ndarray, np.ndarray]:
    """Head, A, B and the rows of the four outputs of a white-box set, states q then q'."""
    chosen = parameter_sets()[name]
    order = [STATES.index(state) for state in ("phi_1", "delta", "xi", "phi_1_dot", "delta_dot", "xi_dot")]
    model = linearise(chosen, [height, 1310.9])
    rows = [OUTPUTS.index(output) for output in OUTPUT_NAMES]
    head = Head(m_C=chosen["mC"], k_C=chosen["k_C"], c_C=chosen["c_C"], k_E=chosen["k_E"])
    return head, model.A[np.ix_(order, order)], model.B[order], model.C[rows][:, order]


def exact(name: str, height: float) -> tuple[Head, dict[str, float], np.ndarray, np.ndarray, np.ndarray]:
    head, A, B, C = linearised(name, height)
    framework = lower_framework(A, B[:, 1], C[2, :2], head.k_C, head.c_C)
    return head, exact_chain9(*framework), A, B, C


@WBM
@HEIGHT
def test_the_linearised_white_box_model_is_a_chain(name: str, height: float) -> None:
    head, values, A, B, C = exact(name, height)
    chain_A, chain_B = CHAIN9.continuous(CHAIN9.from_coefficients(values, head), head)
    # Every pole has its twin, and what inputs do to outputs is the same.
    poles, twins = np.linalg.eigvals(A), np.linalg.eigvals(chain_A)
    assert max(np.abs(twins - pole).min() / np.abs(pole) for pole in poles) < EXACT_CHAIN
    wanted, found = response(A, B, C), response(chain_A, chain_B, OUTPUT_MATRIX)
    assert np.abs(found - wanted).max() < EXACT_CHAIN * np.abs(wanted).max()
    assert np.abs(found[:, :, 1] - wanted[:, :, 1]).max() < EXACT_CHAIN * np.abs(wanted[:, :, 1]).max()


@WBM
@HEIGHT
def test_the_closed_form_finds_the_chain_of_the_white_box_model(name: str, height: float) -> None:
    head, values, A, B, C = exact(name, height)
    found = closed_forms(response(A, B, C), FREQUENCIES, head)[0]
    assert set(found) == set(values)
    for parameter, value in values.items():
        assert found[parameter] == pytest.approx(value, rel=CLOSED_FORM, abs=1e-6), parameter


@settings(max_examples=40, deadline=None)
@given(place=st.lists(st.floats(0.0, 1.0), min_size=9, max_size=9))
def test_any_chain_in_a_sensible_range_is_found(place: list[float]) -> None:
    low = np.array([2.0, 3.0, 2e3, 2.0, 0.1, -0.3, -200.0, -2.0, -2.0])
    high = np.array([20.0, 30.0, 3e4, 60.0, 5.0, 0.3, 2000.0, 60.0, 20.0])
    theta = low + (high - low) * np.array(place)
    A, B = CHAIN9.continuous(theta, HEAD)
    found = closed_forms(response(A, B, OUTPUT_MATRIX), FREQUENCIES, HEAD)[0]
    again = CHAIN9.continuous(CHAIN9.from_coefficients(found, HEAD), HEAD)
    for mine, wanted in zip(again, (A, B), strict=True):
        assert np.abs(mine - wanted).max() < CLOSED_FORM * np.abs(wanted).max()


def test_the_continuous_response_is_that_of_the_sampled_plant() -> None:
    theta = np.array([8.0, 14.0, 25343.9, 25.0, 3.3, 0.2, 1200.0, 30.0, 1.0])
    A, B = CHAIN9.continuous(theta, HEAD)
    sampled = CHAIN9.discretise(theta, HEAD, 1e-3, derivatives=False)
    swapped = [3, 0, 2, 1]
    model = LocalModel(
        *(sampled.A, sampled.B[:, ::-1], OUTPUT_MATRIX[swapped], np.zeros((4, 2)), 1e-3),
        inputs=INPUT_NAMES[::-1],
        outputs=tuple(OUTPUT_NAMES[index] for index in swapped),
        input_operating_point=np.zeros(2),
        output_operating_point=np.zeros(4),
    ).transformed(np.random.default_rng(5).normal(size=(6, 6)))
    found, wanted = continuous_response(model, FREQUENCIES), response(A, B, OUTPUT_MATRIX)
    assert found is not None
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())


def test_what_is_no_chain_has_no_closed_form() -> None:
    rising = np.array([8.0, 14.0, 25343.9, 25.0, 3.3, 0.2, 1200.0, 30.0, 1.0])
    A, B = CHAIN9.continuous(rising * [-1, 1, 1, 1, 1, 1, 1, 1, 1], HEAD)
    assert closed_forms(response(A, B, OUTPUT_MATRIX), FREQUENCIES, HEAD) == ()
    assert closed_forms(np.zeros((60, 4, 2), dtype=complex), FREQUENCIES, HEAD) == ()
    broken = np.full((60, 4, 2), np.nan + 0j)
    assert closed_forms(broken, FREQUENCIES, HEAD) == ()


def test_a_framework_without_a_spring_is_refused() -> None:
    mass = np.array([[3.0, 0.5], [0.5, 2.0]])
    with pytest.raises(IdentificationError, match="no spring"):
        exact_chain9(mass, np.eye(2), np.zeros((2, 2)), np.array([0.5, -1.0]), np.array([1.0, 0.0]))
