"""What a parameter set refuses, and that it names every problem at once."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import networks
import pytest

from fmu_builder.errors import ParameterSetError
from fmu_builder.parameter_set import FORMAT, ParameterSet, load

Content = dict[str, Any]


def gaussian() -> Content:
    return json.loads(networks.network(1, "scheduled_equilibrium", "parameter", "gaussian").canonical_json())


def tabled(blending: str = "parameter", offsets: str = "scheduled_equilibrium") -> Content:
    return json.loads(networks.network(1, offsets, blending, "hat").canonical_json())


def put(*path: Any) -> Callable[[Content], None]:
    """A change that puts the last argument to the place the others name."""

    def change(content: Content) -> None:
        *steps, last, value = path
        target: Any = content
        for step in steps:
            target = target[step]
        target[last] = value

    return change


def places(content: Content) -> list[str]:
    with pytest.raises(ParameterSetError) as refused:
        ParameterSet(**content)
    assert all(problem.what and problem.mend for problem in refused.value.problems)
    return [problem.place for problem in refused.value.problems]


NAN, INFINITY = float("nan"), float("inf")
GAUSSIAN_CASES: dict[str, tuple[Callable[[Content], None], str]] = {
    "A not square": (put("local_models", 2, "A", [[0.1, 0.2]]), "local_models[2].A"),
    "B transposed": (put("local_models", 0, "B", [[0.0] * 5] * 3), "local_models[0].B"),
    "C transposed": (put("local_models", 0, "C", [[0.0] * 3] * 5), "local_models[0].C"),
    "D too wide": (put("local_models", 1, "D", [[0.0] * 4] * 3), "local_models[1].D"),
    "ragged": (put("local_models", 1, "C", [[0.0] * 5, [0.0] * 4, [0.0] * 5]), "local_models[1].C"),
    "g too short": (put("local_models", 1, "g", [1.0]), "local_models[1].g"),
    "g missing": (put("local_models", 1, "g", None), "local_models[1].g"),
    "x0 without affine": (put("local_models", 1, "x0", [0.0] * 5), "local_models[1].x0"),
    "NaN": (put("local_models", 3, "A", 1, 2, NAN), "local_models[3].A[1][2]"),
    "infinite": (put("offsets", "static_map", "values", 1, 2, -INFINITY), "offsets.static_map.values[1][2]"),
    "NaN in provenance": (put("provenance", {"a": {"b": [NAN]}}), "provenance.a.b[0]"),
    "spread zero": (put("partition", "spreads", 1, 0.0), "partition.spreads[1]"),
    "spread negative": (put("partition", "spreads", 2, -0.1), "partition.spreads[2]"),
    "spread vanishing": (put("partition", "spreads", 1, 1e-170), "partition.spreads[1]"),
    "range vanishing": (put("partition", "range", [0.0, 1e-320]), "partition.range"),
    "range endless": (put("partition", "range", [-1.7e308, 1.7e308]), "partition.range"),
    "map vanishing": (
        put("offsets", "static_map", "positions", [i * 5e-324 for i in range(7)]),
        "offsets.static_map.positions",
    ),
    "text not for XML": (put("inputs", 0, "description", "a\x01b"), "inputs[0].description"),
    "text not for UTF-8": (put("provenance", {"a": ["\ud800"]}), "provenance.a[0]"),
    "key not for UTF-8": (put("provenance", {"\ud800": 1}), "provenance, key '\\ud800'"),
    "format not a number": (put("format", True), "format"),
    "k_sigma zero": (put("partition", "k_sigma", 0.0), "partition.k_sigma"),
    "k_sigma missing": (put("partition", "k_sigma", None), "partition.k_sigma"),
    "centres equal": (put("partition", "centres", [0.6, 0.9, 0.9, 2.0]), "partition.centres[2]"),
    "centres too few": (put("partition", "centres", [0.6, 0.9]), "partition.centres"),
    "range reversed": (put("partition", "range", [2.5, 0.5]), "partition.range"),
    "scheduling unknown": (put("partition", "scheduling", "u_9"), "partition.scheduling"),
    "validity unknown": (put("partition", "validity", "gaussain"), "partition.validity"),
    "theta with Gaussians": (put("blending", "theta"), "blending"),
    "sample time zero": (put("sample_time", 0.0), "sample_time"),
    "sample time text": (put("sample_time", "0.001"), "sample_time"),
    "number as text": (put("local_models", 0, "A", 0, 0, "0.5"), "local_models[0].A[0][0]"),
    "number as boolean": (put("local_models", 0, "A", 0, 0, True), "local_models[0].A[0][0]"),
    "no inputs": (put("inputs", []), "inputs"),
    "no local models": (put("local_models", []), "local_models"),
    "name with blank": (put("outputs", 1, "name", "contact force"), "outputs[1].name"),
    "name too long": (put("name", "n" * 56), "name"),
    "name twice": (put("outputs", 1, "name", "u_1"), "outputs[1].name"),
    "name taken": (put("outputs", 1, "name", "validity_4"), "outputs[1].name"),
    "name of the policy": (put("outputs", 1, "name", "out_of_range"), "outputs[1].name"),
    "start outside": (put("inputs", 0, "operating_point", 9.0), "inputs[0].operating_point"),
    "limits reversed": (put("inputs", 0, "minimum", 9.0), "inputs[0]"),
    "scheduling feedthrough": (put("local_models", 0, "D", 1, 1, 0.5), "local_models[0].D"),
    "map unordered": (put("offsets", "static_map", "positions", 3, 0.0), "offsets.static_map.positions[3]"),
    "map too narrow": (put("offsets", "static_map", "values", 3, [0.0]), "offsets.static_map.values"),
    "map missing": (put("offsets", "static_map", None), "offsets.static_map"),
    "corner without low-pass": (put("offsets", "corner_frequency", 0.25), "offsets.corner_frequency"),
    "term unknown": (
        put("derived_outputs", 0, "terms", 1, "signal", "eta"),
        "derived_outputs[0].terms[1].signal",
    ),
    "parameter unknown": (
        put("derived_outputs", 1, "parameters", {}),
        "derived_outputs[1].terms[0].parameter",
    ),
    "sign zero": (put("derived_outputs", 0, "terms", 1, "sign", 0), "derived_outputs[0].terms[1].sign"),
    "unknown field": (put("kindd", "n4sid"), "kindd"),
    "unknown field inside": (put("local_models", 1, "E", []), "local_models[1].E"),
    "missing inside": (lambda content: content["inputs"][1].pop("unit"), "inputs[1].unit"),
    "missing": (lambda content: content.pop("offsets"), "offsets"),
    "table with Gaussians": (put("node_table", {"positions": [0.5, 2.5], "weights": []}), "node_table"),
}
TABLED_CASES: dict[str, tuple[Callable[[Content], None], str]] = {
    "weights too few": (put("node_table", "weights", 2, [0.5, 0.5]), "node_table.weights"),
    "weights do not sum": (put("node_table", "weights", 2, [0.5, 0.5, 0.5, 0.5]), "node_table.weights[2]"),
    "nodes unordered": (put("node_table", "positions", 2, 0.6), "node_table.positions[2]"),
    "range not reached": (put("node_table", "positions", 0, 0.6), "node_table.positions"),
    "models missing": (put("node_table", "models", []), "node_table.models"),
    "model of other size": (put("node_table", "models", 4, "A", [[0.5]]), "node_table.models[4].A"),
    "model without g": (put("node_table", "models", 4, "g", None), "node_table.models[4].g"),
    "spreads without Gaussians": (put("partition", "spreads", [1.0] * 4), "partition.spreads"),
    "table missing": (put("node_table", None), "node_table"),
}


@pytest.mark.parametrize("case", GAUSSIAN_CASES)
def test_one_fault_is_named(case: str) -> None:
    change, place = GAUSSIAN_CASES[case]
    content = gaussian()
    change(content)
    assert place in places(content)


@pytest.mark.parametrize("case", TABLED_CASES)
def test_one_fault_around_the_node_table_is_named(case: str) -> None:
    change, place = TABLED_CASES[case]
    content = tabled()
    change(content)
    assert place in places(content)


def test_sound_content_is_not_refused() -> None:
    for content in (gaussian(), tabled(), tabled("output"), tabled("theta", "affine")):
        ParameterSet(**content)


def test_models_in_the_table_do_not_belong_to_output_blending() -> None:
    content = tabled("output")
    content["node_table"]["models"] = tabled()["node_table"]["models"]
    assert places(content) == ["node_table.models"]


def test_affine_offsets_need_their_three_vectors() -> None:
    content = tabled("parameter", "affine")
    for name in ("x0", "u0", "y0"):
        content["local_models"][1][name] = None
    assert places(content) == [f"local_models[1].{name}" for name in ("x0", "u0", "y0")]


def test_low_pass_needs_a_corner() -> None:
    content = tabled("output", "low_pass")
    content["offsets"]["corner_frequency"] = None
    assert places(content) == ["offsets.corner_frequency"]
    content["offsets"]["corner_frequency"] = -0.25
    assert places(content) == ["offsets.corner_frequency"]


def test_unstable_models_are_refused_unless_declared() -> None:
    content = gaussian()
    content["local_models"][2]["A"] = [[1.01 if i == j else 0.0 for j in range(5)] for i in range(5)]
    assert places(content) == ["local_models[2].A"]
    content["declared_unstable"] = True
    assert ParameterSet(**content).declared_unstable


def test_an_unknown_format_version_is_the_only_complaint() -> None:
    content = gaussian() | {"format": FORMAT + 1, "novelty": 1}
    assert places(content) == ["format"]


def test_all_problems_are_named_at_once(tmp_path: Path) -> None:
    content = gaussian()
    put("kindd", 1)(content)
    put("outputs", 0, "unit", 3)(content)
    put("local_models", 0, "E", [])(content)
    put("local_models", 0, "B", 0, 1, NAN)(content)
    put("local_models", 1, "C", [[1.0, 2.0]])(content)
    put("local_models", 2, "A", [[2.0 * (i == j) for j in range(5)] for i in range(5)])(content)
    put("partition", "spreads", [0.5, -1.0, 0.0, 0.5])(content)
    put("partition", "centres", [0.6, 0.5, 1.0, 2.0])(content)
    put("sample_time", -1.0)(content)
    expected = {
        "kindd", "outputs[0].unit", "local_models[0].E", "local_models[0].B[0][1]", "local_models[1].C",
        "local_models[2].A", "partition.spreads[1]", "partition.spreads[2]", "partition.centres[1]",
        "sample_time",
    }  # fmt: skip
    assert expected == set(places(content))
    path = tmp_path / "set.json"
    path.write_text(json.dumps(content))
    with pytest.raises(ParameterSetError) as refused:
        load(path)
    assert {problem.place for problem in refused.value.problems} == expected
    assert all(place in str(refused.value) for place in expected)


def test_a_key_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    text = json.dumps(gaussian())
    path = tmp_path / "set.json"
    path.write_text(text.replace('"sample_time": 0.001', '"sample_time": 0.002, "sample_time": 0.001'))
    with pytest.raises(ParameterSetError, match="the key 'sample_time' is there twice in one object"):
        load(path)
