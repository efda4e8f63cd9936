"""A tree of ARX models is an FMU like every other network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from arx_plants import INPUTS, SAMPLE_TIME, SETTINGS, data_set, drawn_inputs, known_network, run
from fmpy.validation import validate_fmu
from fmu_runner import run_fmu

import tolerances
from fmu_builder.compiler import host_platform
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import build_llmn
from identification.lolimot import as_parameter_set


def test_the_fmu_of_an_arx_network_is_the_difference_equation(tmp_path: Path) -> None:
    """The bits of the kernel, and the numbers of a plain loop over the coefficients."""
    training = drawn_inputs(1, 50)
    built = as_parameter_set("tree", known_network(SETTINGS), [data_set(training, run(training))])
    fmu = build_llmn(built, tmp_path / "tree.fmu", (host_platform(),))
    assert validate_fmu(str(fmu)) == []
    u = drawn_inputs(2, 200)
    u[:4] = u[0]
    found = run_fmu(fmu, u, ["y"], SAMPLE_TIME)
    assert np.abs(found - simulate(built, u)).max() == tolerances.BITS
    rest = float(found[0, 0] - known_network().output_point)
    expected = run(u, (rest, rest, rest))
    assert np.abs(found[:, 0] - expected).max() <= tolerances.SAME_NETWORK * np.abs(expected).max()
    assert built.input_names == INPUTS
