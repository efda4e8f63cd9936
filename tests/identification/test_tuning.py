"""What whole-range training data decide, against networks whose numbers are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from local_networks import FORCE, HEIGHTS, INPUTS, local_models, recorded
from pydantic import ValidationError

from fmu_builder.errors import IdentificationError
from fmu_builder.kernel import simulate
from identification.excitation import random_stream, with_measurement_noise
from identification.n4sid import network
from identification.network import NetworkSettings
from identification.objective import Candidate, Objective, transformed
from identification.tuning import TuningSettings, tuned_network
from tolerances import BITS, SAME_NETWORK, TUNED_NUMBER

SCALES = (0.8, 1.0, 1.15, 1.5)
LOCAL = local_models(SCALES)
WARP = (-0.2, 0.08)
FINE = TuningSettings(iterations=30, tolerance=1e-9)


def settings_of(**changes: Any) -> NetworkSettings:
    return NetworkSettings(**{"validity": "cubic_warp", **changes})


def test_the_warp_that_made_the_data_is_found() -> None:
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3)
    found = tuned_network("found", LOCAL, [data], settings_of(), [FORCE], FINE)
    assert found.settings.warp == pytest.approx(WARP, rel=TUNED_NUMBER)
    assert found.parameter_set == network("found", LOCAL, found.settings, [FORCE])
    (choice,) = found.choices
    assert (
        choice.name == "warp" and "F_p" in choice.reason and str(choice).startswith("warp = (-0.2, 0.08): ")
    )


@pytest.mark.parametrize("blending", ["output", "parameter"])
def test_the_k_sigma_that_made_the_data_is_found(blending: str) -> None:
    truth = settings_of(validity="gaussian", k_sigma=0.42, blending=blending)
    data = recorded(network("truth", LOCAL, truth), 3)
    tuned = truth.model_copy(update={"k_sigma": "tuned"})
    found = tuned_network("found", LOCAL, [data], tuned, tuning=FINE)
    assert found.settings.k_sigma == pytest.approx(0.42, rel=TUNED_NUMBER)


def test_the_deviation_gain_that_made_the_data_is_found() -> None:
    truth = settings_of(validity="cubic", deviation_output="zeta", deviation_gain=0.8)
    data = recorded(network("truth", LOCAL, truth), 3)
    tuned = truth.model_copy(update={"deviation_gain": "tuned"})
    found = tuned_network("found", LOCAL, [data], tuned, tuning=FINE)
    assert found.settings.deviation_gain == pytest.approx(0.8, rel=TUNED_NUMBER)


def test_coordinates_that_move_with_the_height_are_found() -> None:
    """Models whose coordinates drift apart blend badly; the drift is found from the data."""
    local = local_models(SCALES, transforms=[np.diag([400.0] * 3 + [20.0] * 3)] * 4)  # states of one size
    cubic = settings_of(validity="cubic")
    partition = local.partition(cubic)
    generator = 0.1 * random_stream(2).standard_normal((6, 6))
    moved = replace(local, models=tuple(transformed(local.models, partition, generator)))
    data = recorded(network("truth", local, cubic), 3, 2.0)
    start = Objective(network("start", moved, cubic), [data]).cost(Candidate(partition))
    tuning = TuningSettings(iterations=8)
    tuned = settings_of(validity="cubic", coordinates="tuned")
    found = tuned_network("found", moved, [data], tuned, tuning=tuning)
    end = Objective(found.parameter_set, [data]).cost(Candidate(partition))
    assert end < 0.01 * start
    assert found.choices[0].name == "coordinates" and found.settings.coordinates == "aligned"
    frequencies = np.array([1.0, 12.0])
    for one, other in zip(found.local.models, local.models, strict=True):  # the models are the same
        expected = other.frequency_response(frequencies)
        assert np.abs(one.frequency_response(frequencies) - expected).max() < 1e-9


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "changes", [{}, {"validity": "gaussian", "k_sigma": "tuned"}, {"coordinates": "tuned"}]
)
def test_tuning_never_ends_above_its_start(seed: int, changes: dict[str, Any]) -> None:
    """One step on noisy data of another plant: the cost does not rise."""
    other = local_models((1.1, 0.9, 1.4, 1.2))
    data = recorded(network("other", other, settings_of(validity="hat")), seed, 1.0)
    data = with_measurement_noise(data, {"xi": 1e-4, "zeta_dot": 1e-2}, seed)
    settings = settings_of(**changes)
    found = tuned_network("found", LOCAL, [data], settings, [FORCE], TuningSettings(iterations=1))
    neutral = settings_of(**{**changes, "warp": (0.0, 0.0), "coordinates": "aligned"})
    if "k_sigma" in changes:
        neutral = neutral.model_copy(update={"k_sigma": 0.5})
    example = network("start", LOCAL, neutral, [FORCE])
    start = Objective(example, [data]).cost(Candidate(example.partition))
    end = Objective(found.parameter_set, [data]).cost(Candidate(found.parameter_set.partition))
    assert end <= start * (1.0 + 1e-9)


def test_only_the_training_data_that_are_passed_count() -> None:
    """Columns the network does not have, such as a force without noise, are not looked at; the data stay."""
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 6.0)
    before = data.content_hash
    other = data.with_columns(("F_p",), ("N",), 1e6 * random_stream(1).standard_normal((len(data), 1)))
    one, two = (tuned_network("net", LOCAL, [d], settings_of(), [FORCE]) for d in (data, other))
    assert one.parameter_set == two.parameter_set and one.choices == two.choices
    assert data.content_hash == before


def test_the_better_blending_is_chosen_and_said() -> None:
    smooth = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 6.0)
    found = tuned_network("net", LOCAL, [smooth], settings_of(blending="best"), [FORCE])
    assert found.settings.blending == found.parameter_set.blending == "parameter"
    assert found.choices[-1].name == "blending" and "output" in found.choices[-1].reason
    random = random_stream(7)
    bases = [np.linalg.qr(random.standard_normal((6, 6)))[0] for _ in HEIGHTS]
    raw = local_models(SCALES, transforms=bases)
    found = tuned_network("net", raw, [smooth], settings_of(blending="best"), [FORCE])
    assert found.settings.blending == found.parameter_set.blending == "output"


def test_without_training_data_the_choices_fall_back_and_say_so() -> None:
    found = tuned_network("net", LOCAL, [], settings_of(blending="best"), [FORCE])
    assert found.parameter_set.partition.validity == "cubic" and found.parameter_set.blending == "parameter"
    assert [choice.name for choice in found.choices] == ["validity", "blending"]
    assert all("no whole-range training data" in choice.reason for choice in found.choices)
    gaussian = tuned_network("net", LOCAL, [], settings_of(validity="gaussian", k_sigma="tuned"))
    assert gaussian.parameter_set.partition.k_sigma == 1.0 / 3.0


def test_given_numbers_are_kept() -> None:
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 3.0)
    given = settings_of(warp=(0.1, 0.0))
    found = tuned_network("net", LOCAL, [data], given, [FORCE])
    assert found.choices == () and found.parameter_set == network("net", LOCAL, given, [FORCE])


CANDIDATES = {
    "warp": (settings_of(warp=WARP), settings_of(warp=(0.1, -0.05)), False),
    "output": (
        settings_of(warp=WARP, blending="output"),
        settings_of(warp=(0.1, 0.0), blending="output"),
        False,
    ),
    "gauss": (settings_of(validity="gaussian"), settings_of(validity="gaussian", k_sigma=0.6), False),
    "gain": (
        settings_of(warp=WARP, deviation_output="zeta", deviation_gain=0.0),
        settings_of(warp=WARP, deviation_output="zeta", deviation_gain=0.7),
        False,
    ),
    "coordinates": (settings_of(warp=WARP), settings_of(warp=WARP), True),
    "gauss, coordinates": (settings_of(validity="gaussian"), settings_of(validity="gaussian"), True),
}


@pytest.mark.parametrize("name", CANDIDATES)
def test_the_search_computes_what_the_network_would(name: str) -> None:
    """Residuals of a candidate are those of the network built from its numbers."""
    start, end, moves = CANDIDATES[name]
    data = recorded(network("truth", LOCAL, settings_of(validity="hat")), 5, 2.0)
    partition = LOCAL.partition(end)
    generator = 0.1 * random_stream(4).standard_normal((6, 6)) if moves else None
    local = LOCAL
    if generator is not None:
        local = replace(LOCAL, models=tuple(transformed(LOCAL.models, partition, generator)))
    objective = Objective(network("net", LOCAL, start, [FORCE]), [data], ("xi_dot", "F_p"))
    found = objective.residuals(Candidate(partition, generator))
    outputs = simulate(network("net", local, end, [FORCE]), data.matrix(INPUTS))[:, [1, 4]]
    force = 1e5 * (data.column("xi") - data.column("eta"))
    target = np.column_stack([data.column("xi_dot"), force])
    rows = slice(len(data) // 4, None)
    spread = np.sqrt(((target[rows] - target[rows].mean(axis=0)) ** 2).sum(axis=0))
    expected = ((outputs - target)[rows] / spread).ravel()
    assert found is not None and found.shape == expected.shape
    limit = SAME_NETWORK if moves else BITS
    assert np.abs(found - expected).max() <= limit * np.abs(expected).max() + (1e-12 if moves else 1e-15)
    fits = 1.0 - np.sqrt((expected.reshape(-1, 2) ** 2).sum(axis=0))
    assert objective.cost(Candidate(partition, generator)) == pytest.approx(((1.0 - fits) ** 2).sum())


def test_what_cannot_be_tuned_is_refused() -> None:
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    with pytest.raises(IdentificationError, match="no such output"):
        tuned_network("net", LOCAL, [data], settings_of(), [FORCE], TuningSettings(signals=("F_H",)))
    with pytest.raises(IdentificationError, match="warp still to be chosen"):
        network("net", LOCAL, settings_of())
    with pytest.raises(ValidationError, match="deviation_output"):
        NetworkSettings(deviation_gain="tuned")
    assert settings_of(k_sigma="tuned").open_choices == ("warp",)  # only what the validity uses
