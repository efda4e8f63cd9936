"""The global linear models: the white-box model's own linearisation at whatever height is asked for."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from cosim.whole_path import WholePath
from cosimulation.candidates import head_forces, linearised
from cosimulation.fmu_file import open_fmu
from cosimulation.pantograph import INPUTS, SIGNALS, TORQUE
from fmu_builder.kernel import simulate
from fmus.wbm import native, parameter_sets
from tolerances import LINEARISED_POLES, LINEARISED_REST


@pytest.mark.parametrize(
    ("height", "identifier", "title"),
    [
        (1.25, "pantograph_linear_blow", "OP45"),
        (1.5, "pantograph_linear_op55_blow", "OP55"),
        (1.75, "pantograph_linear_op65_blow", "OP65"),
        (1.43, "pantograph_linear_1430mm_blow", "1.43 m"),
    ],
)
def test_linearised_at_any_height(blow: WholePath, height: float, identifier: str, title: str) -> None:
    with open_fmu(blow.white_box) as fmu:
        found = linearised("Blow", blow.data, fmu, blow.settings, head_forces("Blow"), height)
    assert (found.name, found.title) == (identifier, f"white-box model linearised at {title}")
    assert found.labels["route"] == f"linearised at {title}" and found.offset_subtracted
    assert found.parameter_set.kind == "linear"

    exact = native.linearise(parameter_sets()["Blow"], (height, TORQUE))
    (model,) = found.parameter_set.local_models
    poles = np.linalg.eigvals(np.asarray(model.A))
    expected = np.linalg.eigvals(scipy.linalg.expm(exact.A * 0.001))
    distance = np.abs(np.sort_complex(poles) - np.sort_complex(expected))
    assert distance.max() < LINEARISED_POLES

    rest = simulate(found.parameter_set, np.tile((height, TORQUE), (200, 1)))
    order = [found.parameter_set.output_names.index(name) for name in SIGNALS]
    assert np.ptp(rest, axis=0)[order].max() < LINEARISED_REST
    force = rest[-1, found.parameter_set.output_names.index("F_p")]
    xi = native.equilibrium(parameter_sets()["Blow"], (height, TORQUE))[native.STATES.index("xi")]
    assert abs(force - parameter_sets()["Blow"]["k_E"] * (xi - height)) < LINEARISED_REST


def test_the_demo_has_the_one_at_op45(blow: WholePath) -> None:
    with open_fmu(blow.white_box) as fmu:
        found = linearised("Blow", blow.data, fmu, blow.settings, head_forces("Blow"))
    assert found.parameter_set == blow.candidates["pantograph_linear_blow"].parameter_set
    assert found.parameter_set.input_names == INPUTS
