"""Trained region and residual bands: outside the model hash, new in format 3, checked against the model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import certified_networks as networks
import pytest

from fmu_builder.errors import ParameterSetError
from fmu_builder.llmn_fmu import identity
from fmu_builder.parameter_set import ParameterSet, load

PLAIN = networks.oscillators()
INPUT, OUTPUT = PLAIN.input_names[0], PLAIN.output_names[-1]


def evidence() -> dict[str, Any]:
    """Two ranges of the scheduling input, three bands of frequency; one cell unknown."""
    rows = [[0.1, 0.2, None], [0.3, 0.1, 0.7]]
    band = {
        "model_hash": PLAIN.model_hash(), "output": OUTPUT, "positions": [0.5, 1.25, 2.5],
        "frequencies": [0.0, 5.0, 15.0, 500.0],
        "coverage": 0.95, "rms": rows, "bound": rows, "total": [0.9, 1.1], "amplitude": rows,
        "phase": [[-0.1, 0.2, None], [0.3, 0.1, -0.7]], "seconds": [40.5, 39.0],
        "held_out": ["wr_validation"],
    }  # fmt: skip
    region = {"rate": 3.6, "frequency_bands": {INPUT: [0.01, 25.0]}}
    return {"trained_region": region, "residual_bands": [band]}


def with_evidence(**changes: Any) -> ParameterSet:
    return PLAIN.replaced(**(evidence() | changes))


def test_evidence_stands_outside_the_model_hash_and_comes_back_bit_by_bit(tmp_path: Path) -> None:
    given = with_evidence()
    assert given.model_hash() == PLAIN.model_hash()
    assert load(given.save(tmp_path / "evidence.json")) == given


def test_a_region_in_another_order_makes_the_same_fmu_as_the_file(tmp_path: Path) -> None:
    spans = {name: [0.01, 25.0] for name in sorted(PLAIN.input_names, reverse=True)}
    given = with_evidence(trained_region={"rate": 3.6, "frequency_bands": spans})
    assert len(spans) > 1
    assert identity(load(given.save(tmp_path / "evidence.json"))) == identity(given)


@pytest.mark.parametrize("name", ["trained_region", "residual_bands"])
def test_format_2_knows_no_evidence(name: str) -> None:
    content = json.loads(with_evidence().canonical_json()) | {"format": 2}
    with pytest.raises(ParameterSetError) as caught:
        ParameterSet(**content)
    assert name in [problem.place for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("rate", -1.0),
        ("derived_outputs['nobody']", {"nobody": [0.0, 1.0]}),
        ("frequency_bands['nobody']", {"nobody": [0.0, 1.0]}),
        (f"frequency_bands[{INPUT!r}]", {INPUT: [2.0, 1.0]}),
        (f"frequency_bands[{INPUT!r}]", {INPUT: [-2.0, 1.0]}),
    ],
)
def test_a_region_that_does_not_fit_is_refused(place: str, value: Any) -> None:
    region = evidence()["trained_region"] | {place.partition("[")[0]: value}
    with pytest.raises(ParameterSetError) as caught:
        with_evidence(trained_region=region)
    assert [problem.place for problem in caught.value.problems] == [f"trained_region.{place}"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("output", "nobody"),
        ("positions[2]", [0.5, 1.25, 1.25]),
        ("frequencies[0]", [-1.0, 5.0, 15.0, 500.0]),
        ("frequencies[1]", [0.0, 1e-7, 15.0, 500.0]),
        ("coverage", 1.0),
        ("total", [0.9]),
        ("seconds", [40.5, -1.0]),
        ("rms", [[0.1, 0.2, 0.3]]),
        ("bound", [[0.1, 0.2], [0.3, 0.4, 0.5]]),
        ("amplitude", [[0.1, 0.2, -0.3], [0.3, 0.4, 0.5]]),
    ],
)
def test_bands_that_do_not_fit_are_refused(place: str, value: Any) -> None:
    band = evidence()["residual_bands"][0] | {place.partition("[")[0]: value}
    with pytest.raises(ParameterSetError) as caught:
        with_evidence(residual_bands=[band])
    assert [problem.place for problem in caught.value.problems] == [f"residual_bands[0].{place}"]


def test_bands_of_one_output_stand_there_once() -> None:
    with pytest.raises(ParameterSetError, match="twice"):
        with_evidence(residual_bands=evidence()["residual_bands"] * 2)


def test_bands_with_a_number_that_is_none_are_refused() -> None:
    bad = evidence()["residual_bands"][0] | {"rms": [[0.1, float("nan"), None], [0.1, 0.2, 0.3]]}
    with pytest.raises(ParameterSetError, match=r"residual_bands\[0\]\.rms\[0\]\[1\]"):
        with_evidence(residual_bands=[bad])


def test_bands_of_another_model_are_refused() -> None:
    foreign = evidence()["residual_bands"][0] | {"model_hash": "0" * 64}
    with pytest.raises(ParameterSetError) as caught:
        with_evidence(residual_bands=[foreign])
    assert [problem.place for problem in caught.value.problems] == ["residual_bands[0].model_hash"]


def test_bands_do_not_survive_a_change_of_the_model() -> None:
    given = with_evidence()
    assert given.replaced(documentation="text", scores=()).residual_bands == given.residual_bands
    changed = given.replaced(name="another")
    assert changed.residual_bands == () and changed.trained_region == given.trained_region
    edited = json.loads(given.canonical_json()) | {"name": "another"}
    with pytest.raises(ParameterSetError, match="another model"):
        ParameterSet(**edited)
