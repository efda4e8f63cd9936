"""What decays is cut off: no denormal number stays in the kernel, for they make some processors crawl."""

from __future__ import annotations

import sys

import networks
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_builder.kernel import Network, simulate, specification, validities
from fmu_builder.parameter_set import ParameterSet

SMALLEST_NORMAL = sys.float_info.min
VARIANTS = [variant for variant in networks.VARIANTS if variant[0] != "affine"]
REST = [1.3 + 0.1 * i for i in range(3)]  # the operating point of networks.network


def denormal(numbers: networks.Array) -> networks.Array:
    size = np.abs(numbers)
    return numbers[(size > 0.0) & (size < SMALLEST_NORMAL)]


@pytest.mark.parametrize("variant", VARIANTS, ids="-".join)
def test_states_that_decay_never_get_denormal_in_either_form(variant: tuple[str, str, str]) -> None:
    parameter_set = networks.network(17, *variant)
    kernel, oracle = Network(parameter_set), specification.Network(parameter_set)
    kernel.start(REST)
    oracle.start(REST)
    tiny = 1e-98 * np.random.default_rng(17).uniform(0.5, 2.0, kernel.states.shape)
    kernel.states[...] = tiny
    oracle.x = np.atleast_2d(tiny).tolist()
    for _ in range(400):
        kernel.tick(REST)
        oracle.tick(REST)
        assert np.atleast_2d(kernel.states).tolist() == oracle.x
        left = np.abs(kernel.states[kernel.states != 0.0])
        assert (left >= 1e-100).all()
    assert np.count_nonzero(kernel.states) < kernel.states.size  # a mode may be kept alive at 1e-100, not all


def test_a_low_pass_that_decays_to_zero_arrives() -> None:
    parameter_set = networks.network(17, "low_pass", "output", "gaussian")
    kernel, oracle = Network(parameter_set), specification.Network(parameter_set)
    kernel.start([1.3, 1.1e-100, 1.5])
    oracle.start([1.3, 1.1e-100, 1.5])
    assert oracle.low_pass in kernel.state
    for _ in range(70):
        kernel.tick([1.3, 0.0, 1.5])
        oracle.tick([1.3, 0.0, 1.5])
    assert oracle.low_pass == 0.0
    assert np.abs(kernel.state[kernel.state != 0.0]).min() > 1e-100


@pytest.mark.parametrize("blending", ["output", "parameter"])
def test_gaussians_far_away_weigh_nothing(blending: str) -> None:
    content = networks.network(19, "none", blending, "gaussian").model_dump()
    content["partition"] |= {"centres": [0.5, 0.6, 2.4, 2.5], "spreads": [0.12] * 4}
    parameter_set = ParameterSet(**content)
    weights = validities(parameter_set, np.linspace(0.5, 2.5, 400))
    assert denormal(weights).size == 0
    assert (weights == 0.0).any()
    assert ((weights > 0.0) & (weights < 1e-60)).any()
    assert np.abs(weights.sum(axis=1) - 1.0).max() < 1e-15
    inputs = networks.inputs_of(19, 60, 3)
    assert simulate(parameter_set, inputs).tolist() == specification.simulate(parameter_set, inputs.tolist())


@given(st.floats(allow_nan=False))
def test_only_what_is_too_small_changes(value: float) -> None:
    kept = specification.significant(value)
    assert kept == (value if abs(value) >= 1e-100 else 0.0)
