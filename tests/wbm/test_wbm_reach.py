"""Whatever the inputs: a finite answer or an error that names the height and the range, never NaN."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tolerances
from fmu_builder.errors import FmuError
from fmus.wbm import native, parameter_sets

NAMES = tuple(parameter_sets())


@pytest.mark.parametrize("name", NAMES)
def test_reach_ends_where_the_crossbar_no_longer_rises(name: str) -> None:
    """Just inside both ends the unbent linkage closes and z1 > 0; just outside one of the two fails."""
    parameters = parameter_sets()[name]
    reach = native.reach(parameters)

    def lift(angle: float) -> float:
        d_outputs = native.tangent(parameters, [angle, 0, 0, 0, 1, 0], [1, 0], np.eye(6)[0], np.zeros(2))[1]
        return float(d_outputs[native.OUTPUTS.index("zeta")])

    angles = np.linspace(reach.angle_low + 1e-9, reach.angle_high - 1e-9, 500)
    assert min(lift(angle) for angle in angles) > 0.0
    for outside in (reach.angle_low - 1e-6, reach.angle_high + 1e-6):
        assert not lift(outside) > 0.0
    zeta = native.OUTPUTS.index("zeta")
    ends = [(reach.angle_low, reach.height_low), (reach.angle_high, reach.height_high)]
    for angle, height in ends:
        assert native.simulate(parameters, [[1.5, 0.0]], state=[angle, 0, 0, 0, 1, 0])[0, zeta] == height


@settings(max_examples=300, deadline=None)
@given(name=st.sampled_from(NAMES), height=st.floats(-1.0, 5.0), torque=st.floats(-2000.0, 5000.0))
def test_start_is_a_stable_equilibrium_or_an_error(name: str, height: float, torque: float) -> None:
    parameters = parameter_sets()[name]
    reach = native.reach(parameters)
    try:
        state = native.equilibrium(parameters, (height, torque))
    except FmuError as refusal:
        assert f"{reach.height_low:.6g} m to {reach.height_high:.6g} m" in str(refusal)
        assert not 0.5 <= height <= 2.5 or not 0.0 <= torque <= 2000.0
    else:
        assert (
            np.abs(native.derivatives(parameters, state, (height, torque))).max() < 1e3 * tolerances.WBM_REST
        )
        assert reach.angle_low < state[0] < reach.angle_high
        poles = np.linalg.eigvals(native.linearise(parameters, (height, torque)).A)
        assert poles.real.max() < 0.0


@pytest.mark.parametrize("name", NAMES)
def test_operating_range_is_reached_at_every_torque_of_the_study(name: str) -> None:
    for height in np.linspace(0.5, 2.5, 21):
        for torque in (0.0, 1000.0, 1310.9, 2000.0):
            assert np.isfinite(native.equilibrium(parameter_sets()[name], (height, torque))).all()


@settings(max_examples=100, deadline=None)
@given(name=st.sampled_from(NAMES), heights=st.lists(st.floats(0.0, 4.0), min_size=1, max_size=4))
def test_steps_of_any_size_give_numbers_or_an_error(name: str, heights: list[float]) -> None:
    inputs = np.array([[1.5, 1310.9]] + [[height, 1310.9] for height in heights for _ in range(60)])
    try:
        assert np.isfinite(native.simulate(parameter_sets()[name], inputs)).all()
    except FmuError as refusal:
        assert "eta = " in str(refusal)
        assert "the linkage reaches heights from" in str(refusal)


def test_the_row_of_the_refused_height_is_named() -> None:
    inputs = np.tile((1.5, 1310.9), (50, 1))
    inputs[17, 0] = 4.25
    with pytest.raises(FmuError, match=r"row 17: .*eta = 4\.25 m is out of reach"):
        native.simulate(parameter_sets()["A"], inputs)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_inputs_that_are_no_numbers_are_refused(value: float) -> None:
    for inputs, named in (((value, 1310.9), "eta"), ((1.5, value), "M_pa")):
        with pytest.raises(FmuError, match=named):
            native.equilibrium(parameter_sets()["A"], inputs)


def test_a_linkage_that_does_not_close_is_refused() -> None:
    with pytest.raises(FmuError, match="do not close"):
        native.equilibrium(parameter_sets()["A"].changed(c=5.0), (1.5, 1310.9))


@pytest.mark.parametrize(
    ("sample_time", "inner_step"),
    [(1e-3, 7e-4), (1e-3, 2e-3), (0.02, 0.02), (1e-3, 0.0), (1e-3, np.nan), (np.inf, 5e-4), (1e-3, 1e-320)],
)
def test_unsuitable_steps_are_refused(sample_time: float, inner_step: float) -> None:
    with pytest.raises(FmuError, match="inner"):
        native.simulate(parameter_sets()["A"], [[1.5, 1310.9]], sample_time, inner_step)


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(FmuError, match="expected"):
        native.simulate(parameter_sets()["A"], [1.5, 1310.9])
    with pytest.raises(FmuError, match="state"):
        native.simulate(parameter_sets()["A"], [[1.5, 1310.9]], state=[0.0, 1.0])
