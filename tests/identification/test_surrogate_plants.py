"""Random three-mass plants from data to theta; tests/benchmarks/surrogate_plants.py is the same in large."""

from __future__ import annotations

import numpy as np
import pytest
from random_chains import CHAIN, HEAD, SCALE, gain, noisy, random_chain, recorded, trial

from identification.surrogate.certainty import LARGEST_CONDITION
from tolerances import FEW_SEEDS, SURROGATE_RECOVERY

STANDARD_ERRORS = 4.0


@pytest.mark.parametrize("seed", [2, 19])
def test_theta_and_its_standard_errors_are_right(seed: int) -> None:
    found = trial(seed, duration=20.0, noise_seeds=12, sure_seeds=3)
    assert found.condition < LARGEST_CONDITION
    assert found.clean < SURROGATE_RECOVERY
    assert found.distance.max() < STANDARD_ERRORS
    assert np.abs(np.log(found.ratio)).max() < FEW_SEEDS


def test_plants_are_on_the_scale_of_table_4_3() -> None:
    thetas = np.array([random_chain(seed) for seed in range(200)])
    low, high = SCALE / 3.0, SCALE * 3.0
    masses = thetas[:, [CHAIN.names.index(name) for name in ("m_H", "m_M", "k_L", "k_W")]]
    assert (masses >= low).all() and (masses <= high).all()
    assert not any(CHAIN.at_bound(theta) for theta in thetas)
    assert len(np.unique(thetas[:, 0])) == 200


def test_the_data_are_those_of_the_chain() -> None:
    theta = random_chain(1)
    data = recorded(theta, 1, 2.0)
    A, B = CHAIN.continuous(theta, HEAD)
    first = data.matrix(("eta", "M_pa"))[0] - [0.0, 1310.9]
    np.testing.assert_allclose(data.matrix(("xi", "zeta"))[0], gain(theta)[[0, 2]] @ first, rtol=1e-9)
    measured = noisy(data, 1, 0)
    assert np.abs(measured.column("xi_dot") - data.column("xi_dot")).std() > 5e-4
    for one in (data, measured):
        force = HEAD.k_E * (one.column("xi") - one.column("eta"))
        np.testing.assert_array_equal(one.column("F_p"), force)
    assert np.linalg.eigvals(A).real.max() < 0.0 and B.shape == (6, 2)
