"""Cubic validity, warp and deviation in the schedule: what a parameter set takes and refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import networks
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_builder.errors import ParameterSetError
from fmu_builder.parameter_set import ParameterSet, load, warp_rises


def content(validity: str = "cubic", blending: str = "parameter", **partition: Any) -> dict[str, Any]:
    found = networks.network(1, "scheduled_equilibrium", blending, "hat").model_dump()
    found["partition"] |= {"validity": validity, **partition}
    return found


def places(changed: dict[str, Any]) -> list[str]:
    with pytest.raises(ParameterSetError) as refused:
        ParameterSet(**changed)
    return [problem.place for problem in refused.value.problems]


def test_cubics_are_taken_and_come_back(tmp_path: Path) -> None:
    for changed in (
        content(),
        content("cubic_warp", warp=(-0.2, 0.05)),
        content("cubic_warp", warp=(0.0, 0.0), deviation_output="y_1", deviation_gain=0.5),
        content("cubic", "output", deviation_output="y_1"),
    ):
        original = ParameterSet(**changed)
        again = load(original.save(tmp_path / "set.json"))
        assert again == original and again.model_hash() == original.model_hash()


def test_a_file_without_the_new_fields_is_read(tmp_path: Path) -> None:
    original = networks.network(1, validity="hat")
    text = json.loads(original.canonical_json())
    for name in ("warp", "deviation_output", "deviation_gain"):
        del text["partition"][name]
    (tmp_path / "old.json").write_text(json.dumps(text))
    assert load(tmp_path / "old.json") == original


def test_the_model_hash_sees_warp_and_gain() -> None:
    hashes = {
        ParameterSet(
            **content("cubic_warp", warp=warp, deviation_output="y_0", deviation_gain=gain)
        ).model_hash()
        for warp in ((0.0, 0.0), (0.1, 0.0))
        for gain in (0.0, 0.3)
    }
    assert len(hashes) == 4


CASES: dict[str, tuple[dict[str, Any], str]] = {
    "warp missing": (content("cubic_warp"), "partition.warp"),
    "warp without its validity": (content("cubic", warp=(0.0, 0.1)), "partition.warp"),
    "warp that falls at an end": (content("cubic_warp", warp=(-0.6, 0.0)), "partition.warp"),
    "warp that falls inside": (content("cubic_warp", warp=(1.5, 0.7)), "partition.warp"),
    "warp not finite": (content("cubic_warp", warp=(float("nan"), 0.0)), "partition.warp[0]"),
    "warp of three numbers": (content("cubic_warp", warp=(0.0, 0.0, 0.0)), "partition.warp"),
    "cubic without table": ({**content(), "node_table": None}, "node_table"),
    "gain without output": (content(deviation_gain=0.1), "partition.deviation_gain"),
    "output unknown": (content(deviation_output="y_9", deviation_gain=0.1), "partition.deviation_output"),
    "an input is no output": (content(deviation_output="u_0"), "partition.deviation_output"),
    "gain and output blending": (
        content("cubic", "output", deviation_output="y_1", deviation_gain=0.1),
        "partition.deviation_gain",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_does_not_fit_is_refused(case: str) -> None:
    changed, place = CASES[case]
    assert place in places(changed)


@pytest.mark.parametrize("offsets", ["none", "affine", "low_pass"])
def test_a_gain_needs_a_scheduled_equilibrium(offsets: str) -> None:
    changed = networks.network(1, offsets, "parameter", "hat").model_dump()
    changed["partition"] |= {"deviation_output": "y_1", "deviation_gain": 0.2}
    assert places(changed) == ["partition.deviation_gain"]


def test_a_gain_needs_a_node_table() -> None:
    changed = networks.network(1, "scheduled_equilibrium", "parameter", "gaussian").model_dump()
    changed["partition"] |= {"deviation_output": "y_1", "deviation_gain": 0.2}
    assert places(changed) == ["partition.deviation_gain"]


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.1, 3.0))
def test_a_warp_rises_where_its_derivative_is_positive(quadratic: float, cubic: float, reach: float) -> None:
    d = np.linspace(-reach, reach, 4001)
    slope = 1.0 + 2.0 * quadratic * d + 3.0 * cubic * d * d
    if abs(slope.min()) > 1e-4:
        assert warp_rises((quadratic, cubic), reach) == bool(slope.min() > 0.0)
