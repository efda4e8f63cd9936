"""Against GNU Octave's n4sid and btamodred: other authors, other language (SLICOT), the same data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import octave_oracle
import pytest
from linear_plants import THREE_MASS_OUTPUTS, asymmetric, rest_state, three_mass, three_mass_data

from identification.data_set import DataSet
from identification.excitation import with_measurement_noise
from identification.local_model import LocalModel
from identification.subspace import SubspaceSettings, estimate, reduced
from tolerances import HANKEL, OCTAVE_POLE

INPUTS = ("eta", "M_pa")
NOISE = {"xi": 1e-5, "zeta": 1e-5, "xi_dot": 1e-3, "zeta_dot": 1e-3}


@pytest.fixture(autouse=True)
def _installed() -> None:
    if octave_oracle.octave() is None:
        if octave_oracle.required():
            pytest.fail(octave_oracle.MISSING)
        pytest.skip(octave_oracle.MISSING)


def relative_error(model: LocalModel, data: DataSet) -> float:
    """Rms of the simulated outputs' errors over their standard deviation."""
    inputs, reference = data.matrix(INPUTS), data.matrix(THREE_MASS_OUTPUTS)
    error = (model.simulate(inputs, rest_state(model, inputs[0])) - reference)[len(reference) // 4 :]
    return float(np.sqrt(np.mean((error - error.mean(axis=0)) ** 2 / reference.var(axis=0))))


def sorted_poles(model: LocalModel) -> np.ndarray:
    return np.sort_complex(model.poles)


def test_noisy_data_of_six_states(tmp_path: Path) -> None:
    data = with_measurement_noise(three_mass_data(3, duration=20.0), NOISE, 3)
    (theirs,) = octave_oracle.n4sid(tmp_path, data, INPUTS, THREE_MASS_OUTPUTS, [(6, 50)])
    ours = estimate([data], INPUTS, THREE_MASS_OUTPUTS, SubspaceSettings(order=6, block_rows=50))
    fresh = three_mass_data(4, duration=20.0)
    # both are right; A and C agree to the noise, and least squares on the simulated output is the better B
    assert relative_error(theirs.model, fresh) < 2e-3
    assert relative_error(ours, fresh) < relative_error(theirs.model, fresh)
    assert np.abs(sorted_poles(ours) - sorted_poles(theirs.model)).max() < OCTAVE_POLE
    assert np.abs(sorted_poles(ours) - sorted_poles(three_mass())).max() < OCTAVE_POLE
    frequencies = np.array([0.5, 3.3, 8.0, 12.1, 22.4])
    expected = theirs.model.frequency_response(frequencies)
    size = np.abs(expected).max(axis=0)
    assert np.all(np.abs(ours.frequency_response(frequencies) - expected) < 0.01 * size)


def test_balanced_truncation(tmp_path: Path) -> None:
    model = asymmetric(feed_through=True)
    theirs, values = octave_oracle.balanced(tmp_path, model, 3)
    ours = reduced(model, 3)
    assert np.allclose(
        ours.diagnostics["hankel_singular_values"], values, rtol=HANKEL, atol=HANKEL * values[0]
    )
    frequencies = np.array([0.1, 1.0, 2.0, 5.0, 7.3, 40.0])
    expected = theirs.frequency_response(frequencies)
    difference = np.abs(ours.frequency_response(frequencies) - expected).max()
    assert difference < 10.0 * HANKEL * np.abs(expected).max()
