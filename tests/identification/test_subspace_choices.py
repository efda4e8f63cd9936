"""What the estimator decides by itself: stated, reasonable, and never against a setting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_plants import (
    THREE_MASS_OUTPUTS,
    asymmetric,
    asymmetric_data,
    recorded,
    three_mass_data,
)
from pydantic import ValidationError

from fmu_builder.errors import IdentificationError
from identification.data_set import DataSet
from identification.excitation import random_stream, with_measurement_noise
from identification.local_model import LocalModel
from identification.n4sid import N4sidSettings, identify
from identification.subspace import METHODS, SubspaceSettings, estimate
from identification.subspace.choices import PILOT
from identification.subspace.projection import clear_order

NAMES = asymmetric().inputs, asymmetric().outputs
INPUTS = ("eta", "M_pa")
NOISE = {"xi": 1e-5, "zeta": 1e-5, "xi_dot": 1e-3, "zeta_dot": 1e-3}


@pytest.mark.parametrize("level", [0.0, 1e-4, 1e-3, 1e-2, 0.1])
def test_order_is_found_at_any_noise(level: float) -> None:
    data = asymmetric_data(4, 6000)
    size = dict(zip(data.names, data.values.std(axis=0), strict=True))
    data = with_measurement_noise(data, {name: level * size[name] for name in ("angle", "speed")}, 4)
    model = estimate([data], *NAMES)
    assert model.order == 5
    first = model.diagnostics["choices"][0]
    assert (first["name"], first["value"]) == ("order", 5)
    assert first["reason"].startswith("the last clear drop of the singular values follows it")


@pytest.mark.parametrize("factor", [1.0, 10.0])
def test_order_of_lightly_damped_plant(factor: float) -> None:
    noise = {name: factor * size for name, size in NOISE.items()}
    data = with_measurement_noise(three_mass_data(3, duration=20.0), noise, 3)
    assert estimate([data], INPUTS, THREE_MASS_OUTPUTS).order == 6


def test_an_automatic_order_is_not_below_a_least_one() -> None:
    data = asymmetric_data(4, 6000)
    data = with_measurement_noise(
        data, {name: 0.1 * data.column(name).std() for name in ("angle", "speed")}, 4
    )
    model = estimate([data], *NAMES, SubspaceSettings(least_order=7))
    assert model.order == 7
    first = model.diagnostics["choices"][0]
    assert (first["name"], first["value"]) == ("order", 7)
    assert first["reason"].startswith(
        "not below least_order; the singular values show 5: the last clear drop"
    )
    assert estimate([data], *NAMES, SubspaceSettings(least_order=4)).order == 5
    assert estimate([data], *NAMES, SubspaceSettings(least_order=7, order=4)).order == 4


def test_rule_of_the_order() -> None:
    assert clear_order(np.array([1e6, 1e5, 1e4, 1e-1, 1e-2]), 0.5)[0] == 3
    # a weak but clear state after a larger drop: the last drop of at least half the largest counts
    assert clear_order(np.array([1e6, 1e3, 1e2, 1e-3]), 1.0)[0] == 3
    assert clear_order(np.array([1e6, 1e2, 3e1, 1e1, 1e-3]), 9.0)[0] == 1
    # drops below the noise level are none, nor is the end of what is shown
    assert clear_order(np.array([1e5, 1e4, 1e-2, 1e-9, 1e-20]), 1e-1)[0] == 2
    assert clear_order(np.array([1e5, 1e4]), 1e-1)[0] == 2
    with pytest.raises(IdentificationError, match="no singular value exceeds the noise"):
        clear_order(np.array([0.4, 0.3]), 0.5)


def test_outputs_that_do_not_follow_the_inputs_have_no_order() -> None:
    data = asymmetric_data(1, 4000)
    noise = random_stream(8).standard_normal((4000, 2))
    deaf = replace(data, values=np.column_stack([data.values[:, :3], noise]))
    with pytest.raises(IdentificationError, match="exceeds the noise"):
        estimate([deaf], *NAMES)


@pytest.mark.parametrize("method", METHODS)
def test_noise_alone_has_no_order_by_any_method(method: str) -> None:
    """One input and one output: few singular values, most of them among those shown."""
    for seed in range(4):
        noise = random_stream(seed, 5).standard_normal((4000, 2))
        data = DataSet("noise", 0.01, ("drive", "speed"), ("", ""), noise)
        with pytest.raises(IdentificationError, match="exceeds the noise"):
            estimate([data], ("drive",), ("speed",), SubspaceSettings(method=method))


def test_block_rows_are_those_of_the_smallest_error() -> None:
    data = with_measurement_noise(three_mass_data(3, duration=20.0), NOISE, 3)
    model = estimate([data], INPUTS, THREE_MASS_OUTPUTS, SubspaceSettings(order=6))
    search = dict(model.diagnostics["block_row_search"])
    assert len(search) > 1
    assert model.diagnostics["block_rows"] == min(search, key=lambda s: search[s])
    for block_rows, error in search.items():
        chosen = SubspaceSettings(order=6, block_rows=int(block_rows))
        given = estimate([data], INPUTS, THREE_MASS_OUTPUTS, chosen)
        assert given.diagnostics["simulation_error"] == pytest.approx(error, rel=1e-9)
        assert given.diagnostics["choices"] == [] and given.diagnostics["block_row_search"] == []
    line = model.diagnostics["choices"][0]
    assert (line["name"], line["value"]) == ("block_rows", model.diagnostics["block_rows"])
    assert line["reason"].startswith("smallest simulation error")
    assert all(f"{s}: " in line["reason"] for s in search)


def test_short_data_get_short_windows() -> None:
    model = estimate([asymmetric_data(1, 240)], *NAMES)
    assert model.order == 5 and model.diagnostics["block_rows"] <= 20
    tight = estimate([asymmetric_data(1, 100)], *NAMES, SubspaceSettings(order=5))
    assert tight.diagnostics["block_rows"] <= 8


def test_inputs_that_excite_few_samples_get_short_windows() -> None:
    """A sum of sines excites only as many samples in a row as it has lines (eq. 3.71)."""
    data = asymmetric_data(1, 4000)
    time = np.arange(4000) * data.sample_time
    lines = random_stream(5).permutation(np.arange(1, 46) * 2.1)
    values = data.matrix(asymmetric().inputs) * 0.0 + asymmetric().input_operating_point
    for k in range(3):
        phases = random_stream(6, k).uniform(0.0, 2.0 * np.pi, 15)
        values[:, k] += np.sin(2.0 * np.pi * np.outer(time, lines[15 * k : 15 * k + 15]) + phases).sum(axis=1)
    inputs = replace(data, names=data.names[:3], units=data.units[:3], values=values)
    data = recorded(asymmetric(), inputs, ("rad", "rad/s"))
    with pytest.raises(IdentificationError, match=r"do not excite 100 samples in a row .*eq\. 3\.71"):
        estimate([data], *NAMES, SubspaceSettings(order=5, block_rows=50))
    model = estimate([data], *NAMES)
    assert model.order == 5 and model.diagnostics["block_rows"] <= 15
    assert model.diagnostics["excitation"]["samples_in_a_row"] == 2 * model.diagnostics["block_rows"]


def test_a_refusal_names_all_windows_that_were_tried() -> None:
    """A sine excites two samples in a row, and five block rows are the shortest that are tried."""
    data = asymmetric_data(1, 4000)
    values = data.values.copy()
    values[:, 1] = -2.0 + np.sin(2.0 * np.pi * 3.0 * data.time)
    slow = [replace(data, values=values)]
    message = r"do not excite 10 samples in a row .* with 5 block rows, nor better with 7, 10, .*, 50\."
    with pytest.raises(IdentificationError, match=message):
        estimate(slow, *NAMES)
    with pytest.raises(IdentificationError, match=r"100 samples .* with 50 block rows, nor better with 5, 7"):
        estimate(slow, *NAMES, SubspaceSettings(order=5))
    with pytest.raises(IdentificationError, match=r"do not excite 40 samples in a row"):
        estimate(slow, *NAMES, SubspaceSettings(order=5, block_rows=20))


def test_what_is_set_is_not_chosen() -> None:
    data = three_mass_data(3, duration=6.0)
    model = estimate([data], INPUTS, THREE_MASS_OUTPUTS, SubspaceSettings(order=6, block_rows=31))
    assert model.diagnostics["choices"] == [] and model.diagnostics["block_rows"] == 31
    rows = estimate([data], INPUTS, THREE_MASS_OUTPUTS, SubspaceSettings(block_rows=31)).diagnostics
    (only,) = rows["choices"]
    assert (only["name"], only["value"]) == ("order", 6)
    for wrong in ({"order": 0}, {"block_rows": 1}, {"order": "many"}, {"method": "SVD"}):
        with pytest.raises(ValidationError):
            SubspaceSettings(**wrong)


def test_diagnostics_say_what_was_seen() -> None:
    diagnostics = estimate([asymmetric_data(1)], *NAMES, SubspaceSettings(order=5, block_rows=20)).diagnostics
    assert (diagnostics["method"], diagnostics["instrument"], diagnostics["weighting"]) == (
        "CVA",
        "past",
        "cva",
    )
    values = diagnostics["singular_values"]
    assert values == sorted(values, reverse=True) and values[4] > 0.9 > 1e-3 > values[5]
    excitation = diagnostics["excitation"]
    assert excitation["rank"] == 5 + 20 * 3 and 0.1 < excitation["smallest_eigenvalue"] < 1.0
    assert len(diagnostics["strengths"]) == len(values) and diagnostics["seen_block_rows"] == 20


def test_what_is_seen_is_what_the_order_was_read_from() -> None:
    """Block rows that are chosen after the order do not change the strengths that are shown for it."""
    data = with_measurement_noise(three_mass_data(3, duration=20.0), NOISE, 3)
    found = estimate([data], INPUTS, THREE_MASS_OUTPUTS).diagnostics
    order, _ = clear_order(np.array(found["strengths"]), found["noise_level"])
    assert order == found["order"] and found["seen_block_rows"] == PILOT
    again = SubspaceSettings(order=6, block_rows=PILOT)
    given = estimate([data], INPUTS, THREE_MASS_OUTPUTS, again).diagnostics
    assert found["strengths"] == pytest.approx(given["strengths"], rel=1e-6)


def test_local_models_that_are_blended_get_one_order() -> None:
    """A third mode far weaker in one height: alone it would get fewer states."""
    few = asymmetric()
    hidden = LocalModel(
        few.A[:4, :4], few.B[:4], few.C[:, :4], few.D, 0.004, *NAMES,
        few.input_operating_point, few.output_operating_point,
    )  # fmt: skip
    data = []
    for centre, plant in ((-6.0, few), (2.0, hidden)):
        values = [0.5, centre, 30.0] + random_stream(4).standard_normal((3000, 3)) * [0.1, 0.5, 2.0]
        base = asymmetric_data(1, 3000)
        inputs = replace(base, names=NAMES[0], units=base.units[:3], values=values)
        clean = recorded(plant, inputs, ("rad", "rad/s"))
        data.append(with_measurement_noise(clean, {"angle": 1e-3, "speed": 1e-3}, 1, (int(centre) + 9,)))
    chosen = N4sidSettings(
        inputs=NAMES[0], outputs=NAMES[1], scheduling="load", low=-10.0, high=6.0, local_models=2,
        operating_point={"drive": 0.5, "load": -2.0, "heat": 30.0},
    )  # fmt: skip
    assert estimate([data[1]], *NAMES).order == 4
    local = identify(data, chosen)
    assert [model.order for model in local.models] == [5, 5]
    orders = [choice for choice in local.choices if choice.name == "subspace.order"]
    assert [(choice.place, choice.value) for choice in orders] == [("load = -6", 5), ("load = 2", 5)]
    assert orders[1].reason == "the middle of the local models' orders, 4 by itself"


def test_settings_that_do_not_fit_together_are_told_at_once() -> None:
    with pytest.raises(
        ValidationError, match=r"order must be 1 \.\. 200; block_rows must be at least 2; wei"
    ):
        SubspaceSettings(order=0, block_rows=1, method="MOESP", weighting="cva")


@pytest.mark.parametrize("factorisation", ["covariance", "qr"])
def test_a_short_experiment_does_not_shorten_the_windows_of_a_long_one(factorisation: str) -> None:
    """It is too short for windows of its own; B is fitted to it all the same."""
    chosen = SubspaceSettings(factorisation=factorisation)
    noisy = []
    for seed, rows in ((1, 6000), (2, 60)):
        data = asymmetric_data(seed, rows)
        size = dict(zip(data.names, data.values.std(axis=0), strict=True))
        noise = {name: 0.05 * size[name] for name in ("angle", "speed")}
        noisy.append(with_measurement_noise(data, noise, seed))
    alone = estimate(noisy[:1], *NAMES, chosen)
    for together in (estimate(noisy, *NAMES, chosen), estimate(noisy[::-1], *NAMES, chosen)):
        assert together.order == alone.order == 5
        assert together.diagnostics["block_rows"] == alone.diagnostics["block_rows"]
        assert together.diagnostics["rows"] == 6060
        assert together.diagnostics["simulation_error"] < 1.1 * alone.diagnostics["simulation_error"]
