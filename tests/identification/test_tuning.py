"""What whole-range training data decide, against networks whose numbers are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from local_networks import FORCE, HEIGHTS, INPUTS, local_models, recorded
from pydantic import ValidationError

from fmu_builder.errors import DataError, IdentificationError
from fmu_builder.kernel import simulate
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import random_stream, with_measurement_noise
from identification.n4sid import LocalModels, network
from identification.network import NetworkSettings
from identification.objective import Candidate, Objective, transformed
from identification.tuning import TuningSettings, tuned_network
from tolerances import BITS, SAME_NETWORK, SAME_SEARCH, TUNED_NUMBER

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
    assert found.parameter_set == network("found", LOCAL.trained_on([data]), found.settings, [FORCE])
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


@pytest.mark.parametrize("coordinates", ["aligned", "tuned"])
def test_state_coordinates_of_the_local_models_do_not_matter(coordinates: str) -> None:
    other = local_models((1.1, 0.9, 1.4, 1.2))
    data = recorded(network("other", other, settings_of(validity="hat")), 3, 2.0)
    settings = settings_of(validity="cubic_warp", coordinates=coordinates)
    common = np.diag([5.0, 0.3, 1.0, 2.0, 0.1, 7.0]) @ random_stream(5).standard_normal((6, 6))
    mixed = local_models(SCALES, transforms=[common] * 4)
    tuning = TuningSettings(iterations=3)
    outputs = []
    for local in (LOCAL, mixed):
        found = tuned_network("net", local, [data], settings, tuning=tuning).parameter_set
        outputs.append(simulate(found, data.matrix(INPUTS)))
    difference = (outputs[1] - outputs[0]) / outputs[0].std(axis=0)
    assert np.abs(difference).max() < SAME_SEARCH


def test_coordinates_of_many_states_are_left_as_they_are_and_the_reason_told() -> None:
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3)
    asked = settings_of(coordinates="tuned")
    low = FINE.model_copy(update={"largest_order": 5})
    found = tuned_network("found", LOCAL, [data], asked, [FORCE], low)
    without = tuned_network("found", LOCAL, [data], settings_of(), [FORCE], FINE)
    assert found.parameter_set == without.parameter_set and found.settings.coordinates == "aligned"
    told, *others = found.choices
    assert told.name == "coordinates" and "36 numbers" in told.reason and "largest_order" in told.reason
    assert tuple(others) == without.choices


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


def test_no_candidate_is_simulated_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    simulated = Objective.residuals

    def counted(self: Objective, candidate: Candidate) -> Array | None:
        seen.append((self, candidate.partition.warp))
        return simulated(self, candidate)

    monkeypatch.setattr(Objective, "residuals", counted)
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    tuned_network("net", LOCAL, [data], settings_of(blending="best"), tuning=FINE)
    assert len(seen) > 10 and len(set(seen)) == len(seen)


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


def test_a_blending_has_the_same_bits_whether_or_not_it_was_compared() -> None:
    smooth = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    bases = [np.linalg.qr(random_stream(7, k).standard_normal((6, 6)))[0] for k in range(4)]
    raw, once = local_models(SCALES, transforms=bases), TuningSettings(iterations=1)
    chosen = settings_of(coordinates="tuned", blending="best")
    compared = tuned_network("net", raw, [smooth], chosen, [FORCE], once)
    alone = tuned_network("net", raw, [smooth], settings_of(blending="output"), [FORCE], once)
    assert compared.settings.blending == "output"
    assert compared.parameter_set.local_models == alone.parameter_set.local_models


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
    folded = settings_of(warp=(5.0, 0.0), blending="best")
    with pytest.raises(IdentificationError, match="makes the warped variable fall"):
        tuned_network("net", LOCAL, [data], folded)
    twice = replace(LOCAL, centres=np.array([0.75, 1.25, 1.25, 2.25]))
    with pytest.raises(IdentificationError, match="do not ascend"):
        network("net", twice, settings_of(validity="hat"))
    with pytest.raises(ValidationError, match="deviation_output"):
        NetworkSettings(deviation_gain="tuned")
    nowhere: list[dict[str, Any]] = [
        {"k_sigma": np.inf}, {"warp": (np.nan, 0.0)}, {"corner_frequency": np.inf},
        {"deviation_gain": np.nan, "deviation_output": "zeta"},
    ]  # fmt: skip
    for changes in nowhere:
        with pytest.raises(ValidationError, match="finite"):
            settings_of(**changes)
    assert settings_of(k_sigma="tuned").open_choices == ("warp",)  # only what the validity uses


def test_a_single_local_model_leaves_nothing_to_tune() -> None:
    alone = local_models((1.0,), (1.5,))
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    found = tuned_network("net", alone, [data], settings_of(blending="best"), [FORCE])
    assert [(choice.name, choice.value) for choice in found.choices] == [
        ("warp", (0.0, 0.0)),
        ("blending", "parameter"),
    ]
    assert "nothing to blend" in found.choices[0].reason
    gaussian = settings_of(validity="gaussian", k_sigma="tuned", coordinates="tuned")
    found = tuned_network("net", alone, [data], gaussian)
    assert [choice.name for choice in found.choices] == ["k_sigma", "coordinates"]


def test_rounding_does_not_choose_the_blending() -> None:
    """One model is the same network by either blending; in half of the cases rounding favours the second."""
    for scale in (0.8, 0.9, 1.1, 1.3):
        alone = local_models((scale,), (1.5,))
        for seed in range(4):
            data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), seed, 1.0)
            found = tuned_network("net", alone, [data], settings_of(blending="best"), [FORCE])
            assert found.settings.blending == "parameter" and "no larger" in found.choices[-1].reason


def test_a_number_without_influence_is_no_reason_to_fail() -> None:
    """Far beyond the range the schedule is clipped, whatever the gain of the deviation."""
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    beyond = replace(data, values=data.values + 50.0 * (np.array(data.names) == "eta"))
    settings = settings_of(validity="cubic", deviation_output="zeta", deviation_gain="tuned")
    found = tuned_network("net", LOCAL, [beyond], settings)
    assert found.settings.deviation_gain == 0.0


def test_a_signal_that_rests_has_no_fit_and_does_not_count() -> None:
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    values = data.values.copy()
    values[:, data.names.index("zeta")] = 0.1  # its mean is not 0.1 to the last bit
    resting = replace(data, values=values)
    found = tuned_network("net", LOCAL, [resting], settings_of(), [FORCE])
    assert "xi, xi_dot, zeta_dot, F_p" in found.choices[0].reason
    named = TuningSettings(signals=("xi", "zeta"))
    with pytest.raises(IdentificationError, match="zeta: constant in the whole-range training data"):
        tuned_network("net", LOCAL, [resting], settings_of(), [FORCE], named)
    with pytest.raises(IdentificationError, match="constant"):
        tuned_network("net", LOCAL, [data.rows(0, 1)], settings_of(), [FORCE])


def test_training_data_on_another_scale_are_refused_all_at_once() -> None:
    data = recorded(network("truth", LOCAL, settings_of(warp=WARP)), 3, 2.0)
    units = ("mm", *data.units[1:])
    with pytest.raises(DataError) as refused:
        tuned_network("net", LOCAL, [data, replace(data, sample_time=0.01, units=units)], settings_of())
    assert [problem.what for problem in refused.value.problems] == [
        "has the sample time 0.01 s, not 0.001 s like the others",
        "has 'eta' in 'mm', the others in 'm'",
    ]


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_the_deviation_gain_does_not_depend_on_the_unit_of_the_height(unit: float) -> None:
    """The search sees the same numbers whatever the scheduling input is counted in."""
    settings = settings_of(validity="cubic", deviation_output="zeta", deviation_gain="tuned")
    data = recorded(network("truth", LOCAL, settings_of(validity="hat")), 3, 4.0)
    found = tuned_network("net", LOCAL, [data], settings)
    scaled = tuned_network("net", *in_unit_of_height(LOCAL, data, unit), settings)
    assert scaled.settings.deviation_gain == pytest.approx(
        unit * found.settings.deviation_gain, rel=TUNED_NUMBER
    )


def in_unit_of_height(local: LocalModels, data: DataSet, unit: float) -> tuple[LocalModels, list[DataSet]]:
    """Local models and data with eta counted in 1 / unit metres."""
    size = np.array([unit, 1.0])
    models = tuple(
        replace(one, B=one.B / size, D=one.D / size, input_operating_point=one.input_operating_point * size)
        for one in local.models
    )
    eta, torque = local.signals[0]
    numbers = ("operating_point", "minimum", "maximum")
    eta = eta.model_copy(update={name: getattr(eta, name) * unit for name in numbers} | {"unit": ""})
    changed = {"low": unit * local.settings.low, "high": unit * local.settings.high}
    moved = replace(
        local,
        settings=local.settings.model_copy(update=changed),
        centres=local.centres * unit,
        models=models,
        signals=((eta, torque), local.signals[1]),
        static_map=replace(local.static_map, positions=local.static_map.positions * unit),
    )
    factor = np.where(np.array(data.names) == "eta", unit, 1.0)
    return moved, [replace(data, values=data.values * factor)]
