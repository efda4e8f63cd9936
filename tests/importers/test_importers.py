"""Importers of others run our FMUs; every number is that of the calls made one by one, to the last bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tolerances
from fmus.wbm.parameters import parameter_sets
from importers.jobs import Job

IMPORTERS = ("run_ecos.py", "run_libcosim.py")
COUNT = 120
TIME = np.arange(COUNT) * 0.001
CONSTANT = np.tile([1.55, 1300.0], (COUNT, 1))
MOVING = np.column_stack([1.5 + 0.02 * np.sin(40.0 * TIME), 1310.0 + 60.0 * np.sin(25.0 * TIME + 0.4)])
THREE = np.column_stack([MOVING[:, 0] - 0.2, MOVING[:, 0], 1.4 + 0.1 * np.cos(30.0 * TIME)])
INPUTS = ("::eta", "::M_pa")
OUTPUTS = ("::F_p", "::F_H", "::xi", "::zeta_dot")
SOFT = {"surrogate::k_E": 8e4, "surrogate::theta_m_H_1": 9.5, "surrogate::theta_k_L_4": 26000.0}
HEAVY = {"wbm::mB": 6.25, "wbm::k_E": 61000.0}


def job(fmus: Mapping[str, Path], name: str, rows: np.ndarray, starts: Mapping[str, float]) -> Job:
    """One FMU that starts with the first row of its inputs."""
    driven = tuple(name + one for one in INPUTS)
    outputs = tuple(name + one for one in OUTPUTS)
    if name == "n4sid":
        driven, outputs = ("n4sid::u_0", "n4sid::u_1", "n4sid::u_2"), ("n4sid::y_1", "n4sid::force")
    first = dict(zip(driven, rows[0].tolist(), strict=True))
    return Job({name: str(fmus[name])}, outputs, {**first, **starts}, driven, rows.tolist())


CASES = {
    "wbm, constant": ("wbm", CONSTANT, {}),
    "wbm, moving, other parameters": ("wbm", MOVING, HEAVY),
    "surrogate, constant, other parameters": ("surrogate", CONSTANT, SOFT),
    "surrogate, moving": ("surrogate", MOVING, {}),
    "n4sid, constant": ("n4sid", THREE[:1].repeat(COUNT, axis=0), {}),
    "n4sid, moving": ("n4sid", THREE, {}),
}


@pytest.mark.parametrize("importer", IMPORTERS)
@pytest.mark.parametrize("case", CASES)
def test_an_importer_has_the_bits_of_the_calls_made_by_hand(
    case: str, importer: str, fmus: Mapping[str, Path]
) -> None:
    asked = job(fmus, *CASES[case])
    found, printed = asked.by_importer(importer)
    expected = asked.by_hand()
    assert np.abs(found - expected).max() == tolerances.BITS
    assert (np.ptp(found, axis=0) > 0.0).all() == ("moving" in case)
    assert "error" not in printed.lower()


@pytest.mark.parametrize("importer", IMPORTERS)
def test_without_enumerations_a_parameter_set_is_chosen_value_by_value(
    importer: str, fmus: Mapping[str, Path]
) -> None:
    """Neither importer knows the Enumeration `preset`: Blow is set parameter by parameter."""
    entries = parameter_sets()["Blow"].entries  # unilateral is a Boolean, and off everywhere
    blow = {f"wbm::{entry.name}": entry.value for entry in entries if entry.name != "unilateral"}
    by_values = job(fmus, "wbm", MOVING, blow)
    by_preset = replace(
        by_values,
        starts={
            "wbm::preset": list(parameter_sets()).index("Blow") + 1,
            **{name: value for name, value in by_values.starts.items() if name not in blow},
        },
    )
    found, _ = by_values.by_importer(importer)
    assert np.abs(found - by_preset.by_hand()).max() == tolerances.BITS
    assert np.abs(found - job(fmus, "wbm", MOVING, {}).by_hand()).max() > 1.0


@pytest.mark.parametrize("importer", IMPORTERS)
@pytest.mark.parametrize("follower", ["wbm", "surrogate"])
def test_a_wire_drives_a_pantograph(follower: str, importer: str, fmus: Mapping[str, Path]) -> None:
    """Two FMUs in one co-simulation, eta from the one to the other, without a word of an algebraic loop."""
    asked = Job(
        {"wire": str(fmus["wire"]), follower: str(fmus[follower])},
        ("wire::height", f"{follower}::F_p", f"{follower}::zeta"),
        {"wire::lower": 1.45, "wire::slope": 0.8},
        rows=[[]] * COUNT,
        connections=(("wire::height", f"{follower}::eta"),),
    )
    found, printed = asked.by_importer(importer)
    expected = asked.by_hand(reads_before_transfer=importer == "run_libcosim.py")
    assert np.abs(found - expected).max() == tolerances.BITS
    assert np.ptp(found[:, 1]) > 100.0
    assert not any(word in printed.lower() for word in ("loop", "error"))
