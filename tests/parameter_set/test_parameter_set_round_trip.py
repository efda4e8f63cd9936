"""Reading, writing and identity of a parameter set."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import networks
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_builder.errors import OutputError, ParameterSetError
from fmu_builder.parameter_set import (
    LocalLinearModel,
    ParameterSet,
    canonical_json,
    load,
    model_hash,
    nested,
    save,
)


def content_of(parameter_set: ParameterSet) -> dict[str, Any]:
    """The file as a JSON reader sees it."""
    return json.loads(parameter_set.canonical_json())


@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_a_file_comes_back_with_every_bit(variant: tuple[str, str, str], tmp_path: Path) -> None:
    original = networks.network(1, *variant)
    path = save(original, tmp_path / "set.json")
    again = load(path)
    assert again == original
    assert again.canonical_json() == original.canonical_json() == path.read_text(encoding="utf-8")
    assert again.local_models[2].A[1][3].hex() == original.local_models[2].A[1][3].hex()


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_finite_number_survives_the_text(number: float) -> None:
    text = canonical_json({"matrix": [[number, -number]]})
    again = json.loads(text)["matrix"][0]
    assert [value.hex() for value in again] == [number.hex(), (-number).hex()]


def test_the_compact_text_has_the_same_content() -> None:
    parameter_set = networks.network(1)
    text = parameter_set.compact_json()
    assert json.loads(text) == json.loads(parameter_set.canonical_json())
    assert text.count("\n") == 1 and len(text) < len(parameter_set.canonical_json())


def test_the_text_is_canonical() -> None:
    assert canonical_json({"b": [1.0, 2.0], "a": {}}) == canonical_json({"a": {}, "b": (1.0, 2.0)})
    assert canonical_json({"b": [[0.1], []], "ä": None}) == '{\n "b": [\n  [0.1],\n  []\n ],\n "ä": null\n}\n'
    with pytest.raises(ValueError, match="JSON"):
        canonical_json([math.nan])


def test_arrays_become_tuples_without_loss() -> None:
    array = np.array([[0.1, 2.0, -0.0], [1e-310, 3.0, 4.0]])
    assert nested(array) == ((0.1, 2.0, 0.0), (1e-310, 3.0, 4.0))
    model = LocalLinearModel(A=array, B=array, C=array, D=array)
    assert np.array(model.A).tobytes() == array.tobytes()


def test_it_cannot_be_changed() -> None:
    parameter_set = networks.network(1)
    with pytest.raises(ValueError, match="frozen"):
        parameter_set.name = "other"  # type: ignore[misc]
    with pytest.raises(ValueError, match="frozen"):
        parameter_set.local_models[0].A = ()  # type: ignore[misc]


def changed(content: dict[str, Any], place: str, value: Any) -> ParameterSet:
    """The parameter set with one value replaced; `place` like local_models.0.A.1.2."""
    *path, last = [int(step) if step.isdigit() else step for step in place.split(".")]
    target = content
    for step in path:
        target = target[step]
    target[last] = value
    return ParameterSet(**content)


OUTSIDE_THE_HASH = {
    "kind": "surrogate",
    "inputs.0.description": "height",
    "outputs.1.description": "speed",
    "outputs.1.maximum": 10.0,
    "derived_outputs.0.description": "force",
    "derived_outputs.0.parameters.stiffness.description": "contact",
    "provenance": {"seed": 3},
    "scores": [{"fit": 99.0}],
    "documentation": "text",
    "declared_unstable": True,
}
INSIDE_THE_HASH = {
    "name": "other",
    "sample_time": 2e-3,
    "blending": "parameter",
    "inputs.0.unit": "mm",
    "inputs.0.operating_point": math.nextafter(1.3, 2.0),
    "inputs.2.minimum": -1.9,
    "derived_outputs.0.name": "thrust",
    "outputs.2.operating_point": 0.7,
    "local_models.3.A.0.1": 0.125,
    "local_models.0.B.0.1": 0.125,
    "local_models.1.D.2.0": 0.125,
    "local_models.1.g.2": 0.125,
    "offsets.static_map.values.4.1": 0.125,
    "partition.spreads.1": 0.5,
    "derived_outputs.0.parameters.stiffness.value": 49999.0,
    "derived_outputs.0.terms.1.sign": 1,
}


@pytest.mark.parametrize("place", OUTSIDE_THE_HASH)
def test_what_the_fmu_does_not_compute_with_stays_out_of_the_hash(place: str) -> None:
    original = networks.network(1, blending="output")
    other = changed(content_of(original), place, OUTSIDE_THE_HASH[place])
    assert other != original
    assert model_hash(other) == model_hash(original)


@pytest.mark.parametrize("place", INSIDE_THE_HASH)
def test_what_the_fmu_computes_with_is_in_the_hash(place: str) -> None:
    original = networks.network(1, blending="output")
    assert changed(content_of(original), place, INSIDE_THE_HASH[place]).model_hash() != original.model_hash()


def test_the_node_table_is_in_the_hash() -> None:
    original = networks.network(1, validity="hat")
    content = content_of(original)
    assert changed(content, "node_table.models.2.A.0.0", 0.125).model_hash() != original.model_hash()


def test_a_changed_copy_is_checked() -> None:
    original = networks.network(1)
    assert original.replaced(documentation="text").documentation == "text"
    with pytest.raises(ParameterSetError, match="sample_time"):
        original.replaced(sample_time=-1.0)


def test_nothing_is_written_where_nothing_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="file"):
        save(networks.network(1), tmp_path / "file" / "set.json")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


NO_PARAMETER_SETS = {
    "cut": '{"format": 1, "name"',
    "list": "[1, 2]",
    "empty": "",
    "zero byte": "\x00",
    "too deep": "[" * 100_000,
    "too many digits": '{"sample_time": ' + "9" * 5000 + "}",
}


@pytest.mark.parametrize("text", NO_PARAMETER_SETS.values(), ids=NO_PARAMETER_SETS)
def test_a_file_that_is_no_parameter_set_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "set.json"
    path.write_text(text)
    with pytest.raises(ParameterSetError, match=r"set\.json"):
        load(path)
    with pytest.raises(ParameterSetError, match=r"absent\.json"):
        load(tmp_path / "absent.json")
