"""Faults planted into the kernel and its tables: the equalities the other tests demand must break."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path

import networks
import numpy as np
import pytest

import tolerances
from fmu_builder.compiler import load_native
from fmu_builder.kernel import SOURCES, Tables, native, simulate, specification, tables_of, validities

PARAMETER_SET = networks.network(31, "scheduled_equilibrium", "parameter", "gaussian")
INPUTS = networks.inputs_of(31, 40, 3)


def specified() -> networks.Array:
    return np.array(specification.simulate(PARAMETER_SET, INPUTS.tolist()))


def with_array(name: str, change: Callable[[networks.Array], networks.Array]) -> Tables:
    tables = tables_of(PARAMETER_SET)
    return dataclasses.replace(tables, arrays={**tables.arrays, name: change(tables.arrays[name])})


def transposed(array: networks.Array) -> networks.Array:
    return np.ascontiguousarray(array.reshape(4, 3, 5).transpose(0, 2, 1).ravel())


def outputs_swapped(array: networks.Array) -> networks.Array:
    return np.ascontiguousarray(array.reshape(4, 5, 3)[:, :, [1, 0, 2]].ravel())


def fifteen_digits(array: networks.Array) -> networks.Array:
    return np.array([float(f"{value:.15g}") for value in array])


TABLE_FAULTS = {
    "B transposed": ("B", transposed),
    "two outputs swapped": ("C", outputs_swapped),
    "two inputs swapped": ("B", lambda B: np.ascontiguousarray(B.reshape(4, 3, 5)[:, [2, 1, 0]].ravel())),
    "%.15g": ("A", fifteen_digits),
    "unit factor": ("term_coefficients", lambda terms: terms * 1000.0),
}


def test_the_sound_tables_agree() -> None:
    assert np.abs(simulate(with_array("A", np.copy), INPUTS) - specified()).max() == tolerances.BITS


@pytest.mark.parametrize("fault", TABLE_FAULTS)
def test_a_fault_in_the_tables_is_seen(fault: str) -> None:
    tables = with_array(*TABLE_FAULTS[fault])
    assert np.abs(simulate(tables, INPUTS) - specified()).max() > tolerances.BITS


SOURCE_FAULTS = {
    "normalisation dropped": ("inverse = 1.0 / sum;", "inverse = 1.0 + 0.0 * sum;"),
    "maximum not subtracted": ("elementary_exp(weights[i] - highest)", "elementary_exp(weights[i])"),
    "rebase with the new g only": ("0.5 * (v->next[i] + v->g_held[i])", "v->next[i]"),
    "no rebase": ("kernel_rebase(t, &v, &blend, change);", "(void)change;"),
    "one tick too many": ("if (row > 0) kernel_tick(", "if (row >= 0) kernel_tick("),
    "scheduling input not clipped": (
        "kernel_clip(scheduling, FIXED(t, range_low), FIXED(t, range_high))",
        "scheduling",
    ),
    "other order of summation": (
        "for (column = 0; column < columns; ++column)",
        "for (column = columns - 1; column >= 0; --column)",
    ),
    "inaccurate mathematics": (
        '#include "kernel.h"\n',
        '#include "kernel.h"\n#pragma float_control(precise, off)\n',
    ),
}


def planted(fault: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let simulate and validities run a kernel with one line changed."""
    before, after = SOURCE_FAULTS[fault]
    hits = 0
    for path in SOURCES.iterdir():
        text = path.read_text(encoding="utf-8")
        hits += text.count(before)
        (folder / path.name).write_text(text.replace(before, after), encoding="utf-8")
    assert hits == 1, "the line to break has moved"
    monkeypatch.setattr(native, "load_native", lambda name, *_, **__: load_native(name, folder / "host.c"))
    native.library.cache_clear()


@pytest.mark.parametrize("fault", SOURCE_FAULTS)
def test_a_fault_in_the_kernel_is_seen(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "c"
    shutil.copytree(SOURCES, folder)
    planted(fault, folder, monkeypatch)
    try:
        found = simulate(PARAMETER_SET, INPUTS)
        weights = validities(PARAMETER_SET, np.linspace(0.5, 2.5, 41))
    finally:
        monkeypatch.undo()
        native.library.cache_clear()
    assert np.abs(found - specified()).max() > tolerances.BITS
    sums_to_one = np.abs(weights.sum(axis=1) - 1.0).max() <= 10 * tolerances.WEIGHT_SUM
    assert sums_to_one == (fault != "normalisation dropped")
