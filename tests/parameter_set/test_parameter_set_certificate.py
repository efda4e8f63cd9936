"""A certificate in the parameter set: outside the model hash, new in format 2, kept to the last bit."""

from __future__ import annotations

import json
from pathlib import Path

import certified_networks as networks
import numpy as np
import pytest

from fmu_builder.errors import ParameterSetError
from fmu_builder.parameter_set import FORMAT, ParameterSet, load


def certified() -> ParameterSet:
    plain = networks.oscillators()
    P = np.arange(45.0).reshape(5, 3, 3) / 7.0
    content = networks.certificate_of(
        plain, P, 3.7, decay=0.1, exclusion={"nodes": [0, 4], "matrices": [np.eye(3).tolist()] * 2}
    )
    return networks.with_certificate(plain, content)


def test_a_certificate_stands_outside_the_model_hash() -> None:
    assert certified().model_hash() == networks.oscillators().model_hash()


def test_a_certificate_comes_back_bit_by_bit(tmp_path: Path) -> None:
    again = load(certified().save(tmp_path / "certified.json"))
    assert again == certified()
    assert again.canonical_json() == certified().canonical_json()


def test_an_older_format_becomes_the_present_one_under_the_same_hash(tmp_path: Path) -> None:
    plain = networks.oscillators()
    old = json.loads(plain.canonical_json()) | {"format": 1}
    for name in ("certificate", "trained_region", "residual_bands"):
        del old[name]
    (tmp_path / "old.json").write_text(json.dumps(old), encoding="utf-8")
    read = load(tmp_path / "old.json")
    assert read == plain and read.format == FORMAT
    assert read.model_hash() == plain.model_hash()


def test_format_1_knows_no_certificate() -> None:
    with pytest.raises(ParameterSetError) as caught:
        ParameterSet(**(json.loads(certified().canonical_json()) | {"format": 1}))
    assert [problem.place for problem in caught.value.problems] == [
        "certificate",
        "residual_bands",
        "trained_region",
    ]


@pytest.mark.parametrize("field", ["matrices", "method", "model_hash", "decay"])
def test_a_certificate_with_a_part_missing_or_unreadable_is_refused(field: str) -> None:
    for value in (None, "x" if field in ("matrices", "decay") else 7):
        content = json.loads(certified().canonical_json())
        content["certificate"][field] = value
        with pytest.raises(ParameterSetError, match=rf"certificate\.{field}"):
            ParameterSet(**content)


def test_a_certificate_with_a_number_that_is_none_is_refused() -> None:
    content = json.loads(certified().canonical_json())
    content["certificate"]["matrices"][1][2][0] = float("nan")
    with pytest.raises(ParameterSetError, match=r"certificate\.matrices\[1\]\[2\]\[0\]"):
        ParameterSet(**content)
