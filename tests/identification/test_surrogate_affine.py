"""Which affine offsets data can tell apart (Remark 4.4.1), and that those left are estimated."""

from __future__ import annotations

import numpy as np
import pytest

from identification.surrogate.affine import ALL_NAMES, OFFSETS, _jacobian, analyse_offsets
from identification.surrogate.chain import Head
from identification.surrogate.structure import STRUCTURES
from identification.validity import gaussian_weights

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN7 = STRUCTURES["chain7"]
THETA = np.array([8.0, 14.0, 25343.9, 25.0, 0.3, 1200.0, 30.0]) * np.array(
    [[1.0] * 7, [1.2, 0.9, 0.8, 1.5, 1.1, 1.4, 0.7], [1.5, 0.8, 0.7, 1.2, 0.9, 2.0, 1.3], [0.9] * 7]
)
CENTRES = (0.75, 1.25, 1.75, 2.25)


def weights(rows: int = 8000) -> np.ndarray:
    noise = np.random.default_rng(1).normal(scale=0.002, size=rows)
    eta = np.linspace(0.6, 2.4, rows) + np.cumsum(noise) * 0.05
    return gaussian_weights(eta, CENTRES, (0.5,) * 4, 1.0 / 3.0)


def test_of_one_local_model_only_the_offsets_of_the_outputs_can_be_told() -> None:
    local = CHAIN7.discretise(THETA[:1], HEAD, 1e-3, derivatives=False)
    found = analyse_offsets(local.A, local.B, np.ones((500, 1)))
    assert found.conditions["y0_zeta_dot"] == pytest.approx(1.0)
    assert all(found.conditions[name] > 1e12 for name in ALL_NAMES[4:12])
    assert found.silent == ("y0_delta_M", "y0_delta_M_dot")


def test_of_four_blended_models_the_estimated_offsets_are_well_determined_and_all_together_are_not() -> None:
    local = CHAIN7.discretise(THETA, HEAD, 1e-3, derivatives=False)
    found = analyse_offsets(local.A, local.B, weights())
    estimated = [one.name for one in OFFSETS if one.bounds[0] < one.bounds[1]]
    assert sorted(estimated) == sorted(ALL_NAMES[:5])
    assert found.conditions[ALL_NAMES[4]] < 200.0
    assert found.conditions["u0_eta"] > 10.0 * found.conditions["u0_M_pa"]
    assert found.conditions["x0_delta_M_dot"] > 1e12
    assert found.silent == ("y0_delta_M", "y0_delta_M_dot")


def test_the_jacobian_is_that_of_a_simulation() -> None:
    """One offset of one local model, moved in a simulation written from eq. 3.33-3.34."""
    local = CHAIN7.discretise(THETA, HEAD, 1e-3, derivatives=False)
    blend = weights(300)

    def outputs(x0: np.ndarray, u0: np.ndarray, y0: np.ndarray) -> np.ndarray:
        mixed = [np.tensordot(blend, one, 1) for one in (local.A, local.B, x0, u0, y0)]
        A, B, shift, inputs, rest = mixed
        u = np.array([1.5, 1300.0])
        x = np.linalg.solve(np.eye(6) - A[0], B[0] @ (u - inputs[0]) - A[0] @ shift[0])
        rows = []
        for k in range(300):
            held = max(k - 1, 0)
            rows.append((x - shift[held])[:4] + rest[held])
            x = A[k] @ (x - shift[k]) + B[k] @ (u - inputs[k])
        return np.array(rows)

    jacobian = _jacobian(local.A, local.B, blend)
    none = (np.zeros((4, 6)), np.zeros((4, 2)), np.zeros((4, 4)))
    base = outputs(*none)
    for name, part, entry in (("x0_zeta_dot", 0, 3), ("u0_M_pa", 1, 1), ("u0_eta", 1, 0), ("y0_zeta", 2, 2)):
        moved = [one.copy() for one in none]
        moved[part][2, entry] = 1.0
        column = jacobian[:, :, ALL_NAMES.index(name) * 4 + 2]
        change = outputs(*moved) - base
        np.testing.assert_allclose(column, change, rtol=0, atol=1e-9 * np.abs(change).max())
